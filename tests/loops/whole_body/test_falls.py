"""Pushes that no controller can stand: once ticks have had no solution for long, the joints take energy alone."""

from pathlib import Path

import numpy as np
import pytest

import drake_tc.diagrams
from drake_tc.loops.whole_body.loop import build_tsid
from drake_tc.loops.whole_body.running import run_tsid, summarise_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.falling import GIVE_WAY, START
from drake_tc.tsid.law import Status

HUMANOID = Path(next(iter(drake_tc.diagrams.__path__))) / "humanoid_tsid.scenario.yaml"
GRAVITY = 9.81


def pushed(force, degrees, duration=2.0):
    along = force * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    push = f"{{link: torso, begin: 0.3, duration: 0.2, force: [{along[0]}, {along[1]}, 0], point: [0, 0, 0.2]}}"
    scenario = TsidScenario.load(HUMANOID, "balance", f"{{duration: {duration}, pushes: [{push}]}}")
    return run_tsid(build_tsid(scenario, fused=True))


def energies(run):
    """(T,) kinetic and potential energy [J]."""
    model, scratch = run.law.model, run.law.model.create_scratch()
    found = []
    for state in run["state"]:
        terms = model.terms(scratch, state[: model.nq], state[model.nq :])
        found.append((0.5 * terms.v @ terms.mass_matrix @ terms.v, GRAVITY * terms.mass * terms.com[2]))
    return np.array(found).T


@pytest.mark.parametrize(("force", "degrees"), [(300.0, 0.0), (300.0, 90.0), (300.0, 180.0)])
def test_a_fall_is_damped(force, degrees):
    run = pushed(force, degrees)
    model, falling = run.law.model, run.status(Status.FALLING)
    assert run.fell is not None
    velocity = run["state"][:, model.nq + model.actuated]
    power = (run["applied_torque"] * velocity).sum(axis=1)
    bounded = falling >= 0.5 * (START + 1.0)
    assert bounded.sum() > 50
    assert power[bounded].max() <= 1e-9
    unsolved = run.status(Status.OUTCOME) > 0.0
    steps = round(GIVE_WAY / run.law.period)
    for end in np.flatnonzero(np.convolve(unsolved, np.ones(steps), "valid") == steps) + steps - 1:
        assert power[end] <= 0.0
    kinetic, potential = energies(run)
    whole, first = kinetic + potential, int(np.argmax(falling > START))
    assert whole[first:].max() <= whole[: first + 1].max() + 1.0  # what push and law had put in before
    assert kinetic.max() <= whole[: first + 1].max() - potential.min() + 1.0
    assert run.status(Status.DROPPED)[first:].max() == 2.0
    assert np.abs(velocity).max() < 10.0
    assert "falling, joints damped" in [fault["name"] for fault in summarise_tsid(run)["faults"]]


@pytest.mark.parametrize(("force", "degrees"), [(100.0, 0.0), (100.0, 180.0)])
def test_a_push_that_the_law_stands_damps_nothing(force, degrees):
    run = pushed(force, degrees, 1.2)
    assert run.fell is None
    assert run.status(Status.FALLING).max() == 0.0
    kinetic, _ = energies(run)
    assert kinetic[-1] < 0.2 * kinetic.max()


def test_a_robot_that_catches_itself_is_let_go_again():
    run = pushed(200.0, 90.0)
    falling = run.status(Status.FALLING)
    assert run.fell is None
    assert falling.max() > 0.0
    assert falling[-1] == 0.0
