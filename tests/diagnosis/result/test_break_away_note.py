"""Static friction is told of a joint that sticks, and not of one that slides as it breaks away."""

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.result.break_away_note import Sticking, sticking
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run

from ..rigs import Joint, rig_of

JOINT = Joint(torque_noise=0.02)
STARTS = 12


def stop_and_go(static: float, seed: int = 0) -> Run:
    """Ramps of effort at rest up to `static` [N m], each followed by a slide of one second in turn of direction."""
    rng, period = np.random.default_rng(seed), JOINT.period
    rest, slide = 700, 500
    q, effort, position = [], [], 0.0
    for k in range(STARTS):
        side = 1.0 if k % 2 == 0 else -1.0
        ramp = side * np.linspace(0.2, static, rest)
        s = np.arange(1, slide + 1) / slide
        travel = 0.6 * (s - np.sin(2 * np.pi * s) / (2 * np.pi))
        speed = 0.6 * (1.0 - np.cos(2 * np.pi * s)) / (slide * period)
        pull = 0.6 * 2 * np.pi * np.sin(2 * np.pi * s) / (slide * period) ** 2
        friction = JOINT.inertia * pull + JOINT.viscous * speed + JOINT.coulomb
        q += [np.full(rest, position), position + side * travel]
        effort += [JOINT.gain * ramp, JOINT.gain * side * friction]
        position += side * 0.6
    columns = {
        "joint/position": np.concatenate(q) + 1e-6 * rng.standard_normal(STARTS * (rest + slide)),
        "joint/torque": JOINT.torque_noise * rng.standard_normal(STARTS * (rest + slide)),
        "joint/current": np.concatenate(effort),
    }
    count = columns["joint/position"].size
    return Run("run", None, np.arange(count) * period, period, columns, np.zeros(count, np.int64))


def told(static: float) -> Sticking | None:
    samples = build_samples([stop_and_go(static)], rig_of(JOINT), "joint")
    columns = Columns(samples)
    return sticking(columns, fit(columns, [Term(effect("viscous")), Term(effect("coulomb"))]))


@pytest.mark.parametrize("static", [6.0, 9.0])
def test_the_break_away_torque_is_found(static: float) -> None:
    found = told(static)
    assert found is not None
    assert found.events >= STARTS - 2
    # the last sample at rest lies half a filter before the motion is resolved: some percent of the ramp
    assert abs(found.level - static) < 0.08 * static


def test_a_joint_that_slides_as_it_breaks_away_is_not_said_to_stick() -> None:
    assert told(JOINT.coulomb) is None
