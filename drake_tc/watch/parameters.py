"""Which parameters of a joint changed: from the stored values and the fit of new logs to the posterior of a shift.

The stored values and those of the new fit differ by what changed, by what differs from session to session, and by heat
(`changes`). Three things take part beside them: effects that the new logs alone show, whose stored size is 0; errors
that both fits share; and what the new fit leaves unexplained, which its new effects may be.
"""

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.priors import AGE_PERIODS
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import gap_between_encoders
from drake_tc.effects.base import TorqueEffect
from drake_tc.effects.library import effect
from drake_tc.effects.payload import PAYLOAD_ARM
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray
from drake_tc.watch.changes import (
    CHANGE_SIZE,
    FEWEST_DEVIATIONS,
    Known,
    Shift,
    change_by_heat,
    of_temperature,
    session_deviation,
)

Place = tuple[str, str]
"""Key of an effect, "drive" for the gain, and name of a parameter."""
Pairs = Mapping[Place, tuple[Known, Known]]
"""Values then and now."""
BETWEEN_ENCODERS = ("backlash", "gap_between_encoders")
"""Key and name of the gap that two encoders show; the balance at the motor does not contain it."""
ABSENT = Known(0.0, 0.0)
"""Size of an effect that the stored model does not have."""
LARGEST_SHARE = 1e3
"""What is left over what a new effect explains, at most: an effect that explains nothing is nothing but discrepancy."""
VISCOUS = ("viscous", "viscous")
SAME_AGES = 0.9
"""Correlation of the errors of a channel's age on two days: way and hold are the same, the clocks start anew."""
PAYLOAD = "payload.pendulum"
"""Key of a payload on a pendulum whose drive gain is free."""
LEAST_GAP = 5e-5
"""Size of a gap's change that is no change, at least: rounding and noise of two encoders [rad]."""


@dataclass(frozen=True)
class ParameterChange:
    """One parameter then and now.

    Attributes:
        key, name, unit: Effect ("drive" has the gain), parameter, unit.
        then: Value and 95 % interval.
        now: The same under the new logs, with the stored one and a change as the prior.
        fitted: What the new logs say alone.
        change: By how much it changed if it did, beside those that did; the spread between sessions is in its interval.
        log_odds: That it changed, beside the other changes.
        changed: Whether it is in the most probable set of changes.
        heat: Whether it would be if the temperature were the same, or whether it is of an effect of the temperature.
        alternatives: Parameters whose change would explain as much in its place, as "effect.parameter".
    """

    key: str
    name: str
    unit: str
    then: Known
    now: Known
    fitted: Known
    change: Known
    log_odds: float
    changed: bool
    heat: bool = False
    alternatives: tuple[str, ...] = ()

    @property
    def share(self) -> float:
        """Change over the stored value."""
        return self.change.value / abs(self.then.value) if self.then.value else math.inf


def parameter_changes(
    joint: JointResult, model: ActuatorModel, rig: Rig, temperature: tuple[float, float], reference: Mapping[str, Any]
) -> tuple[tuple[ParameterChange, ...], dict[str, float]]:
    """Every parameter that the stored model and the new fit have, and that both limit.

    Beside them, by key, the log odds that an effect of the new logs is there, given the stored numbers.
    """
    then, now = _then(joint, model, reference), _now(joint)
    own = [p for p in then if p in now and math.isfinite(then[p].deviation + now[p][0].deviation)]
    if not own:
        return (), {}
    groups = {f.key: [p for p in sizes_of(f.key, f.parameters) if p in now and p not in then] for f in joint.effects}
    groups = {key: g for key, g in groups.items() if g and all(math.isfinite(now[p][0].deviation) for p in g)}
    both = [*own, *(p for group in groups.values() for p in group)]
    pairs = {p: (then.get(p, ABSENT), now[p][0]) for p in both}
    spread = max(float(reference.get("run_spread", 0.0)), joint.run_spread)
    unmodelled = not any(of_temperature(value.key) for value in model.effects)
    warmer = temperature[1] - temperature[0] if unmodelled and not any(map(math.isnan, temperature)) else 0.0
    common = common_variances(pairs, joint, model)
    shift = _shift(pairs, _correlation(joint, both), common, spread, warmer)
    together = {key: tuple(map(both.index, group)) for key, group in groups.items()}
    opened = {together[key][0]: opened_by_payload(pairs, model, rig) for key in together if key == PAYLOAD}
    shift = with_discrepancy(replace(shift, together=tuple(together.values()), opened=opened), _unexplained(joint))
    which, odds = shift.best()
    cool = _shift(pairs, _correlation(joint, both), common, spread, 0.0)
    cold = replace(shift, between=cool.between, expected=None).best()[0]
    others = shift.alternatives(which)
    changes = tuple(
        ParameterChange(
            *p,
            now[p][1],
            then[p],
            replace(
                found := shift.new(k, which),
                value=then[p].value + found.value,
                deviation=math.hypot(found.deviation, math.sqrt(common[k])),
            ),
            now[p][0],
            shift.change(k, which),
            float(odds[k]),
            k in which and not of_temperature(p[0]),
            (k in cold and k not in which) or (k in which and of_temperature(p[0])),
            tuple(".".join(both[other]) for one, other in others if one == k),
        )
        for k, p in enumerate(own)
    )
    return changes, {key: float(odds[at[0]]) for key, at in together.items()}


