"""Soft soles: how far they give way, against springs worked out otherwise, and what an estimate gains by knowing it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import CopEstimator, soft_sole
from drake_tc.estimation.base_log import run_log, track_error
from drake_tc.estimation.base_rig import ContactSpec
from drake_tc.kernels.base.contacts import shape_of
from drake_tc.kernels.base.sample import HALF_PLANES
from drake_tc.robot.fields import Mount, Pose

from .constructed import HALF, SOLE, Motion, construct, spec, walker

K, PERIOD = 1e5, 5e-3


def contact(points=(5, 3), stiffness=K):
    return ContactSpec(Mount("sole", "link", Pose()), SOLE, None, 30.0, 20.0, stiffness, points)


def shape(sole, x, y):
    """g by the kernels, whose row of a contact has the sole's stiffness, origin and step at places 3 to 7."""
    row = np.zeros(HALF_PLANES)
    row[3:8] = sole.stiffness, *sole.origin, *sole.step
    return shape_of(row, sole.table.ravel(), x, y)


def radius2(points):
    m = np.array(points)
    return HALF**2 * (m + 1) / (3.0 * (m - 1))


@pytest.mark.parametrize("points", [(5, 3), (2, 2), (4, 7)])
def test_as_long_as_all_springs_touch_it_is_the_closed_form(points):
    """All do where sum |c_i| a_i/r_i^2 < 1; the table is linear between its nodes, 8.3 and 4.2 mm apart."""
    sole, rng = soft_sole(contact(points)), np.random.default_rng(0)
    core = radius2(points) / HALF
    for share in rng.uniform(-1.0, 1.0, (40, 2)):
        c = share * core / max(1.0, np.abs(share).sum())
        wanted = 1.0 + (c**2 / radius2(points)).sum()
        node = HALF / 12.0
        assert_allclose(shape(sole, *c), wanted, atol=(0.25 * node**2 / radius2(points)).sum() + 0.02, rtol=0.0)


@pytest.mark.parametrize("y", [0.01, 0.035, 0.045])
def test_on_its_edge_it_is_the_balance_of_springs_that_only_push(y):
    """Tilt about x alone: depth and tilt from the balance of forces and moments, found by bisection."""
    rows = HALF[1] * np.array([-1.0, 0.0, 1.0])

    def push(tilt, depth):
        return K / 3.0 * np.maximum(0.0, depth + tilt * rows)

    def depth_of(tilt, load):
        return brentq(lambda depth: push(tilt, depth).sum() - load, -1.0, 1.0, xtol=1e-14)

    load = 200.0
    tilt = brentq(lambda angle: push(angle, depth_of(angle, load)) @ rows - load * y, 0.0, 1.0, xtol=1e-14)
    sink = depth_of(tilt, load) + tilt * y
    sole = soft_sole(contact((5, 3)))
    assert_allclose(load * shape(sole, 0.0, y) / K, sink, rtol=0.01)


def test_outside_it_is_the_edge_and_inside_it_never_falls():
    sole = soft_sole(contact())
    assert_allclose(shape(sole, 9.0, 0.0), shape(sole, HALF[0], 0.0), rtol=1e-6)
    assert_allclose([shape(sole, HALF[0], 0.0), shape(sole, 0.0, HALF[1])], [5.0, 3.0], rtol=1e-3)
    along = [shape(sole, x, 0.0) for x in np.linspace(0.0, HALF[0], 60)]
    assert (np.diff(along) > -1e-9).all()


@pytest.fixture(scope="module")
def standing():
    return construct(Motion(duration=1.0, period=PERIOD, rest=9.0))


def errors(made, truth, **sole):
    tuned = spec(PERIOD, velocity_time=1e-3, position_time=1e-3)
    tuned = replace(tuned, contacts=tuple(replace(item, **sole) for item in tuned.contacts))
    track = run_log(CopEstimator(walker(), tuned), made.log, truth.position[0], 0.0)
    return track_error(track, truth).position[2]


def test_an_estimate_that_knows_its_soles_finds_the_height(standing):
    """Feet pressed by 200 N more sink by 10 mm, unseen by encoders; a K that is 30 % wrong costs a third."""
    stiffness, log = 2e4, standing.log
    extra = 200.0 * np.sin(2.0 * np.pi * log.time) ** 2
    down = -extra / stiffness
    wrench, accel = log.wrench.copy(), log.accel.copy()
    wrench[:, :, 2] += extra[:, None]
    accel[:, 2] += np.gradient(np.gradient(down, PERIOD), PERIOD)
    truth = replace(standing.truth, position=standing.truth.position + down[:, None] * [0.0, 0.0, 1.0])
    sinking = replace(standing, log=replace(log, wrench=wrench, accel=accel))
    rigid = errors(sinking, truth)
    known, weak, hard = (errors(sinking, truth, sole_stiffness=f * stiffness) for f in (1.0, 0.7, 1.3))
    assert_allclose(rigid, np.sqrt((down**2).mean()), rtol=0.1)
    assert known < 0.05 * rigid
    assert_allclose([weak, hard], np.array([1.0 / 0.7 - 1.0, 1.0 - 1.0 / 1.3]) * rigid, rtol=0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sole_stiffness": 0.0}, "sole_stiffness: expected a number above 0 .N/m., got 0.0"),
        ({"polygon": None}, "sole_stiffness: expected a sole beside it; this contact is a point"),
        ({"sole_points": (1, 3)}, r"sole_points: expected two numbers >= 2, got \(1, 3\)"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(ParamsError, match=message):
        replace(contact(), **changes)


def test_rigid_soles_and_points_do_not_give_way():
    assert soft_sole(contact(stiffness=None)) is None
    assert soft_sole(replace(contact(stiffness=None), polygon=None)) is None
