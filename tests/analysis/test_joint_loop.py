"""The closed form of one joint against the Drake diagram of the same loop, linearised; and what it says by itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sweeps import slow_but

from drake_tc.analysis.sampled import linearise, open_loop
from drake_tc.control.joint_loop import JointLoop, value_of
from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import savgol_weights
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.registry import diagram_entry

from .leg_joint import closed_form, spring_loop, started, write_scenario

TRUE, MODEL = (2.12e-4, 0.013, 0.3), (2.2e-4, 0.0135, 0.0)
YAW = JointLoop.with_equivalent_gains(
    1.0, 0.01, 2.0, inertia=0.363, link_inertia=0.063, k_tau=2.12e-4, k_v=0.013, k_tau_model=2.12e-4, k_v_model=0.013
)
CASES = {
    "yaw": ("r_hip_yaw", {"gains": {"k6": 1.0, "k7": 0.01, "kp": 2.0}}),
    "knee with all gains": (
        "r_knee",
        {"configuration": "estimate", "gains": {"k6": 0.25, "k7": 0.005, "kp": 1.0, "ki": 5.0, "kf": 0.5}},
    ),
    "reference velocity": (
        "r_ankle_pitch",
        {"compensation": {"velocity": "reference"}, "gains": {"k6": 0.5, "k7": 0.01, "kp": 1.0}},
    ),
}


@pytest.mark.parametrize("case", slow_but(CASES, "knee with all gains"))
def test_eigenvalues_are_those_of_the_diagram(case, tmp_path):
    joint, changes = CASES[case]
    scenario = write_scenario(tmp_path, joint, TRUE, MODEL, {"filters": {"window": 10}, **changes})
    loop, context = started(scenario)
    found = linearise(loop.diagram, context, scenario.dt, step=1e-4)
    mine = closed_form(loop, context, TRUE, MODEL)
    # wide differences: these drives are linear, and torques of 10 N m round
    distances = np.abs(found.eigenvalues[:, None] - mine.eigenvalues[None, :6]).min(axis=0)
    assert_allclose(distances, 0.0, atol=1e-6)
    assert_allclose(found.radius_but_for_drift(1e-6), mine.spectral_radius(), atol=1e-6)


def command_loop(joint, omega):
    """L (W,) with the loop cut at the command q + y, where the servo's own loop stays closed."""
    shift = np.exp(-1j * omega * joint.dt)
    plant, integrator, feedback = (
        np.polynomial.polynomial.polyval(shift, part) for part in (joint.plant, joint.integrator, joint.feedback)
    )
    through = joint.drive_gain * shift / plant
    return -(1.0 + feedback / integrator) * through / (1.0 + through)


def test_open_loop_is_that_of_the_diagram(tmp_path):
    scenario = write_scenario(tmp_path, "r_hip_yaw", TRUE, MODEL, {"filters": {"window": 10}})
    loop, context = started(scenario)
    cut = open_loop(loop.diagram, context, scenario.dt, "torque_control:command")
    omega = np.geomspace(1.0, 3000.0, 40)
    mine = closed_form(loop, context, TRUE, MODEL)
    assert_allclose(cut.loop_response(0)(omega), command_loop(mine, omega), rtol=1e-6)
    at_effort = open_loop(
        loop.diagram, context, scenario.dt, "torque_control:command", relative_to="torque_control:position"
    )
    assert_allclose(at_effort.loop_response(0)(omega), mine.open_loop(omega), rtol=1e-6)
    assert_allclose(at_effort.closed().spectral_radius, cut.closed().spectral_radius, atol=1e-9)
    with pytest.raises(ParamsError, match="relative_to: expected a port of size"):
        open_loop(loop.diagram, context, scenario.dt, "torque_control:command", relative_to="plant:state")
    with pytest.raises(ParamsError, match="within the tick"):
        open_loop(loop.diagram, context, scenario.dt, "torque_control:command", relative_to="guard:command")


@pytest.mark.parametrize("kf", [pytest.param(0.0, marks=pytest.mark.slow), 1.5])
def test_against_a_spring_it_is_the_diagram_too(kf, tmp_path):
    loop, context, mine = spring_loop(tmp_path, kf)
    found = linearise(loop.diagram, context, 1e-3, step=1e-4)
    distances = np.abs(found.eigenvalues[:, None] - mine.eigenvalues[None, :6]).min(axis=0)
    assert_allclose(distances, 0.0, atol=1e-6)
    assert mine.environment_stiffness > 0.0


def test_over_compensated_friction_runs_away_at_the_rate_of_the_delay():
    """v(t) = r v(t - T): with J/b much shorter than the delay T, one T multiplies the speed by r = K_v'/K_v."""
    for ratio in (0.9, 1.1):
        loop = replace(YAW, kp=0.0, ks=0.0, kd=0.0, k_v_model=ratio * YAW.k_v, inertia=1e-3 * YAW.inertia)
        assert_allclose(loop.spectral_radius(), ratio ** (1.0 / 40.5), rtol=2e-3)


def test_the_border_of_free_sliding_is_exact_compensation():
    for window in (20, 80):
        at = replace(YAW, kp=0.0, ks=0.0, kd=0.0, window=window)
        assert replace(at, k_v_model=1.001 * at.k_v).spectral_radius() > 1.0
        assert replace(at, k_v_model=0.999 * at.k_v).spectral_radius() < 1.0


def test_a_joint_that_nothing_holds_drifts_and_is_judged_by_its_speed():
    free = replace(YAW, ks=0.0)
    assert abs(np.polyval(free.characteristic(), 1.0)) < 1e-12
    assert np.abs(free.eigenvalues - 1.0).min() > 1e-4
    assert not free.holds_position and YAW.holds_position