def _shift(pairs: Pairs, correlation: FloatArray, common: FloatArray, spread: float, warmer: float) -> Shift:
    """From the stored values to those of the new fit.

    Args:
        pairs: p values then and now.
        correlation: (p, p) of the new fit.
        common: (p,) variances of errors that both fits share, which are in no difference.
        spread: Of runs, relative.
        warmer: Temperature now less that then [K].
    """
    stored, value = (np.array([known[day].value for known in pairs.values()]) for day in (0, 1))
    size = np.maximum(np.abs(stored), np.abs(value))
    session = np.array([session_deviation(p[0], s, spread) for p, s in zip(pairs, size, strict=True)])
    session[[k for k, p in enumerate(pairs) if p == BETWEEN_ENCODERS]] = LEAST_GAP / 2.0
    session[[k for k, (then, _) in enumerate(pairs.values()) if then is ABSENT]] = 0.0
    expected, heat = np.array([change_by_heat(p[0], s, warmer) for p, s in zip(pairs, stored, strict=True)]).T
    deviation = np.array([max(now.deviation, 1e-9 * abs(now.value), 1e-15) for _, now in pairs.values()])
    covariance = np.outer(deviation, deviation) * correlation - np.diag(common)
    before = np.diag(np.array([then.deviation for then, _ in pairs.values()]) ** 2 - common)
    scale = np.sqrt(np.diag(covariance + before) + session**2 + heat**2)
    prior = np.hypot(CHANGE_SIZE * size, FEWEST_DEVIATIONS * np.minimum(scale, size))
    return Shift(value - stored, before, covariance, session**2 + heat**2, prior, expected)


def _unexplained(joint: JointResult) -> float:
    """RMS error that the fit of the new logs leaves beyond noise, over the RMS of what their new effects explain."""
    before, after = (pooled(joint, (errors.train, errors.heldout)) for errors in (joint.before, joint.after))
    left = max(after**2 - joint.noise_floor**2, 0.0)
    return math.sqrt(min(left / max(before**2 - after**2, 1e-12 * before**2, 1e-300), LARGEST_SHARE**2))


def with_discrepancy(shift: Shift, share: float) -> Shift:
    """The shift whose new effects may be the discrepancy of the fit: it is as wrong along each as it is elsewhere.

    With the sizes x_g of an effect as the logs have them, and S_1 of the fit, S_1 grows by f f', f = share S_1g S_gg^-1
    x_g: the sizes move by that share of themselves, and other parameters with them.
    """
    now = shift.now.copy()
    for group in map(list, shift.together):
        own = shift.now[np.ix_(group, group)]
        f = share * shift.now[:, group] @ np.linalg.solve(own, shift.difference[group])
        now += np.outer(f, f)
    return replace(shift, now=now)


