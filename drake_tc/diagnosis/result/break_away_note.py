"""A note on static friction: the rows of the regression slide, so only the events of breaking away show it."""

import numpy as np

from drake_tc.diagnosis.notes import Sticking
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.base import DriveEffect
from drake_tc.identification.pull_tests import LEAST_EVENTS, BreakAway, break_away

PLAIN = frozenset({"viscous", "coulomb", "rotor_inertia", "stribeck"})
"""Effects beside which the torque at an event is static friction; others, such as friction that grows with the load,
act at the event too."""
CLEARLY = 1.5
"""Lower end of the break-away torque's interval over the sliding friction, from which on the note is made."""
NOISES = 4.0
"""... and how many noise floors it must exceed it by: the torque of an event is the largest of a short window."""
RESTS = 2.0
"""Stretch at rest before an event, in supports of the filters."""


def sticking(columns: Columns, final: Fit) -> Sticking | None:
    """Static friction from the training runs, where it is clearly larger than the model's sliding friction.

    Args:
        columns: Training rows.
        final: The final model.
    """
    samples = columns.samples
    named = physical_parameters(final)
    if not PLAIN.issuperset(t.effect.id for t in final.terms if not isinstance(t.effect, DriveEffect)):
        return None
    least_rest = max(2, round(RESTS * samples.light.margin))
    effort = columns.acting_effort(final.terms)
    torques = []
    for segment in samples.segments:
        s = samples.signals.take(segment)
        needed = s.load_torque + s.rotor_inertia * s.acceleration + named["viscous"]["viscous"] * s.velocity
        moving = np.abs(s.velocity) > samples.resolution.least_speed
        found = break_away(effort[segment] / final.gain, needed, s.velocity, moving, least_rest)
        torques.append(found.torque)
    torque = np.concatenate(torques)
    if torque.size < LEAST_EVENTS:
        return None
    events = BreakAway(np.arange(torque.size), np.ones(torque.size), torque)
    low, high = events.interval
    sliding = named["coulomb"]["coulomb"] + named.get("stribeck", {}).get("stribeck", 0.0)
    fitted = BalanceCoefficients.of(final.terms, final.beta)
    noise = samples.floor.torque(fitted.stiffness, fitted.viscous)
    if low < max(CLEARLY * sliding, sliding + NOISES * noise):
        return None
    return Sticking(events.level, low, high, sliding, int(torque.size))
