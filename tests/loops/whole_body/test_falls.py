"""Pushes that no controller can stand: once ticks have had no solution for long, the joints take energy alone."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from sweeps import slow_but

import drake_tc.diagrams
from drake_tc.loops.whole_body.running import build_tsid, run_tsid, summarise_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.tsid.fallbacks import GIVE_WAY, NO_POWER, START
from drake_tc.tsid.law import Status

HUMANOID = Path(next(iter(drake_tc.diagrams.__path__))) / "humanoid_tsid.scenario.yaml"
GRAVITY = 9.81


OTHERS = HUMANOID.with_name("humanoid_tsid_other_robots.scenario.yaml")
ROBOTS = {"balance": (HUMANOID, "torso"), "talos": (OTHERS, "torso_2_link"), "solo12": (OTHERS, "base_link")}
"""Scenario to its file and the link that is pushed."""


def pushed(force, degrees, duration=2.0, robot="balance"):
    along = force * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    file, link = ROBOTS[robot]
    push = f"{{link: {link}, begin: 0.3, duration: 0.2, force: [{along[0]}, {along[1]}, 0], point: [0, 0, 0.2]}}"
    scenario = TsidScenario.load(file, robot, f"{{duration: {duration}, pushes: [{push}]}}")
    scenario = replace(scenario, motion={}, lifted={})
    return run_tsid(build_tsid(scenario, fused=True))


def joint_power(run):
    """(T,) of the torques that act on the joints [W]."""
    model = run.law.model
    return (run["applied_torque"] * run["state"][:, model.nq + model.actuated]).sum(axis=1)


FORCES, DIRECTIONS = (10.0, 30.0, 100.0, 200.0, 300.0), tuple(22.5 * k for k in range(16))


@pytest.mark.parametrize(
    ("robot", "force", "degrees"), slow_but(product(ROBOTS, FORCES, DIRECTIONS), ("solo12", 300.0, 180.0))
)
def test_no_push_makes_the_joints_add_energy(robot, force, degrees):
    """From 50 ms of ticks without a solution on the joints take energy; all energy was there before."""
    run = pushed(force, degrees, 1.5, robot)
    assert all(np.isfinite(values).all() for values in run.signals.values())
    falling, power = run.status(Status.FALLING), joint_power(run)
    damped = falling >= START + NO_POWER * (1.0 - START)
    assert power[damped].max(initial=0.0) <= 1e-9
    kinetic, potential = energies(run)
    whole = kinetic + potential
    ends = min(round(0.5 / run.law.period), power.size - 2)  # of the push, or of the run
    if damped.any():
        first = max(int(np.argmax(damped)), ends)
        assert whole[first:].max() <= whole[: first + 1].max() + 1.0
    solved = (run.status(Status.OUTCOME) == 0.0) & ~damped  # a law that has a solution may work to catch itself
    work = run.law.period * np.cumsum(np.where(solved, np.maximum(power, 0.0), 0.0))
    most = whole[: ends + 1].max() + work[ends:] - work[ends]
    assert (whole[ends:] <= most + 1.0).all()


def energies(run):
    """(T,) kinetic and potential energy [J]."""
    model, scratch = run.law.model, run.law.model.create_scratch()
    found = []
    for state in run["state"]:
        terms = model.terms(scratch, state[: model.nq], state[model.nq :])
        found.append((0.5 * terms.v @ terms.mass_matrix @ terms.v, GRAVITY * terms.mass * terms.com[2]))
    return np.array(found).T


@pytest.mark.parametrize("degrees", slow_but((0.0, 90.0, 180.0), 180.0))
def test_a_fall_is_damped(degrees):
    run = pushed(300.0, degrees)
    model, falling = run.law.model, run.status(Status.FALLING)
    assert run.fell is not None
    velocity, power = run["state"][:, model.nq + model.actuated], joint_power(run)
    bounded = falling >= START + NO_POWER * (1.0 - START)
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


@pytest.mark.parametrize("degrees", slow_but((0.0, 180.0), 180.0))
def test_a_push_that_the_law_stands_damps_nothing(degrees):
    run = pushed(100.0, degrees, 1.2)
    assert run.fell is None
    assert run.status(Status.FALLING).max() == 0.0
    kinetic, _ = energies(run)
    assert kinetic[-1] < 0.2 * kinetic.max()


@pytest.mark.slow
def test_a_robot_that_catches_itself_is_let_go_again():
    run = pushed(200.0, 90.0)
    falling = run.status(Status.FALLING)
    assert run.fell is None
    assert falling.max() > 0.0
    assert falling[-1] == 0.0