def test_the_gain_margin_is_where_the_loop_goes_unstable():
    loop = replace(YAW, ks=0.1 * YAW.ks, kd=0.0, environment_stiffness=600.0, kf=0.2, kp=1.0, k_v_model=0.9 * YAW.k_v)
    found = loop.margins()
    assert loop.spectral_radius() < 1.0 < found.gain_margin
    for factor, stable in ((0.99, True), (1.01, False)):
        # a factor on y scales K_tau' and K_v' alike, with all gains as they are
        g = found.gain_margin * factor
        scaled = replace(loop, k_tau_model=g * loop.k_tau_model, k_v_model=g * loop.k_v_model)
        assert (scaled.spectral_radius() < 1.0) is stable


def test_the_extra_delay_takes_its_share_of_the_delay_margin_on_the_estimates():
    """Only estimates are delayed: with all feedback through them, ticks beyond the delay margin make it unstable.

    Friction is compensated in part: where it is in full, nothing holds the speed, whose root is 1 up to rounding.
    """
    loop = replace(YAW, ks=0.0, kd=0.0, kp=4.0, link_inertia=0.2, window=20, k_v_model=0.9 * YAW.k_v)
    ticks = loop.margins().delay_margin / loop.dt
    assert loop.spectral_radius() < 1.0 and 1.0 < ticks < 1e3
    assert replace(loop, extra_delay=int(np.floor(ticks))).spectral_radius() < 1.0
    assert replace(loop, extra_delay=int(np.ceil(ticks))).spectral_radius() > 1.0


def test_tracking_by_time_recursion():
    """The closed-loop error to a sine, from the recursion of the module's docstring, tick by tick."""
    loop, omega = replace(YAW, window=12, kp=1.0, rotor_model=0.2), 9.0
    steps = 4000
    assert loop.spectral_radius() < 0.995
    h, b = loop.dt, loop.k_v / loop.k_tau
    w = [savgol_weights(12, 2, None, k, h) for k in (1, 2)]
    w0 = savgol_weights(12, 1, None, 0, h)
    q, acceleration = np.zeros(steps + 1), np.zeros(steps)
    for n in range(13, steps):
        s = 1j * omega
        q_d, v_d, a_d = (float((s**k * np.exp(s * n * h)).imag) for k in range(3))
        past = q[n - 12 : n]
        late_v, late_a = (x @ past for x in w)
        force = -(w0 @ (loop.sensed_inertia * acceleration[n - 12 : n])) + loop.sensed_inertia * late_a
        estimate = loop.link_inertia * late_a - force
        desired = loop.link_inertia * a_d + loop.ks * (q_d - q[n]) + loop.kd * (v_d - late_v)
        effort = loop.k_tau_model * (desired + loop.kp * (desired - estimate) + loop.rotor_model * a_d)
        effort += loop.k_v_model * late_v
        speed = (q[n] - q[n - 1]) / h
        end = (speed + h / loop.inertia * effort / loop.k_tau) / (1.0 + h * b / loop.inertia)
        acceleration[n] = (effort / loop.k_tau - b * end) / loop.inertia
        q[n + 1] = q[n] + h * (speed + h * acceleration[n])
    n = np.arange(steps // 2, steps)
    basis = np.exp(1j * omega * n * h)
    design = np.column_stack([basis.real, basis.imag])
    cosine, sine = np.linalg.lstsq(design, q[n], rcond=None)[0]
    closed = 1.0 - loop.tracking(np.array([omega]))[0]  # q/q_d; q_d is a sine
    assert_allclose([sine, cosine], [closed.real, closed.imag], rtol=1e-5, atol=1e-8)


def test_loops_of_a_scenario():
    scenario = diagram_entry("hrp2_leg").scenario("float")
    loops = {way: joint_loops(scenario, way) for way in (-1.0, 0.0, 1.0)}
    for joint, loop in loops[0.0].items():
        assert loop.window == 80 and loop.gravity_at == "estimate"
        assert loop.k_v / loop.k_tau == pytest.approx(loops[1.0][joint].k_v / loops[1.0][joint].k_tau)
    ratios = {way: value_of(each["r_knee"], "friction") for way, each in loops.items()}
    assert_allclose([ratios[1.0] / ratios[0.0], ratios[-1.0] / ratios[0.0]], [1.02, 0.98], rtol=1e-9)  # its switch


@pytest.mark.parametrize(
    ("text", "differs"),
    [
        ("{controller: servo}", "controller"),
        ("{torque_from: sensor}", "torque_from"),
        ("{predictor: {}}", "predictor"),
        ("{predictor: {}, observer: {}}", "predictor, observer"),
    ],
)
def test_another_loop_than_the_closed_form_is_refused(text, differs):
    scenario = diagram_entry("hrp2_leg").scenario("brisk_swing", text=text)
    with pytest.raises(ParamsError, match=f"expected a loop in torque control .* it differs in {differs}$"):
        joint_loops(scenario)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inertia": 0.0}, r"JointLoop.inertia: expected a positive number"),
        ({"kp": -1.0}, r"JointLoop.kp: expected a number >= 0"),
        ({"kf": np.nan}, r"JointLoop.kf: expected a finite number"),
        ({"extra_delay": 1.5}, r"JointLoop.extra_delay: expected a whole number"),
        ({"gravity_at": "moon"}, r"JointLoop.gravity_at: expected estimate or reference"),
        ({"window": 2}, r"window of at least order \+ 1"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(ParamsError, match=message):
        replace(YAW, **changes)
