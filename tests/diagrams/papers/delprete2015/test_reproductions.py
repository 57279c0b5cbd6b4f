"""Reproductions of Del Prete and Mansard (2015): simulation against Drake, closed forms, short runs."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from drake_tc.actuation.model_file import load_models
from drake_tc.analysis.sweep import point_seed, sweep
from drake_tc.diagrams.papers.delprete2015 import closed_loop as tsid_closed_loop
from drake_tc.diagrams.papers.delprete2015 import com_move as tsid_com_move
from drake_tc.diagrams.papers.delprete2015 import masses as tsid_masses
from drake_tc.diagrams.papers.delprete2015 import reach as tsid_reach
from drake_tc.diagrams.papers.delprete2015 import setup as tsid_setup
from drake_tc.diagrams.papers.delprete2015.choice import candidates, coverage, goals
from drake_tc.diagrams.papers.delprete2015.com_move import Sway
from drake_tc.diagrams.papers.delprete2015.setup import (
    BOX,
    CLASSIC,
    INDIVIDUAL,
    PLAIN,
    RECTANGLE,
    SOLES,
    W_COM,
    W_REACH,
    make_model,
    model,
    robot,
    standing_limits,
    torque_error,
)
from drake_tc.diagrams.papers.delprete2015.simulation import DT, follow, solve_again
from drake_tc.diagrams.papers.delprete2015.torque_safety import miss, torque_safety, wilson
from drake_tc.diagrams.papers.expected_values import expectations, on_record
from drake_tc.report.figure_row import reproduced_row
from drake_tc.robot.plant import make_plant
from drake_tc.tsid.assembly import reduce


@pytest.fixture(scope="module")
def sway():
    """Every 40th state of the classic motion of tests 1 and 2."""
    return list(Sway().classic())[::40]


def mean_p(moments):
    return float(torque_safety(moments, torque_error(), 0, groups=False).p.mean())


# --- the set-up is the paper's


def test_the_problem_has_the_papers_inequalities():
    """22 for the feet, 60 for torques, 60 for accelerations (section VII), the numbers those of Table I."""
    it = model()
    terms = it.terms(it.create_scratch(), it.start, np.zeros(it.nv))
    polytope = reduce(terms, [], [limit.rows(terms) for limit in standing_limits()]).polytope
    sides = {
        name: int(np.isfinite(polytope.lower[rows]).sum() + np.isfinite(polytope.upper[rows]).sum())
        for name, rows in polytope.groups.items()
    }
    assert sides == {"torque": 60, "force": 22, "acceleration": 60}
    assert it.n == 30
    assert_allclose(torque_error().sigma / polytope.upper[:30], 0.003, rtol=1e-12)


def test_soles_stand_where_the_models_feet_do():
    """Corners of each sole at the lowest points of the URDF's spheres."""
    plant = make_plant(robot(), 0.0)
    it = model()
    terms = it.terms(it.create_scratch(), it.start, np.zeros(it.nv))
    assert plant.num_velocities() == it.nv
    for sole in SOLES:
        rotation, position = terms.pose(sole.name)
        corners = sole.corners @ rotation.T + position
        assert_allclose(corners[:, 2], 0.0, atol=1e-4)
        assert_allclose(np.ptp(corners, axis=0)[:2], [0.21, 0.115], atol=1e-4)


# --- the simulation


def test_the_motion_obeys_the_equations_of_motion_and_the_feet_stay(sway):
    """M vdot + h = S^T tau + J^T f by Drake's inverse dynamics of a plant of its own, at states of the motion."""
    plant = make_plant(dataclasses.replace(robot(), actuators=None, rotor_inertia={}), 0.0)
    context = plant.CreateDefaultContext()
    it = model()
    scratch, rotors = it.create_scratch(), np.zeros(it.nv)
    models = load_models(robot().actuators)
    rotors[it.actuated] = [models[joint].inertia for joint in robot().joints]
    for moment in sway[::6]:
        vdot, force = moment.truth.full(moment.torque)
        plant.SetPositionsAndVelocities(context, np.concatenate([moment.q, moment.v]))
        mass, bias = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
        terms = it.terms(scratch, moment.q, moment.v)
        left = mass @ vdot + rotors * vdot + bias - plant.CalcGravityGeneralizedForces(context)
        left[it.actuated] -= moment.torque
        assert_allclose(left, terms.contact_jacobian.T @ force, atol=1e-7)
        assert np.abs(terms.contact_velocity).max() < 1e-3


def test_the_classic_sway_is_followed_and_its_solution_is_least_cost(sway):
    assert all(moment.solved and moment.task_error(3) < 1e-3 for moment in sway)
    for moment in sway[::6]:
        assert moment.problem.polytope.violation(moment.torque) < 1e-6
        assert miss(moment, torque_error()) < 1e-6