def common_variances(pairs: Pairs, joint: JointResult, model: ActuatorModel) -> FloatArray:
    """(p,) variance of the errors that both fits share: the age of a position servo's command, in its viscous friction.

    A command that acts by a later costs K (a/K) v, as a/K more of viscous friction does. The logs hardly tell a, and it
    is nearly the same on both days (`SAME_AGES`).
    """
    out = np.zeros(len(pairs))
    if model.drive.kind != "position_servo" or VISCOUS not in pairs:
        return out
    at, (then, now) = list(pairs).index(VISCOUS), pairs[VISCOUS]
    free = np.linalg.inv(_correlation(joint, list(pairs)) + 1e-9 * np.eye(out.size))[at, at]
    by_age = (AGE_PERIODS[1] * joint.train.samples.effort_period / model.drive.gain) ** 2
    out[at] = SAME_AGES * min(then.deviation**2, now.deviation**2 / free, by_age)
    return out


def _then(joint: JointResult, model: ActuatorModel, reference: Mapping[str, Any]) -> dict[Place, Known]:
    """The stored values, by effect and parameter."""
    gain = model.drive.gain
    then = {("drive", "gain"): Known.of(gain, reference.get("gain_ci95", (gain, gain)))}
    if "gap" in reference and gap_between_encoders(joint.train.samples) is not None:
        then[BETWEEN_ENCODERS] = Known.of(float(reference["gap"]["value"]), reference["gap"]["ci95"])
    for value in model.effects:
        for name, number in value.parameters.items():
            then[value.key, name] = Known.of(number, value.ci95.get(name, (number, number)))
    return then


def _now(joint: JointResult) -> dict[Place, tuple[Known, str]]:
    """The values of the new logs alone, with their units."""
    found = {
        (key, name): (Known.of(estimate.value, estimate.ci95), estimate.unit)
        for key, group in joint.final_parameters.items()
        for name, estimate in group.items()
    }
    gap = gap_between_encoders(joint.train.samples)
    return found if gap is None else found | {BETWEEN_ENCODERS: (Known.of(*gap), joint.units.position)}


def sizes_of(key: str, told: Container[str]) -> list[Place]:
    """Of the parameters that are `told`, those that are 0 where an effect is not: coefficients, or else shapes."""
    member = effect(key)
    sizes = [p.name for p in member.coefficients if p.name in told] or [p.name for p in member.shapes]
    return [(key, name) for name in sizes if name in told]


def opened_by_payload(pairs: Pairs, model: ActuatorModel, rig: Rig) -> FloatArray:
    """(p,) f of a payload on a pendulum, whose own inertia J_p the logs do not tell from a larger drive gain.

    The balance K (J qddot + tau + sum theta phi) stays as it is if K grows by the share J_p/(J + I) and all theta fall
    by it, with the declared inertia J and the pendulum's I. J_p is of the size that a typical payload of this moment
    has.
    """
    (moment,) = (now for (key, _), (_, now) in pairs.items() if key == PAYLOAD)
    load = rig.load[model.joint]
    inertia = model.inertia + (load.inertia if isinstance(load, Pendulum) else 0.0)
    share = PAYLOAD_ARM * abs(moment.value) / inertia if inertia > 0.0 else 0.0
    torques = {
        place
        for value in model.effects
        if isinstance(value.effect, TorqueEffect)
        for place in sizes_of(value.key, value.parameters)
    }
    signs = [1.0 if place[0] == "drive" else -float(place in torques) for place in pairs]
    return np.array([share * sign * then.value for sign, (then, _) in zip(signs, pairs.values(), strict=True)])


def _correlation(joint: JointResult, places: Sequence[tuple[str, str]]) -> np.ndarray:
    """(p, p) of the new fit."""
    if joint.correlation is None:
        return np.eye(len(places))
    names, out = joint.correlation.names, np.eye(len(places))
    own = [k for k, p in enumerate(places) if ".".join(p) in names]
    at = [names.index(".".join(places[k])) for k in own]
    out[np.ix_(own, own)] = joint.correlation.matrix[np.ix_(at, at)]
    return out


def pooled(joint: JointResult, errors: tuple[float, float]) -> float:
    """RMS of all rows from those of the rows that were fitted and that test."""
    train, test = joint.train.samples.rows.size, joint.heldout.samples.rows.size
    return math.sqrt((train * errors[0] ** 2 + test * errors[1] ** 2) / (train + test))
