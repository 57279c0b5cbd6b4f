"""Which limits conflict, by how much, and torques that are safe whatever happens."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.tsid.assembly import causes_of
from drake_tc.tsid.fallbacks import diagnose, safe_torque
from drake_tc.tsid.qp import Outcome, QuadraticProgram, solver
from drake_tc.tsid.rows import Polytope

from .machines import machine, random_state
from .problems import Setup, model, problems, state
from .program_matrices import reduced_qp
from .quadratic import crude, has_a_point


def random_polytope(rng: np.random.Generator, n: int = 8, m: int = 20) -> tuple[Polytope, np.ndarray]:
    """Bounds and rows around a point with room on every side."""
    matrix = np.concatenate((np.eye(n), rng.normal(size=(m, n)) * 10 ** rng.uniform(-2, 2, (m, 1))))
    inside = rng.normal(size=n)
    length = np.linalg.norm(matrix, axis=1)
    lower = matrix @ inside - length * rng.uniform(0.5, 2, n + m)
    upper = matrix @ inside + length * rng.uniform(0.5, 2, n + m)
    labels = tuple(f"row {i}" for i in range(n + m))
    return Polytope(matrix, lower, upper, {}, labels, n), inside


def with_rows(polytope: Polytope, matrix, lower, upper, labels) -> Polytope:
    return replace(
        polytope,
        matrix=np.concatenate((polytope.matrix, matrix)),
        lower=np.concatenate((polytope.lower, lower)),
        upper=np.concatenate((polytope.upper, upper)),
        labels=(*polytope.labels, *labels),
    )


def is_feasible(polytope: Polytope) -> bool:
    n = polytope.matrix.shape[1]
    sides = polytope.lower, polytope.upper
    return has_a_point(QuadraticProgram(np.eye(n), np.zeros(n), polytope.matrix, *sides))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 19), st.floats(1e-3, 0.05), st.floats(1e-2, 1e2))
def test_a_bound_moved_against_another_row_names_these_two_and_the_gap(seed, which, gap, factor):
    rng = np.random.default_rng(seed)
    polytope, inside = random_polytope(rng)
    row = polytope.bounds + which
    length = np.linalg.norm(polytope.matrix[row])
    here = polytope.matrix[row] @ inside
    upper = polytope.upper.copy()
    upper[row] = here  # moved in: this alone still leaves room
    moved = replace(polytope, upper=upper)
    assert not diagnose(moved).labels
    contrary = factor * polytope.matrix[row : row + 1]
    both = with_rows(moved, contrary, [factor * (here + gap * length)], [np.inf], ["contrary"])
    found = diagnose(both)
    assert found.outcome is Outcome.SOLVED
    assert set(found.labels) == {f"row {row}", "contrary"}
    missed = dict(zip(found.labels, found.missed, strict=True))
    assert_allclose(missed[f"row {row}"] + missed["contrary"] / factor, gap * length, rtol=1e-6)
    sides = dict(zip(found.labels, found.upper, strict=True))
    assert sides[f"row {row}"] and not sides["contrary"]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5))
def test_the_named_rows_alone_conflict_and_without_any_one_of_them_nothing_does(seed, size):
    """A chain of rows that add up to a contradiction: nothing less, and nothing else, is infeasible."""
    rng = np.random.default_rng(seed)
    polytope, inside = random_polytope(rng)
    chain = rng.normal(size=(size, polytope.matrix.shape[1]))
    here = chain @ inside
    total = -chain.sum(axis=0)
    both = with_rows(
        polytope,
        np.concatenate((chain, total[None])),
        np.full(size + 1, -np.inf),
        np.concatenate((here, [total @ inside - 0.02])),
        [f"link {i}" for i in range(size + 1)],
    )
    found = diagnose(both)
    assert set(found.labels) == {f"link {i}" for i in range(size + 1)}
    for row in found.rows:
        upper = both.upper.copy()
        upper[row] = np.inf
        assert is_feasible(replace(both, upper=upper))
    others = np.ones(both.lower.size, dtype=bool)
    others[: both.bounds] = False
    others[found.rows] = False
    alone = Polytope(both.matrix[~others], both.lower[~others], both.upper[~others])
    assert not is_feasible(alone)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_whether_there_is_a_conflict_is_what_linear_programming_says(seed):
    problem = crude(seed)
    polytope = Polytope(problem.matrix, problem.lower, problem.upper, {}, (), problem.bounds)
    found, k = diagnose(polytope), problem.bounds
    assert bool(found.labels) != has_a_point(problem)
    crossed = problem.lower[:k] > problem.upper[:k]
    kept = (found.torque[:k] >= problem.lower[:k] - 1e-7) & (found.torque[:k] <= problem.upper[:k] + 1e-7)
    assert (kept | crossed).all()
    if found.labels:
        named = (problem.matrix[found.rows], problem.lower[found.rows], problem.upper[found.rows])
        assert not has_a_point(QuadraticProgram(problem.hessian, problem.gradient, *named))
    else:
        assert polytope.violation(found.torque) <= 1e-5


def test_the_slack_is_least():
    """Two rows 2 apart, one of them ten times as sensitive to torque: shares by the square of it."""
    polytope = Polytope(
        np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [10.0, 0.0]]),
        np.array([-100.0, -100.0, 3.0, -np.inf]),
        np.array([100.0, 100.0, np.inf, 10.0]),
        {},
        ("a", "b", "least", "most"),
        2,
    )
    found = diagnose(polytope)
    assert_allclose(found.torque, [2.0, 0.0], atol=1e-6)
    assert dict(zip(found.labels, found.missed.round(6).tolist(), strict=True)) == {"least": 1.0, "most": 10.0}
    assert str(found) == "limits conflict: least (below by 1), most (above by 10)"


def test_a_torque_limit_is_kept_and_named():
    polytope = Polytope(
        np.array([[1.0, 0.0], [0.0, 1.0], [2.0, 0.0]]),
        np.array([-5.0, -5.0, 13.0]),
        np.array([5.0, 5.0, np.inf]),
        {},
        ("knee torque", "hip torque", "knee acceleration"),
        2,
    )
    found = diagnose(polytope, centre=np.array([0.0, 1.5]))
    assert found.labels == ("knee acceleration", "knee torque")
    assert_allclose(found.missed, [3.0, 0.0], atol=1e-6)
    assert_allclose(found.torque, [5.0, 1.5], atol=1e-6)
    assert found.upper.tolist() == [False, True]


def test_sides_that_cross_on_one_row():
    matrix = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    polytope = Polytope(matrix, np.array([-5.0, -5.0, 2.0]), np.array([5.0, 5.0, 1.0]), bounds=2)
    found = diagnose(polytope)
    assert found.labels == ("row 2",)
    assert_allclose(found.missed, [0.5], atol=1e-6)


def test_of_a_real_problem_the_named_limits_are_those_that_were_set_against_each_other():
    for problem in problems(4, 3):
        polytope = problem.polytope
        at = solver().solve(reduced_qp(problem.reduced)).x
        row = polytope.labels.index("left_sole normal force")
        force = polytope.matrix[row] @ at
        upper = polytope.upper.copy()
        upper[row] = force - 1.0
        crossing = replace(polytope, upper=upper)
        both = with_rows(crossing, polytope.matrix[row : row + 1], [force + 1.0], [np.inf], ["wanted push"])
        found = diagnose(both)
        assert set(found.labels) == {"left_sole normal force", "wanted push"}
        assert_allclose(found.missed, 1.0, rtol=1e-5)
        program = replace(reduced_qp(problem.reduced), matrix=both.matrix, lower=both.lower, upper=both.upper)
        assert solver().solve(program).outcome is Outcome.INFEASIBLE


def test_a_robot_that_is_too_weak_to_stand():
    problem = next(iter(problems(1, 0, Setup(torque_share=0.05))))
    polytope, lower = problem.polytope, problem.polytope.lower.copy()
    lower[polytope.labels.index("left_sole normal force")] = 250.0
    lower[polytope.labels.index("right_sole normal force")] = 250.0
    found = diagnose(replace(polytope, lower=lower))
    pressed = np.array([label.endswith(" torque") for label in found.labels])
    assert pressed.any() and {"left_sole normal force", "right_sole normal force"} & set(found.labels)
    assert "r_knee torque" in found.labels and "l_knee torque" in found.labels
    assert (found.missed[pressed] == 0.0).all() and (found.missed[~pressed] > 0.0).all()
    assert (np.abs(found.torque) <= polytope.upper[:30] + 1e-6).all()


@pytest.mark.parametrize("field", ["matrix", "lower", "upper"])
def test_numbers_that_are_none_are_told_and_raise_nothing(field):
    polytope, _ = random_polytope(np.random.default_rng(0))
    spoilt = getattr(polytope, field).copy()
    spoilt.flat[spoilt.size // 2] = np.nan
    found = diagnose(replace(polytope, **{field: spoilt}))
    assert found.outcome is Outcome.FAILED and found.rows.size == 0 and np.isnan(found.torque).all()
    assert "not numbers" in str(found)


@pytest.mark.parametrize("name", ["humanoid", "shuffled humanoid", "leg", "arm", "floating arm"])
def test_the_safe_torque_holds_the_robot_still_where_its_contacts_can(name, tmp_path):
    it = machine(name, tmp_path)
    q, _ = random_state(it, 0)
    for active in ((True, False), (True, True)):
        terms = it.terms(it.create_scratch(), q, np.zeros(it.nv), active)
        torque = safe_torque(terms, 3.0)
        # at rest in contact: the accelerations that the torque causes, the contact forces being what they are, vanish
        causes = causes_of(terms)
        assert_allclose(causes.vdot @ torque + causes.vdot_offset, 0.0, atol=1e-6)


def test_in_flight_the_safe_torque_leaves_the_joints_where_they_are():
    it = model()
    q, _ = state(np.random.default_rng(1), Setup(lean=0.3))
    terms = it.terms(it.create_scratch(), q, np.zeros(it.nv), (False, False))
    causes = causes_of(terms)
    vdot = causes.vdot @ safe_torque(terms) + causes.vdot_offset
    assert_allclose(vdot[it.actuated], 0.0, atol=1e-7)
    assert_allclose(vdot[3:6], [0.0, 0.0, -9.81], atol=1e-7)


def test_the_safe_torque_damps_and_is_clipped():
    it = model()
    q, v = state(np.random.default_rng(1), Setup(speed=0.5))
    terms = it.terms(it.create_scratch(), q, v)
    stiff, loose = safe_torque(terms, np.full(30, 4.0)), safe_torque(terms)
    assert_allclose(stiff - loose, -4.0 * v[it.actuated], atol=1e-10)
    limit = np.full(30, 2.0)
    clipped = safe_torque(terms, 0.0, -limit, limit)
    assert_allclose(clipped, np.clip(loose, -2.0, 2.0))
    assert np.abs(loose).max() > 2.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_the_safe_torque_of_a_state_that_is_none_is_zero(value):
    it = model()
    q, v = it.start.copy(), np.zeros(it.nv)
    q[10] = value
    assert not safe_torque(it.terms(it.create_scratch(), q, v), 1.0).any()
    q, v = it.start.copy(), np.zeros(it.nv)
    v[10] = value
    assert not safe_torque(it.terms(it.create_scratch(), q, v), 1.0).any()
