"""Stage 1: the closed form, the program where a sole ends, and the signs, each by another route."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import rows_of, soles_of, solve_program
from drake_tc.estimation.base_rig import ContactSpec, half_planes
from drake_tc.kernels.base.velocity import UNSOLVED, VelocityProblem, into_sole, solve_velocity, write_program
from drake_tc.robot.fields import Mount

SOLE = ((-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05))
HEXAGON = tuple((0.08 * np.cos(a), 0.05 * np.sin(a)) for a in np.arange(6) * np.pi / 3)


def contact(name, polygon):
    return ContactSpec(Mount(name, "link"), polygon, None, 20.0, 10.0)


def solved(problem, contacts, *, at_edge=False):
    """(ydot, x, limited) as a tick has them: the kernel, and where it asks for it the program."""
    soles, k = soles_of(contacts), len(contacts)
    found = solve_velocity(problem, rows_of(contacts), at_edge, np.zeros(4 + 3 * k))
    if found.how == UNSOLVED:
        program = np.empty(5 + 13 * k)
        write_program(program, problem)
        found = solve_velocity(problem, rows_of(contacts), at_edge, solve_program(program, soles))
    return found.velocity, found.pressure, found.limited


def problem_of(rng, polygons, *, spread=0.003, reach=0.03, beyond=0.0, off=()):
    k = len(polygons)
    flat = np.array([polygon is not None for polygon in polygons], dtype=float)
    matrix = rng.normal(size=(k, 3, 2))
    pressure = flat[:, None] * rng.uniform(-reach, reach, (k, 2))
    pressure[:, 0] += flat * beyond
    weight = rng.uniform(0.2, 1.0, k)
    weight[list(off)] = 0.0
    return VelocityProblem(
        reference=rng.normal(size=3) * 0.1,
        trust=rng.uniform(0.5, 5.0) / 0.02**2,
        matrix=matrix,
        still=rng.normal(size=(k, 3)) * 0.1 + np.matmul(matrix, pressure[:, :, None])[:, :, 0],
        pressure=pressure,
        spread=flat * spread,
        weight=weight,
        deviation=0.02,
    )


def cost(p, y, x):
    """The program's cost, term by term as the module's text has it."""
    total = p.trust * np.sum((y - p.reference) ** 2)
    for i in range(len(x)):
        if p.weight[i] == 0.0:
            continue
        offset = p.still[i] - p.matrix[i] @ p.pressure[i]
        total += p.weight[i] / p.deviation**2 * np.sum((y + offset + p.matrix[i] @ x[i]) ** 2)
        if p.spread[i] > 0.0:
            total += np.sum((x[i] - p.pressure[i]) ** 2) / p.spread[i] ** 2
    return total


@pytest.mark.parametrize("seed", range(10))
def test_the_closed_form_is_where_the_gradient_vanishes(seed):
    rng = np.random.default_rng(seed)
    polygons = [SOLE, HEXAGON, None][: rng.integers(1, 4)]
    p = problem_of(rng, polygons, spread=0.002, reach=0.01)
    y, x, limited = solved(p, tuple(contact(str(i), c) for i, c in enumerate(polygons)))
    assert not any(limited)
    h = 1e-6
    size = p.trust + p.weight.sum() / p.deviation**2
    for j in range(3):
        step = h * np.eye(3)[j]
        assert abs(cost(p, y + step, x) - cost(p, y - step, x)) / (2 * h) < 1e-6 * size
    for i, polygon in enumerate(polygons):
        for j in range(2 if polygon is not None else 0):
            step = np.zeros_like(x)
            step[i, j] = h
            assert abs(cost(p, y, x + step) - cost(p, y, x - step)) / (2 * h) < 1e-6 / p.spread[i] ** 2
        if polygon is None:
            assert_allclose(x[i], 0.0, atol=0.0)  # a point stays where it is


@pytest.mark.parametrize("seed", range(6))
def test_at_a_soles_edge_it_is_the_constrained_minimum(seed):
    rng = np.random.default_rng(100 + seed)
    polygons = [SOLE, HEXAGON]
    contacts = tuple(contact(str(i), c) for i, c in enumerate(polygons))
    p = problem_of(rng, polygons, spread=0.005, reach=0.02, beyond=0.15)
    y, x, limited = solved(p, contacts)
    assert any(limited)
    for mine, other in zip((y, x), solved(p, contacts, at_edge=True), strict=False):
        assert_allclose(mine, other, rtol=0, atol=0)  # the program at once
    rows = [half_planes("sole", c) for c in polygons]
    for (N, d), place in zip(rows, x, strict=True):
        assert (N @ place <= d + 1e-7).all()
    limits = [
        {"type": "ineq", "fun": lambda z, i=i, N=N, d=d: d - N @ z[3 + 2 * i : 5 + 2 * i]}
        for i, (N, d) in enumerate(rows)
    ]
    scale = 1.0 / p.trust
    best = minimize(
        lambda z: scale * cost(p, z[:3], z[3:].reshape(2, 2)),
        np.zeros(7),
        constraints=limits,
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 500},
    )
    assert scale * cost(p, y, x) <= best.fun + 1e-9
    assert_allclose(y, best.x[:3], atol=2e-5)  # what SLSQP reaches


def test_a_contact_without_weight_says_nothing():
    rng = np.random.default_rng(5)
    p = problem_of(rng, [SOLE, SOLE], off=(1,))
    contacts = (contact("a", SOLE), contact("b", SOLE))
    y, x, _ = solved(p, contacts)
    alone = VelocityProblem(
        p.reference, p.trust, p.matrix[:1], p.still[:1], p.pressure[:1], p.spread[:1], p.weight[:1], p.deviation
    )
    y_alone, x_alone, _ = solved(alone, contacts[:1])
    assert_allclose(y, y_alone, rtol=1e-12)
    assert_allclose(x[0], x_alone[0], rtol=1e-12)
    assert_allclose(x[1], p.pressure[1], rtol=0.0)


def test_signs_on_a_rigid_foot_that_turns_about_its_centre_of_pressure():
    """A foot turns about a point x of its sole: the base, carried by it, moves as the rigid body does."""
    rng = np.random.default_rng(2)
    x = np.array([0.07, -0.03])
    R, p = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
    R = R * np.linalg.det(R)
    omega_b, omega_foot = rng.normal(size=3), rng.normal(size=3)  # of base and foot, in the base's axes
    arm = p + R @ np.array([*x, 0.0])  # from the base to the point at rest
    v_rel = rng.normal(size=3)  # of C against the base, as the joints give it
    foot_rel = omega_foot - omega_b
    # the point's velocity in the world: base + omega_b x arm + joints' share; it is zero
    base = -(np.cross(omega_b, arm) + v_rel + np.cross(foot_rel, R @ np.array([*x, 0.0])))
    C = np.column_stack([np.cross(omega_foot, R[:, 0]), np.cross(omega_foot, R[:, 1])])
    still = v_rel + np.cross(omega_b, p) + C @ x
    problem = VelocityProblem(np.zeros(3), 1e-9, C[None], still[None], x[None], np.array([1e-4]), np.ones(1), 0.02)
    y, found, _ = solved(problem, (contact("foot", SOLE),))
    assert_allclose(y, base, atol=1e-9)
    assert_allclose(found[0], x, atol=1e-9)


def test_points_outside_a_sole_are_drawn_in():
    contacts = (contact("a", SOLE), contact("hand", None))
    points = np.array([[0.3, 0.02], [0.2, 0.0]])
    for point, row in zip(points, rows_of(contacts), strict=True):
        into_sole(point, row)
    assert_allclose(points, [[0.1, 0.02 / 3.0], [0.2, 0.0]], atol=1e-12)  # a point has no edge


@pytest.mark.parametrize(
    ("polygon", "message"),
    [
        (((0, 0), (1, 0)), "at least three corners"),
        (((0, 0), (1, 0), (2, 0)), "some area"),
        (((0, 0), (1, 0), (0.1, 0.1), (0, 1)), "convex"),
    ],
)
def test_impossible_soles_are_refused(polygon, message):
    with pytest.raises(ParamsError, match=message):
        contact("foot", polygon)


def test_half_planes_hold_inside_whichever_way_round():
    for corners in (SOLE, SOLE[::-1]):
        N, d = half_planes("sole", corners)
        assert (N @ np.array([0.099, 0.049]) < d).all()
        assert (N @ np.array([0.101, 0.0]) > d).any()