# --- judging


@pytest.mark.parametrize(("hits", "runs"), [(0, 30), (7, 30), (29, 30), (50, 100)])
def test_wilson_interval_solves_its_equation(hits, runs):
    """Both ends p satisfy (hits/n - p)^2 = z^2 p (1 - p) / n, but for the cut at 0 and 1."""
    z = 1.959963984540054
    for end in wilson(hits, runs):
        if 1e-12 < end < 1.0 - 1e-12:
            assert (hits / runs - end) ** 2 == pytest.approx(z * z * end * (1.0 - end) / runs, rel=1e-9)
    low, high = wilson(hits, runs)
    assert low <= hits / runs <= high


def test_wilson_interval_covers():
    """Of binomial draws with n = 30, 95 % have p inside, on average over p."""
    ends = [wilson(hits, 30) for hits in range(31)]
    shares = np.linspace(0.05, 0.95, 181)
    covered = [sum(binom.pmf(k, 30, p) for k in range(31) if ends[k][0] <= p <= ends[k][1]) for p in shares]
    assert 0.94 < np.mean(covered) < 0.96


def test_p_against_plain_sampling(sway):
    """Its p at states with p between, against 20000 draws of the error."""
    error = torque_error()
    found = torque_safety(sway, error, 0)
    draws = error.root @ np.random.default_rng(1).normal(size=(30, 20000))
    some = [i for i in range(len(sway)) if 0.05 < found.p[i] < 0.95][:4]
    assert len(some) == 4
    for i in some:
        polytope = sway[i].truth.polytope
        value = (polytope.matrix @ sway[i].torque)[:, None] + polytope.matrix @ draws
        kept = ((value >= polytope.lower[:, None]) & (value <= polytope.upper[:, None])).all(axis=0).mean()
        assert found.p[i] == pytest.approx(kept, abs=0.015)
        assert found.p[i] <= min(values[i] for values in found.groups.values()) + 1e-3


# --- each claim, at a few states


def test_approximations_of_p_at_a_few_states(sway):
    found = tsid_com_move.approximations(sway[::3], 0)
    assert np.mean(np.abs(found.p - found.individual)) < 0.04
    assert (found.rectangle <= found.high + 1e-9).all()
    assert (found.box <= found.high + 1e-9).all()
    assert found.p.min() < 0.3
    assert found.p.max() > 0.99


def test_robust_torques_are_safer_at_the_same_states(sway):
    scene, some = Sway().scene(), sway[8:26:2]
    p = {way.name: mean_p(solve_again(scene, way, W_COM, torque_error(), some)) for way in (PLAIN, INDIVIDUAL, BOX)}
    rectangle = mean_p(solve_again(scene, RECTANGLE, W_COM, torque_error(), some[:4]))
    assert p["p_ind"] > 1.5 * p["classic, w_f = 0"]
    assert p["p_box"] > 1.5 * p["classic, w_f = 0"]
    assert rectangle > 0.9


def test_the_reach_moves_the_hand_and_keeps_the_capture_point():
    found = tsid_reach.reach(INDIVIDUAL, duration=0.3)
    assert found.evaluated.p.size == round(0.3 / DT)
    assert found.evaluated.p.min() > 0.99
    assert found.beyond < 0.0
    assert set(found.evaluated.groups) == set(tsid_reach.GROUPS)


def test_wrong_masses_are_those_of_the_links():
    """Total mass within 3 %, no link's inertia changed, and a seed makes the same model again."""
    one, same, other = (tsid_masses.corrupted(seed) for seed in (1, 1, 2))
    mass = [
        it.terms(it.create_scratch(), it.start, np.zeros(it.nv)).mass for it in (one, same, other, make_model(robot()))
    ]
    assert mass[0] == mass[1] != mass[2]
    assert 0.0 < abs(mass[0] / mass[3] - 1.0) < 0.03


def test_a_wrong_model_misses_limits_that_the_right_one_keeps():
    classic = tsid_masses.COMPARED[0]
    right = tsid_masses.run(classic, None, duration=0.1)
    wrong = tsid_masses.run(classic, tsid_masses.corrupted(0), duration=0.1)
    assert right.worst < 1e-6
    assert wrong.worst > right.worst
    assert right.missed == right.others == 0.0
    assert wrong.others <= wrong.missed


def _square(point, seed):
    return point * point, seed


def test_points_of_test_5_are_the_sweeps():
    assert sweep(_square, range(3), seed=7)[2] == (4, point_seed(7, 2))


