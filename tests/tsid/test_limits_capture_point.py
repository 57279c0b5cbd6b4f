"""The capture point's rows against the motion itself, and hulls against another library."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import CapturePointLimit, convex_hull, half_planes
from drake_tc.tsid.model import TsidModel

from .problems import SOLES, Setup, model, robot, state

H = 5e-3
MOVING = Setup(speed=0.5, lean=0.2)


def quaternion_rate(q, omega) -> np.ndarray:
    """Qdot of [w x y z] for omega in world axes."""
    w, x, y, z = q
    return 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]]) @ omega


def moved(it, q, v, vdot, time) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) after `time` at constant vdot, by Runge-Kutta of order 4."""

    def rate(t, q):
        speed, out = v + vdot * t, np.zeros(it.nq)
        out[:4], out[4:7] = quaternion_rate(q[:4], speed[:3]), speed[3:6]
        out[it.positions] = speed[it.actuated]
        return out

    k1 = rate(0, q)
    k2 = rate(time / 2, q + time / 2 * k1)
    k3 = rate(time / 2, q + time / 2 * k2)
    k4 = rate(time, q + time * k3)
    q = q + time / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    q[:4] /= np.linalg.norm(q[:4])
    return q, v + vdot * time


@pytest.mark.parametrize("seed", range(4))
def test_rows_say_where_the_capture_point_goes(seed):
    rng, it = np.random.default_rng(seed), model()
    q, v = state(rng, MOVING)
    limit, scratch = CapturePointLimit(SOLES, period=H, margin=0.01), it.create_scratch()
    terms = it.terms(scratch, q, v)
    rows = limit.rows(terms)
    soles = [terms.pose(sole.name)[0] @ corner + terms.pose(sole.name)[1] for sole in SOLES for corner in sole.corners]
    corners = np.array(soles)[:, :2]
    height = terms.com[2] - np.mean([terms.pose(sole.name)[1][2] for sole in SOLES])
    rate = np.sqrt(9.81 / height)
    assert_allclose(limit.capture_point(terms), terms.com[:2] + terms.com_velocity[:2] / rate, rtol=1e-12)
    for vdot in (np.zeros(it.nv), rng.uniform(-3, 3, it.nv)):
        after = it.terms(scratch, *moved(it, q, v, vdot, H))
        hull = ConvexHull(corners)
        point = after.com[:2] + after.com_velocity[:2] / rate
        outside = hull.equations[:, :2] @ point + hull.equations[:, 2] + 0.01
        ours = rows.matrix.vdot @ vdot - rows.upper
        # the centre of mass' jerk over one period is what the linear rows leave out: h^2 / w ~ 1e-5 of it
        assert_allclose(np.sort(ours), np.sort(outside), rtol=0, atol=2e-4)
        assert_allclose(ours.max(), outside.max(), rtol=0, atol=2e-4)
    assert np.isneginf(rows.lower).all()


def test_the_gradient_is_exact_at_rest():
    """There the Jacobian stays as it is over a period, and half a period's square counts."""
    it, h = model(), 5e-3
    q, v = state(np.random.default_rng(0), Setup(speed=0.0, lean=0.2))
    limit, scratch = CapturePointLimit(SOLES, period=h), it.create_scratch()
    terms = it.terms(scratch, q, v)
    rows, normals = limit.rows(terms), half_planes(limit.corners(terms)[0])[0]
    rate = np.sqrt(9.81 / (terms.com[2] - np.mean([terms.pose(sole.name)[1][2] for sole in SOLES])))
    for direction in np.eye(it.nv)[::5]:
        points = []
        for vdot in (-direction, direction):
            after = it.terms(scratch, *moved(it, q, v, vdot, h))
            points.append(after.com[:2] + after.com_velocity[:2] / rate)
        slope = normals @ (points[1] - points[0]) / 2.0
        assert_allclose(rows.matrix.vdot @ direction, slope, rtol=1e-3, atol=1e-3 * np.abs(rows.matrix.vdot).max())


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 16))
def test_the_hull_is_that_of_another_library(seed, count):
    points = np.random.default_rng(seed).normal(size=(count, 2))
    ours = np.array(convex_hull([tuple(point) for point in points]))
    theirs = points[ConvexHull(points).vertices]
    assert {tuple(point) for point in ours} == {tuple(point) for point in theirs}
    normals, reach = half_planes([tuple(point) for point in points])
    equations = ConvexHull(points).equations
    order, other = np.lexsort(normals.T), np.lexsort(equations[:, :2].T)
    assert_allclose(np.column_stack((normals, -reach))[order], equations[other], rtol=0, atol=1e-9)


def test_corners_on_an_edge_and_doubled_ones_make_no_row():
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    normals, reach = half_planes([*square, *square, (0.5, 0.0), (0.0, 0.25)])
    assert sorted(map(tuple, np.column_stack((normals, reach)).round(12).tolist())) == [
        (-1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0),
        (0.0, 1.0, 1.0),
        (1.0, 0.0, 1.0),
    ]


@pytest.mark.parametrize("points", [[(0.3, -0.2)], [(0.3, -0.2), (0.3, -0.2)], [(0.3, -0.2), (0.7, 0.1)]])
def test_a_point_or_a_segment_holds_itself_alone(points):
    normals, reach = half_planes(points)
    for point in points:
        assert (normals @ point <= reach + 1e-12).all()
    middle = np.mean(points, axis=0)
    for angle in np.linspace(0, 2 * np.pi, 17):
        away = middle + 1.0 * np.array([np.cos(angle), np.sin(angle)])
        assert (normals @ away > reach + 1e-3).any()


def test_one_foot_no_foot_and_points():
    q, v = state(np.random.default_rng(0), Setup())
    tips = tuple(Contact(f"tip{i}", Mount(f"tip{i}", link), "point") for i, link in enumerate(("r_foot", "l_foot")))
    contacts = (*SOLES, *tips)
    it = TsidModel(robot(), contacts)
    limit, scratch = CapturePointLimit(contacts, period=H), it.create_scratch()
    sizes = {
        (True, False, False, False): 4,
        (False,) * 4: 0,
        (False, False, True, True): 4,
        (True, True, True, True): 6,
    }
    for active, size in sizes.items():
        rows = limit.rows(it.terms(scratch, q, v, active))
        assert rows.matrix.vdot.shape == (size, it.nv) and len(rows.labels) == size
        assert np.isfinite(rows.upper).all()


def test_a_state_that_is_no_number_gives_rows_that_are_none():
    it = model()
    rows = CapturePointLimit(SOLES, period=H).rows(it.terms(it.create_scratch(), it.start * np.nan, np.zeros(it.nv)))
    assert np.isnan(rows.upper).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": 0.0}, "period: expected a positive number"),
        ({"gravity": np.inf}, "gravity: expected a positive number"),
        ({"margin": np.nan}, "margin: expected a finite number >= 0"),
        ({"margin": -0.01}, "margin: expected a finite number >= 0"),
        ({"contacts": ()}, "capture point: expected contacts"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ParamsError, match=message):
        CapturePointLimit(**{"contacts": SOLES, "period": H, **change})
