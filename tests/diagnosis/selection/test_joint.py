"""The search: finds what was planted, takes nothing for something, and prefers the simple."""

from dataclasses import replace

import numpy as np
import pytest
from mailed import Mailed

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection import shape_refinement
from drake_tc.diagnosis.selection.engine import select
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import JointProblem, best_shape, candidates
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.selection.shapes import ShapeScreen
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.base import Context
from drake_tc.effects.library import LIBRARY, effect
from drake_tc.effects.obstacle import Obstacle
from drake_tc.filtering.common_kernel import BlockConvolution

from ..rigs import Joint, Problem, floor_of, problem

NOISY = Joint(torque_noise=0.25)
PLANTED = {
    "stribeck": lambda m: 2.0 * np.exp(-((m.v / 0.2) ** 2)) * np.sign(m.v),
    "torque_ripple": lambda m: 0.9 * np.cos(9.0 * m.q + 0.4),
    "quadratic_viscous": lambda m: 1.2 * m.v * np.abs(m.v),
    "load_dependent_friction": lambda m: 0.15 * np.abs(m.tau) * np.sign(m.v),
}
FEW = ("rotor_inertia", "quadratic_viscous", "torque_sensor_bias", "load_dependent_friction", "torque_sensor_drift")
FEW = (*FEW, "asymmetric_friction", "stribeck", "torque_ripple", "cable_spring", "velocity_sign_switch", "deadzone")


def look(p: Problem, names: tuple[str, ...] = FEW):
    effects = [e for e in LIBRARY if e.id in names and not e.unavailable(p.context)]
    return search(p.columns, p.declared, effects, p.context, floor_of(p), JOINT)


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_effect_is_found_and_no_other(name):
    found = look(problem(replace(NOISY, extra=PLANTED[name]), runs=2))
    added = [t.effect.id for t in found.chosen.terms[2:]]
    assert added == [name]
    assert len(found.steps) == 1
    assert found.chosen.cv_rms < 0.6 * found.baseline.cv_rms


def test_two_planted_effects_are_both_found():
    both = replace(NOISY, extra=lambda m: PLANTED["torque_ripple"](m) + PLANTED["quadratic_viscous"](m))
    found = look(problem(both, runs=2))
    assert {t.effect.id for t in found.chosen.terms[2:]} == {"torque_ripple", "quadratic_viscous"}


@pytest.mark.parametrize("seed", range(1))
def test_nothing_missing_stays_nothing(seed):
    assert look(problem(NOISY, seed=seed, runs=2)).steps == ()


@pytest.mark.parametrize("seed", range(2))
def test_a_wandering_torque_sensor_is_no_drift_bias_or_asymmetry(seed):
    def wander(m):
        steps = np.random.default_rng([seed, m.q.size, int(1e6 * abs(m.q[0]))]).standard_normal(m.q.size)
        return 0.4 * np.cumsum(steps) / np.sqrt(m.q.size)

    found = look(problem(replace(NOISY, sensor=wander), seed=seed, runs=3))
    named = {t.effect.id for t in found.chosen.terms[2:]}
    assert not named & {"torque_sensor_drift", "torque_sensor_bias", "asymmetric_friction", "cable_spring"}


@pytest.mark.parametrize("names", [(), ("quadratic_viscous",)])
def test_candidates_may_run_out(names):
    found = look(problem(replace(NOISY, extra=PLANTED["quadratic_viscous"])), names)
    assert tuple(t.effect.id for t in found.chosen.terms[2:]) == names


def test_refining_moves_a_shape_to_the_truth():
    p = problem(replace(NOISY, extra=PLANTED["stribeck"]), runs=2)
    start = Term(effect("stribeck"), {"stribeck_velocity": 0.35, "stribeck_exponent": 1.5})
    before = fit(p.columns, [*p.declared, start])
    after = refine(p.columns, before)
    assert after.cv_rms < before.cv_rms
    # 12 ms at 10 rad/s^2 smear the velocity by half of v_s: 15 %
    np.testing.assert_allclose(after.terms[2].shape["stribeck_velocity"], 0.2, rtol=0.15)
    assert refine(p.columns, p.baseline) is p.baseline


