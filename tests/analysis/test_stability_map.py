from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from drake_tc.analysis.stability_map import Axis, draw_map, stability_map
from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError

LOOP = JointLoop.with_equivalent_gains(
    1.0, 0.01, inertia=1.1, link_inertia=0.4, k_tau=1.2e-4, k_v=7e-3, k_tau_model=1.1e-4, k_v_model=6.5e-3
)
IDLE = replace(LOOP, kp=0.0, ks=0.0, kd=0.0)


def test_friction_feedforward_alone_is_stable_up_to_the_true_friction_whatever_the_window():
    """J vdot = -b v + b' v(t - d): with |b'| < b no delay destabilises it, and b' > b runs away at any."""
    found = stability_map(IDLE, Axis("window", (10, 40, 80, 120)), Axis.parse("friction=0.5:1.5:0.0625"))
    friction = np.array(found.y.values)
    for column in range(4):
        np.testing.assert_array_equal(found.stable[friction < 1.0, column], True)
        np.testing.assert_array_equal(found.stable[friction > 1.0, column], False)


def test_points_are_those_of_the_loop_wherever_they_are_computed():
    x, y = Axis.parse("window=20:100:40"), Axis.parse("kp=0,2,4")
    here = stability_map(LOOP, x, y, "sensitivity_peak")
    for i, kp in enumerate(y.values):
        for j, window in enumerate(x.values):
            per = LOOP.k_tau_model * (1.0 + kp)
            loop = replace(LOOP, window=int(window), kp=kp, ks=1.0 / per, kd=0.01 / per)
            assert here.radius[i, j] == loop.spectral_radius()
            if here.stable[i, j]:
                assert here.values[i, j] == loop.margins().sensitivity_peak
            else:
                assert np.isnan(here.values[i, j])
    with ThreadPoolExecutor(2) as executor:
        there = stability_map(LOOP, x, y, "sensitivity_peak", executor=executor)
    np.testing.assert_array_equal(there.values, here.values)
    np.testing.assert_array_equal(there.radius, here.radius)
    assert here.present == (80.0, 2.0)


def test_points_that_cannot_be_are_left_out_and_named():
    found = stability_map(LOOP, Axis("window", (2, 40)), Axis("kp", (1.0, 2.0)))
    np.testing.assert_array_equal(np.isnan(found.radius), [[True, False], [True, False]])
    assert [text.partition(": ")[0] for text in found.failed] == ["window = 2, kp = 1", "window = 2, kp = 2"]
    assert "JointLoop(" not in found.failed[0]
    assert found.to_json()["values"][0][0] is None
    with pytest.raises(ParamsError, match="map: no point can be computed; window = 1, kp = 1: "):
        stability_map(LOOP, Axis("window", (1, 2)), Axis("kp", (1.0,)))


@pytest.mark.parametrize(
    "text", ["window", "window=a:b:c", "window=1:2", "window=5:1:1", "window=1:5:0", "kp=", "kp=1:inf:1"]
)
def test_an_axis_in_another_form_is_refused(text):
    with pytest.raises(ParamsError, match=r"expected NAME=FIRST:LAST:STEP"):
        Axis.parse(text)


def test_other_refusals():
    with pytest.raises(ParamsError, match=r"no parameter 'gain'; possible: inertia, .*friction"):
        Axis("gain", (1.0,))
    with pytest.raises(ParamsError, match="expected finite values"):
        Axis("kp", (np.inf,))
    with pytest.raises(ParamsError, match="at most 1000000 values"):
        Axis.parse("kp=0:1:1e-9")
    with pytest.raises(ParamsError, match="no figure 'colour'; possible: spectral_radius"):
        stability_map(LOOP, Axis("kp", (1.0,)), Axis("window", (20,)), "colour")
    with pytest.raises(ParamsError, match="expected two parameters"):
        stability_map(LOOP, Axis("kp", (1.0,)), Axis("kp", (1.0,)))


def test_axes_hold_their_last_value():
    assert Axis.parse("kp=0:0.6:0.2").values == pytest.approx((0.0, 0.2, 0.4, 0.6))
    assert Axis.parse("window=20:160:20").values[-1] == 160.0
    assert Axis.parse("kp=3").values == (3.0,)


def test_the_border_and_the_present_setting_are_drawn(tmp_path):
    found = stability_map(LOOP, Axis.parse("window=20:120:20"), Axis.parse("friction=0.5:6:0.5"))
    assert 0.0 < found.stable.mean() < 1.0
    figure = Figure()
    draw_map(figure, found)
    figure.savefig(tmp_path / "map.svg")
    (star,) = figure.axes[0].lines
    assert (star.get_xdata()[0], star.get_ydata()[0]) == found.present
    (border,) = [c for c in figure.axes[0].collections if type(c).__name__ == "QuadContourSet"]
    assert border.levels.tolist() == [1.0]
