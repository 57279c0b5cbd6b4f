"""A robot that falls: where ticks go on without a solution, the torques give way to damping of the joints.

    s[n] = min(1, s[n-1] + period/GIVE_WAY)    a tick without a solution, or with a contact that was dropped
           max(0, s[n-1] - period/REGAIN)      else
    tau  = a (1 - w) tau_tick - w D v,  w = clip((s - START)/(1 - START), 0, 1)

A few ticks without a solution, as a push brings them, leave the torque that misses least as it is (s <= START). From
GIVE_WAY on the joints are damped alone. In between a <= 1 is the largest with which the joints' power is bounded,

    tau . v <= (1 - u) max(tau_tick . v, 0),  u = min(w/NO_POWER, 1),

so that it is not positive from 2 ms after START on. D is the law's `fallback_damping`, less where that would be more
than a tick can damp: the largest eigenvalue of period M^-1 D stays below STABLE, M^-1 the joints' block of the inverse
mass matrix. While s > 0 a contact that moves carries nothing and is dropped from the tick.
"""

from typing import NamedTuple

import numpy as np

from drake_tc.tsid.model import Scratch, TsidModel
from drake_tc.tsid.rows import Terms
from drake_tc.types import FloatArray

GIVE_WAY, START, REGAIN = 0.04, 0.5, 0.5
"""Time without a solution after which there is damping alone [s]; share of it before which nothing is changed; time
with solutions after which nothing is left of it [s]."""
SLIDING, TURNING = 0.3, 3.0
"""Speed of a contact that no longer stands [m/s, rad/s]: a foot that rolls over its edge turns with less."""
STABLE = 0.5
NO_POWER = 0.1
"""Share w of the damping from which on the joints give no power."""


class Standing(NamedTuple):
    """Contacts of a tick.

    Attributes:
        active: One a contact: whether the tick stands on it.
        dropped: How many of those that were to carry move.
    """

    active: tuple[bool, ...]
    dropped: int


def standing_contacts(terms: Terms, active: tuple[bool, ...]) -> Standing:
    """The contacts that do not move.

    Args:
        terms: At the state, with these contacts.
        active: One a contact of the model.
    """
    moves = iter(_moving(terms))
    kept = tuple(carries and not next(moves) for carries in active)
    return Standing(kept, sum(active) - sum(kept))


def _moving(terms: Terms) -> list[bool]:
    """Of the active contacts, one after the other."""
    found: list[bool] = []
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        velocity = terms.contact_velocity[rows]
        turns = contact.size == 6 and float(np.linalg.norm(velocity[3:])) > TURNING
        found.append(turns or float(np.linalg.norm(velocity[:3])) > SLIDING)
    return found


def falling_share(before: float, period: float, *, unsolved: bool) -> float:
    """s[n]."""
    return min(1.0, before + period / GIVE_WAY) if unsolved else max(0.0, before - period / REGAIN)


def damped_torque(terms: Terms, torque: FloatArray, share: float, damping: float, period: float) -> FloatArray:
    """(n,) tau of the module.

    Args:
        terms: At the state.
        torque: (n,) of the tick [N m].
        share: s.
        damping: Of the law [N m s/rad].
        period: Of the ticks [s].
    """
    weight = min(max((share - START) / (1.0 - START), 0.0), 1.0)
    if weight == 0.0:
        return torque
    joints = terms.actuated
    moved = np.linalg.inv(terms.mass_matrix)[np.ix_(joints, joints)]
    fastest = period * damping * float(np.linalg.eigvalsh(moved)[-1])
    own = damping * min(1.0, STABLE / fastest) if fastest > 0.0 else damping
    velocity = terms.v[joints]
    power, taken = float(torque @ velocity), weight * own * float(velocity @ velocity)
    kept = 1.0 - weight
    if power > 0.0:
        allowed = (1.0 - min(weight / NO_POWER, 1.0)) * power
        kept = min(kept, (allowed + taken) / power)
    return np.asarray(kept * torque - weight * own * velocity)


def terms_at(model: TsidModel, scratch: Scratch, state: FloatArray, active: tuple[bool, ...]) -> Terms:
    """At a state (nq + nv,)."""
    return model.terms(scratch, state[: model.nq], state[model.nq : model.nq + model.nv], active)
