"""The full program in Drake and the reduced one: named bindings, the same matrices, one solution."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.solvers import ClarabelSolver, SolverOptions

from drake_tc.errors import ParamsError
from drake_tc.tsid.assembly import reduce
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import AccelerationLimit, TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.program_solver import build_full
from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.tasks import ComTask, ForceTask, FrameTask, PostureTask

from .machines import arm, machine, random_state
from .problems import SOLES, Setup, model, robot, state
from .program_matrices import full_qp, read_qp, reduced_qp

NAMES = ("com", "posture", "force", "r_hand", "torque limits", "contact cones", "acceleration limits")


def rows_at(seed, mask=None):
    """Regularised tasks, so that there is one solution, with limits that are met on their border."""
    it, rng = model(), np.random.default_rng(seed)
    q, v = state(rng, Setup(speed=0.3))
    terms = it.terms(it.create_scratch(), q, v, mask)
    hand = terms.frame("r_hand")
    pose = np.concatenate([[1, 0, 0, 0], hand.position + rng.normal(size=3) * 0.1, np.zeros(12)])
    tasks = [
        ComTask(100, 20).rows(terms, np.concatenate([terms.com + rng.normal(size=3) * 0.03, np.zeros(6)])),
        PostureTask(it, 10, 5, weight=0.3).rows(terms, np.concatenate([robot().posture, np.zeros(60)])),
        ForceTask(it, weight=0.01).rows(terms, np.zeros(it.force_size)),
        FrameTask(it, "r_hand", 50, 10, weight=0.5).rows(terms, pose),
    ]
    limits = [
        TorqueLimit.of(robot(), 0.3).rows(terms),
        WrenchCones(SOLES).rows(terms),
        AccelerationLimit.of(it, period=5e-3).rows(terms),
    ]
    return terms, tasks, limits


def descriptions(program):
    return [binding.evaluator().get_description() for binding in (*program.GetAllCosts(), *program.GetAllConstraints())]


def test_every_binding_has_a_name():
    problem = rows_at(0)
    assert sorted(descriptions(build_full(*problem))) == sorted([*NAMES, "dynamics", "contacts"])


@pytest.mark.parametrize("mask", [None, (True, False), (False, False)])
def test_the_fast_path_has_the_matrices_of_the_program(mask):
    terms, tasks, limits = rows_at(1, mask)
    asked = np.random.default_rng(2).normal(size=terms.contact_bias.size)
    matrices, read = full_qp(terms, tasks, limits, asked), read_qp(build_full(terms, tasks, limits, asked))
    assert read.bounds == matrices.bounds == 0
    for name in ("hessian", "gradient", "matrix"):
        mine, drakes = getattr(matrices, name), getattr(read, name)
        assert_allclose(mine, drakes, rtol=1e-12, atol=1e-12 * np.abs(drakes).max(initial=0.0))
    for name in ("lower", "upper"):
        mine, drakes = getattr(matrices, name), getattr(read, name)
        assert_array_equal(np.isinf(mine), np.isinf(drakes))
        finite = np.isfinite(mine)
        assert_allclose(mine[finite], drakes[finite], rtol=1e-12, atol=1e-10)


def test_full_and_reduced_have_one_solution():
    """Over many states, limits met on their border: the reduced torques by one solver, all of y by another."""
    active = 0
    for seed in range(60):
        terms, tasks, limits = rows_at(seed, (True, seed % 3 > 0))
        reduced = reduce(terms, tasks, limits)
        torque = solver("quadprog").solve(reduced_qp(reduced))
        both = solver("daqp").solve(full_qp(terms, tasks, limits))
        if torque.outcome is Outcome.INFEASIBLE:
            assert both.outcome is Outcome.INFEASIBLE
            continue
        assert torque.outcome is both.outcome is Outcome.SOLVED
        y = np.concatenate([*reduced.full(torque.x), torque.x])
        assert_allclose(both.x, y, rtol=1e-8, atol=1e-8 * np.abs(y).max())
        active += np.count_nonzero(np.abs(torque.multipliers) > 1e-6)
    assert active > 60


def test_drakes_own_solver_agrees():
    clarabel, options = ClarabelSolver(), SolverOptions()
    for key in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(clarabel.id(), key, 1e-12)
    for seed in range(3):
        terms, tasks, limits = rows_at(seed)
        reduced = reduce(terms, tasks, limits)
        torque = solver("quadprog").solve(reduced_qp(reduced)).x
        y = np.concatenate([*reduced.full(torque), torque])
        program = build_full(terms, tasks, limits)
        found = clarabel.Solve(program, None, options).GetSolution(program.decision_variables())
        assert_allclose(found, y, rtol=0, atol=1e-6 * np.abs(y).max())  # an interior point


def test_two_of_one_name_are_refused():
    terms, tasks, limits = rows_at(0)
    with pytest.raises(ParamsError, match="expected different names; 'com' comes twice"):
        build_full(terms, [*tasks, tasks[0]], limits)
    with pytest.raises(ParamsError, match="expected different names; 'contact cones' comes twice"):
        build_full(terms, tasks, [*limits, limits[1]])


@pytest.mark.parametrize("name", ["arm", "arm held by its slider", "floating arm"])
def test_robots_without_active_contacts(tmp_path, name):
    """Posture on a welded arm is computed torque: tau = M a + h; in free flight it is so as far as momentum allows."""
    it = machine(name, tmp_path)
    terms = it.terms(it.create_scratch(), *random_state(it, 3), (False, False))
    reference = np.random.default_rng(0).normal(size=9)
    tasks = [PostureTask(it, 30, 5).rows(terms, reference)]
    cost = reduce(terms, tasks, []).cost
    torque = np.linalg.lstsq(cost.matrix, cost.target)[0]
    q, v, a = terms.joint_position, terms.v[it.actuated], reference[6:]
    wanted = a + 30 * (reference[:3] - q) + 5 * (reference[3:6] - v)
    vdot, _ = reduce(terms, tasks, []).full(torque)
    assert_allclose(vdot[it.actuated], wanted, rtol=1e-8, atol=1e-8)
    push = terms.mass_matrix @ vdot + terms.bias
    assert_allclose(push[it.actuated], torque, rtol=1e-8, atol=1e-8)
    both = solver("daqp").solve(full_qp(terms, tasks, []))
    assert_allclose(both.x[-3:], torque, rtol=1e-7, atol=1e-7)


def test_hands_and_feet_carry_together():
    """Two soles and two hands that hold on: weight and contacts change the momentum as the accelerations say."""
    hands = [
        Contact(f"{side}_grip", replace(robot().force_torque[i].contact, name=f"{side}_grip"), "point")
        for side, i in (("right", 2), ("left", 3))
    ]
    it, rng = TsidModel(robot(), [*SOLES, *hands]), np.random.default_rng(0)
    for seed in range(5):
        terms = it.terms(it.create_scratch(), *random_state(it, seed))
        tasks = [
            PostureTask(it, 1, 1).rows(terms, rng.normal(size=90)),
            ForceTask(it, weight=1e-2).rows(terms, np.zeros(it.force_size)),
        ]
        reduced = reduce(terms, tasks, [])
        vdot, force = reduced.full(np.linalg.lstsq(reduced.cost.matrix, reduced.cost.target)[0])
        wrench = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.81 * terms.mass])
        for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
            turn, place = terms.pose(contact.name)
            push = force[rows][:3] if contact.upright else turn @ force[rows][:3]
            wrench[3:] += push
            wrench[:3] += np.cross(place - terms.com, push)
            if contact.size == 6:
                wrench[:3] += turn @ force[rows][3:]
        assert np.linalg.norm(force[12:]) > 1.0
        rate = terms.momentum_matrix @ vdot + terms.momentum_bias
        assert_allclose(rate, wrench, atol=1e-9 * np.abs(force).max())
        held = terms.contact_jacobian @ vdot + terms.contact_bias
        assert_allclose(held, np.zeros(18), atol=1e-9 * np.abs(terms.contact_bias).max())


def test_a_robot_without_limits_or_tasks(tmp_path):
    it = TsidModel(arm(tmp_path))
    terms = it.terms(it.create_scratch(), *random_state(it, 1))
    read = read_qp(build_full(terms, [], []))
    assert read.matrix.shape == (3, 6)