def test_closed_loop_shares_and_intervals_from_known_runs():
    good = tsid_closed_loop.Outcome(0.0, 0.0, 0.0, False)
    bad, fallen = dataclasses.replace(good, force=0.1), dataclasses.replace(good, fell=True)
    found = [(bad, good, good, good)] * 6 + [(good, good, fallen, bad)] * 2
    swept = [(good,) * 4, (bad, good, good, bad), (good, good, bad, good), (bad, bad, bad, bad)]
    swept += [(good,) * 4] * (len(tsid_closed_loop.AMPLITUDES) - 4)  # what is kept beyond a miss does not count
    rows = {row.name: row.value for row in tsid_closed_loop.reproduction(found, swept).rows}
    steps = [rows[f"widest sway kept, {form} minus classic"] for form in ("individual", "rectangle", "box")]
    assert steps == pytest.approx([1.0, 0.5, 0.0])
    assert rows["amplitude of the sway [cm]"] == 100.0 * tsid_closed_loop.AMPLITUDES[1]  # classic misses a limit there
    assert rows["runs that keep every limit, classic"] == 25.0
    assert rows["runs that keep every limit, individual"] == 100.0
    assert rows["runs that keep every limit, rectangle"] == 75.0
    assert (rows["robots kept by individual alone"], rows["robots kept by classic but not by individual"]) == (6, 0)
    assert rows["chance of as many, individual"] == pytest.approx(0.5**6)
    assert (rows["robots kept by box alone"], rows["robots kept by classic but not by box"]) == (6, 2)
    assert rows["chance of as many, box"] == pytest.approx((28 + 8 + 1) / 2**8)  # 6, 7 or 8 of 8
    assert rows["runs that fell, rectangle"] == 2.0


@pytest.mark.parametrize("number", range(1, 6))
def test_no_expectation_is_met_by_nothing(number):
    """A value of NaN meets no row."""
    for wanted in expectations(f"b_test{number}").values():
        assert reproduced_row(wanted.name, math.nan, wanted).met is False


# --- the whole of it


def beside(chosen, all_of_them):
    """Those that differ from the chosen one in one number."""
    fields = dataclasses.astuple(chosen)
    return [x for x in all_of_them if sum(a != b for a, b in zip(dataclasses.astuple(x), fields, strict=True)) == 1]


@pytest.mark.slow
def test_the_sway_was_chosen_by_its_rule():
    """Of the grid's candidates beside the chosen one, none spreads p more evenly."""
    chosen = Sway()
    assert chosen in candidates()
    best = coverage(chosen.classic()).entropy
    assert best > 0.0
    assert all(coverage(other.classic()).entropy <= best for other in beside(chosen, candidates()))


def coverage_of_goal(goal):
    return coverage(follow(tsid_reach.reach_scene(goal=goal), CLASSIC, W_REACH, torque_error(), goal.duration))


@pytest.mark.slow
def test_the_reach_was_chosen_by_its_rule():
    chosen = tsid_reach.GOAL
    assert chosen in goals()
    best = coverage_of_goal(chosen).entropy
    assert best > 0.0
    assert all(coverage_of_goal(other).entropy <= best for other in beside(chosen, goals()))


@pytest.mark.slow
@pytest.mark.parametrize("share", tsid_reach.SHARES)
def test_where_rounding_decides_the_reach_with_large_boxes_stays_within_its_tolerance(share):
    """At w = 1 p_box has states without solution; goals that differ by 1e-12 m then lead to different motions."""
    record = on_record("b_test4")[f"p, sigma {share:g}, p_box"]
    shares = []
    for k in range(-5, 5):
        goal = tsid_reach.Goal(offset=(0.75 + k * 1e-12, 0.0, 0.1))
        scene = tsid_reach.reach_scene(goal=goal)
        moments = follow(scene, BOX, W_REACH, torque_error(share), goal.duration)
        shares.append(100.0 * float(torque_safety(moments, torque_error(), 0, every=tsid_reach.EVERY).p.mean()))
    assert max(shares) - min(shares) > 1.0
    assert_allclose(shares, record.reached, rtol=0.0, atol=record.reached_tolerance)


@pytest.mark.slow
def test_the_reach_with_a_third_of_sigma_needs_exact_ticks(monkeypatch: pytest.MonkeyPatch):
    """p_ind: 1e-10 and 1e-12 agree, the library's 1e-6 leaves the posture open, which changes p by ten points."""
    kept = {}
    for accuracy in (1e-6, 1e-10, 1e-12):
        monkeypatch.setattr(tsid_setup, "ACCURACY", accuracy)
        moments = follow(tsid_reach.reach_scene(), INDIVIDUAL, W_REACH, torque_error(0.001), tsid_reach.GOAL.duration)
        kept[accuracy] = 100.0 * float(torque_safety(moments, torque_error(), 0, every=tsid_reach.EVERY).p.mean())
    assert abs(kept[1e-10] - kept[1e-12]) < 0.3
    assert kept[1e-10] - kept[1e-6] > 5.0
