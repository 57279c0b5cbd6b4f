"""Ticks that go on without a solution give way to damping: its equation, its power, and what it does in a tick."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import drake_tc.models
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.fallbacks import GIVE_WAY, REGAIN, START, damped_torque, falling_share, standing_contacts
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.tick import TickInput, solve_tick

CONTROLLER = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
BOTH = (True, True)


@pytest.fixture(scope="module")
def law():
    return load_law(CONTROLLER)


def state_of(law, joints=0.0, base=()):
    """Starting posture; joints turn with random speeds of a deviation `joints`, the base with `base`."""
    model, v = law.model, np.zeros(law.model.nv)
    v[model.actuated] = np.random.default_rng(4).normal(0.0, joints, model.n) if joints else 0.0
    for place, value in dict(base).items():
        v[place] = value
    return np.concatenate((model.start, v))


def ticks(law, state, number, before=None):
    rests = [task.rest(law.starting_terms()) for task in law.tasks]
    scratch, found = law.model.create_scratch(), []
    before = PreviousTick(np.zeros(law.model.n), None) if before is None else before
    for _ in range(number):
        found.append(solve_tick(law, scratch, TickInput(state, rests, BOTH), before))
        before = found[-1].previous
    return found


def test_the_share_rises_and_falls_in_its_times():
    share, steps = 0.0, 0
    while share < 1.0:
        share, steps = falling_share(share, 1e-3, unsolved=True), steps + 1
    assert steps == round(GIVE_WAY / 1e-3)
    while share > 0.0:
        share, steps = falling_share(share, 1e-3, unsolved=False), steps + 1
    assert abs(steps - round((GIVE_WAY + REGAIN) / 1e-3)) <= 1


@pytest.mark.parametrize("damping", [5.0, 1e3])
def test_damping_takes_energy_within_a_tick_whatever_its_size(law, damping):
    """After a tick under -D v alone, v' M v is less: the explicit step does not overshoot."""
    rng, model = np.random.default_rng(0), law.model
    for _ in range(20):
        state = np.concatenate((model.start, rng.normal(0.0, 5.0, model.nv)))
        terms = model.terms(model.create_scratch(), model.start, state[model.nq :])
        torque = damped_torque(terms, rng.normal(0.0, 100.0, model.n), 1.0, damping, law.period)
        assert torque @ terms.v[terms.actuated] <= 0.0
        force = np.zeros(model.nv)
        force[terms.actuated] = torque
        after = terms.v + law.period * np.linalg.solve(terms.mass_matrix, force)
        assert after @ terms.mass_matrix @ after < terms.v @ terms.mass_matrix @ terms.v
    small = damped_torque(terms, torque, 1.0, 1e-3, law.period)
    assert_allclose(small, -1e-3 * terms.v[terms.actuated], rtol=1e-12)


def test_ticks_without_a_solution_end_in_damping_within_fifty_milliseconds(law):
    state = state_of(law, 20.0)
    found = ticks(law, state, 50)
    outcomes = {tick.status[Status.OUTCOME] for tick in found}
    assert outcomes <= {Outcome.INFEASIBLE, Outcome.FAILED}
    shares = np.array([tick.status[Status.FALLING] for tick in found])
    assert_allclose(shares[: round(GIVE_WAY / law.period)], np.arange(1, 41) * law.period / GIVE_WAY, rtol=1e-9)
    speeds = state[law.model.nq + law.model.actuated]
    assert found[-1].torque @ speeds < 0.0
    assert found[-1].status[Status.FALLBACK] == 1.0
    ratio = found[-1].torque / speeds
    assert_allclose(ratio, ratio[0], rtol=1e-9)  # one damping for all joints
    assert 0.0 < -ratio[0] <= law.fallback_damping
    early = [tick for tick in found if tick.status[Status.FALLING] <= START]
    assert len(early) in (19, 20)  # sums of the period
    assert_allclose(early[-1].torque, early[1].torque, atol=1e-6)  # what misses least, its contacts dropped


def test_a_short_lack_of_solutions_changes_no_torque(law):
    fast = ticks(law, state_of(law, 20.0), 10)
    plain = ticks(law, state_of(law), 1)[0]
    after = ticks(law, state_of(law), 1, PreviousTick(np.zeros(law.model.n), None, fast[-1].status[Status.FALLING]))[0]
    assert_allclose(after.torque, plain.torque, rtol=1e-9, atol=1e-9)
    assert 0.0 < after.status[Status.FALLING] < fast[-1].status[Status.FALLING]
    assert after.status[Status.FALLBACK] == 0.0


def test_contacts_that_move_are_dropped_of_a_robot_that_falls(law):
    model = law.model
    still = state_of(law)
    terms = model.terms(model.create_scratch(), still[: model.nq], still[model.nq :])
    assert standing_contacts(terms, BOTH) == (BOTH, 0)
    moving = state_of(law, base={3: 1.0})  # the whole robot along x
    terms = model.terms(model.create_scratch(), moving[: model.nq], moving[model.nq :])
    assert standing_contacts(terms, BOTH) == ((False, False), 2)
    one = model.terms(model.create_scratch(), moving[: model.nq], moving[model.nq :], (False, True))
    assert standing_contacts(one, (False, True)) == ((False, False), 1)
    falls = ticks(law, moving, 1, PreviousTick(np.zeros(model.n), None, 0.2))[0]
    assert falls.status[Status.DROPPED] == 2.0
    assert falls.status[Status.FALLING] > 0.2
    assert_allclose(falls.force, 0.0, atol=0.0)
    stands = ticks(law, moving, 1)[0]
    assert stands.status[Status.DROPPED] == 0.0


def test_a_state_that_is_lost_fades_as_before(law):
    state = state_of(law)
    state[5] = np.nan
    before = PreviousTick(np.ones(law.model.n), None, 1.0)
    tick = ticks(law, state, 1, before)[0]
    assert_allclose(tick.torque, np.exp(-law.period / law.fade), rtol=1e-12)
    assert tick.status[Status.FALLING] == 1.0