def test_the_grid_holds_the_neighbourhood_of_the_truth():
    p = problem(replace(NOISY, extra=PLANTED["torque_ripple"]))
    member = effect("torque_ripple")
    grid = member.shape_grid(p.context)
    kept = ShapeScreen(p.samples.signals.take(p.samples.rows)).best(member, p.baseline.residual, grid, keep=4)
    assert len(kept) == 4 < len(grid)
    assert min(abs(s["cycles_per_turn"] - 9.0) for s in kept) < 1.0
    best = best_shape(p.columns, p.baseline, member, p.context)
    assert abs(best.terms[-1].shape["cycles_per_turn"] - 9.0) < 1.0


def test_candidates_say_why_they_cannot_be_looked_for():
    context = Context("current", "pendulum", frozenset())
    usable, obstacles = candidates(LIBRARY, context, ["viscous", "coulomb"])
    why = dict(obstacles)
    assert why["thermal_friction"] == Obstacle("not_recorded", "temperature not recorded")
    assert why["torque_sensor_bias"] == Obstacle("cannot_be_looked_for", "there is no torque sensor")
    assert not {"viscous", "coulomb"} & {e.id for e in usable}
    assert {e.key for e in usable} | set(why) | {"viscous", "coulomb"} == {e.key for e in LIBRARY}


def test_a_motion_of_a_hundredth_of_a_radian_leaves_effects_without_shapes_out():
    p = problem(Joint(duration=8.0))
    still = replace(p.context, position_span=(0.0, 1e-3))
    usable, obstacles = candidates(LIBRARY, still, [])
    assert all(member.shape_grid(still) for member in usable)
    assert "position_dependent_friction" in dict(obstacles)


def test_workers_refine_to_the_same_model():
    p = problem(replace(NOISY, extra=PLANTED["stribeck"]), runs=2)
    effects = [e for e in LIBRARY if e.id in FEW and not e.unavailable(p.context)]
    workers = Mailed()
    alone, beside = (
        search(p.columns, p.declared, effects, p.context, floor_of(p), JOINT, executor=executor)
        for executor in (None, workers)
    )
    assert set(workers.sent) == {"refined_shapes"}
    assert [t.shape for t in beside.chosen.terms] == [t.shape for t in alone.chosen.terms]
    np.testing.assert_array_equal(beside.chosen.beta, alone.chosen.beta)
    assert [f.cv_rms for f in beside.alternatives] == [f.cv_rms for f in alone.alternatives]


def test_an_evaluation_filters_only_the_column_whose_shape_has_changed(monkeypatch):
    p = problem(replace(NOISY, extra=PLANTED["stribeck"]), runs=2)
    shape = {"stribeck_velocity": 0.1, "stribeck_exponent": 1.0}
    start = fit(p.columns, [*p.declared, Term(effect("torque_sensor_bias")), Term(effect("stribeck"), shape)])
    counts = dict.fromkeys(("reduce", "score"), 0)

    def counted(name, call):
        def wrapped(*args, **kwargs):
            counts[name] += 1
            return call(*args, **kwargs)

        return wrapped

    monkeypatch.setattr(shape_refinement, "score", counted("score", shape_refinement.score))
    monkeypatch.setattr(BlockConvolution, "at", counted("reduce", BlockConvolution.at))
    assert refine(p.columns, start).cv_rms < start.cv_rms
    assert 10 < counts["score"] <= 120, "60 evaluations for each of two shape parameters"
    assert counts["reduce"] <= counts["score"]


def test_a_second_search_of_the_same_rows_refines_nothing_again(monkeypatch):
    p = problem(replace(NOISY, extra=PLANTED["torque_ripple"]), runs=2)
    effects = [e for e in LIBRARY if e.id in FEW and not e.unavailable(p.context)]
    known = frozenset(t.effect.key for t in p.declared)
    first = JointProblem(p.columns, effects, p.context, known, floor_of(p))
    start = fit(p.columns, p.declared)
    once = select(first, start, JOINT)
    refined = []
    monkeypatch.setattr(shape_refinement, "refined_shapes", lambda *args: refined.append(args))
    again = select(replace(first, effects=effects[:]), start, JOINT)
    np.testing.assert_array_equal(again.chosen.beta, once.chosen.beta)
    assert again.chosen.terms == once.chosen.terms and not refined
