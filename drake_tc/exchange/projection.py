"""From an actuator model to the few terms that simulators know, and the account of what is lost on the way."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import nnls

from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.base import TorqueEffect, plain_signals
from drake_tc.simulator_files.terms import StribeckPeak, Terms
from drake_tc.types import FloatArray

OF_SPEED = ("viscous", "coulomb", "stribeck", "quadratic_viscous", "static_friction", "viscous_power")
"""Effects that are functions of the velocity alone; together they are one friction curve, which is refitted."""
DRY = ("coulomb", "stribeck", "static_friction")
"""Those that are there however slow the joint is; they are lost as a whole where a target has no dry friction."""
FASTEST = 2.0
"""Speeds up to here count alike where no log says which occur [rad/s]."""


@dataclass(frozen=True)
class Refit:
    """Friction that the target cannot express, fitted by what it can.

    Attributes:
        effects: What the curve is made of.
        dropped: RMS error of the friction torque when terms are only left out [N m].
        refitted: RMS error after the refit [N m].
        speed: Largest speed over which both are meant [rad/s].
        recorded: Whether the speeds are those of logs; else all up to `speed` count alike.
    """

    effects: tuple[str, ...]
    dropped: float
    refitted: float
    speed: float
    recorded: bool


@dataclass(frozen=True)
class Loss:
    """An effect that the target lacks, and what that means.

    Attributes:
        effect: Its key in the model, or "drive gain".
        why: What that means, or what a user can do.
        partly: Whether the target has it, with another value.
    """

    effect: str
    why: str
    partly: bool = False


@dataclass(frozen=True)
class Projection:
    """A model in a target's terms.

    Attributes:
        joint: Its name.
        terms: In the target.
        losses: What the target lacks.
        refit: Of the friction curve; None where the target expresses it.
    """

    joint: str
    terms: Terms
    losses: tuple[Loss, ...]
    refit: Refit | None


@dataclass(frozen=True)
class Vocabulary:
    """What a target can express beside drive, armature and damping.

    Attributes:
        name: Of the target, for people.
        terms: Names of fields of `Terms`.
        missing: Field, or id of an effect, to what a user can do instead, or why it does not matter.
        drives: Kinds of drive whose gain it has.
        inexact: Term to how the target's differs.
        delay_step: Delays are whole multiples of this [s]; 0: any.
    """

    name: str
    terms: frozenset[str]
    missing: Mapping[str, str]
    drives: frozenset[str] = frozenset()
    inexact: Mapping[str, str] = field(default_factory=dict)
    delay_step: float = 0.0

    def has(self, term: str) -> bool:
        """Whether it has a term."""
        return term in self.terms


def project(model: ActuatorModel, target: Vocabulary, speeds: FloatArray | None = None) -> Projection:
    """The model in the target's terms; friction that these cannot express is refitted by least squares.

    Args:
        model: Of one joint.
        target: What can be expressed.
        speeds: (T,) velocities at which the friction counts [rad/s]; None: all up to 2 rad/s alike.
    """
    terms, losses = _direct(model, target)
    friction, refit = _friction(model, target, speeds)
    terms = replace(
        terms,
        damping=friction["damping"],
        frictionloss=friction["frictionloss"] if target.has("frictionloss") else 0.0,
        quadratic=friction.get("quadratic", 0.0) if target.has("quadratic") else 0.0,
        stribeck=_peak(model) if target.has("stribeck") else None,
    )
    lost = [("rotor_inertia", "armature")] if model.inertia else []
    lost += [(value.key, "frictionloss") for value in model.effects if value.effect.id in DRY]
    missing = [Loss(name, target.missing.get(term, "")) for name, term in lost if not target.has(term)]
    return Projection(model.joint, terms, (*_drive_lost(terms, target), *missing, *losses), refit)


COMMANDS = {"position_servo": "rad", "current": "A", "voltage": "V", "torque": "N m"}
"""Unit of the effort of each kind of drive."""


def _drive_lost(terms: Terms, target: Vocabulary) -> tuple[Loss, ...]:
    if terms.drive in target.drives or (terms.drive == "torque" and terms.kp == 1.0):
        return ()
    return (Loss("drive gain", f"your controller has to apply {terms.kp:.6g} N m for 1 {COMMANDS[terms.drive]}"),)


def _direct(model: ActuatorModel, target: Vocabulary) -> tuple[Terms, list[Loss]]:
    """Drive, inertia, delay, limit, friction under load and backlash; and everything that no target knows."""
    kp = 1.0 / model.drive.gain
    found = {"delay": 0.0, "torque_limit": None, "backlash": 0.0, "load_friction": 0.0}
    losses = []
    for value in model.effects:
        name = value.effect.id
        if name in OF_SPEED or name == "rotor_inertia":
            continue
        term, number = _term(value.key, value.parameters, kp)
        if term and target.has(term):
            found[term], rounded = _rounded(term, number, target)
            losses += rounded
            losses += [Loss(value.key, target.inexact[term], partly=True)] if term in target.inexact else []
        else:
            losses.append(Loss(value.key, target.missing.get(term) or target.missing.get(name, LOST.get(name, ""))))
    armature = model.inertia if target.has("armature") else 0.0
    return Terms(model.drive.kind, kp, armature=armature, **found), losses  # type: ignore[arg-type]


def _rounded(term: str, number: float, target: Vocabulary) -> tuple[float, list[Loss]]:
    """The term as the target has it, and what is lost by its rounding."""
    if term != "delay" or not target.delay_step:
        return number, []
    found = round(number / target.delay_step) * target.delay_step
    if abs(found - number) <= 1e-6 * number:
        return found, []
    why = f"delays are whole physics steps, {found:.6g} s in place of {number:.6g} s"
    return found, [Loss("delay.command", why, partly=True)]


def _term(key: str, parameters: Mapping[str, float], kp: float) -> tuple[str, float]:
    """The term of an effect and its value; "" where no target has one."""
    if key == "delay.command":
        return "delay", parameters["delay"]
    if key == "saturation":
        return "torque_limit", kp * parameters["limit"]
    if key == "backlash":
        return "backlash", parameters["backlash"]
    if key == "load_dependent_friction":
        return "load_friction", parameters["load_friction"]
    return "", 0.0


LOST = {
    "deadzone": "the servo answers small errors in the target, where the real one rests: errors at rest are too small",
    "elasticity": "add a spring joint by hand: a second hinge with this stiffness between motor and link",
    "asymmetric_friction": "the mean of both directions is exported",
    "presliding_hysteresis": "the target's friction at rest is stiff or creeps",
    "load_dependent_friction": "friction does not grow with the load there",
    "directional_efficiency": "friction does not grow with the load there",
    "torque_ripple": "the target's torque is smooth over the turn",
    "position_dependent_friction": "friction is the same over the turn there",
    "thermal_friction": "friction is that at 25 degrees Celsius there",
    "current_lag": "the target's drive answers at once; a first-order actuator dynamics can be added by hand",
    "velocity_sign_switch": "the servo's switch at reversals is not there",
    "servo_integrator": "the target's servo has no integrator",
    "torque_sensor_bias": "an error of the sensor, not of the actuator",
    "torque_sensor_gain": "an error of the sensor, not of the actuator",
    "torque_sensor_drift": "an error of the sensor, not of the actuator",
    "effort_bias": "an error of the sensor, not of the actuator",
    "encoder_offset": "an error of the sensor, not of the actuator",
    "encoder_eccentricity": "an error of the sensor, not of the actuator",
    "encoder_ripple": "an error of the sensor, not of the actuator",
    "payload": "belongs to the link: change its mass in the robot's model",
    "cable_spring": "add a joint stiffness by hand where the target has one",
    "unknown_load": "belongs to the link: change its mass and centre of mass in the robot's model",
}
"""Effects that no target expresses, and what follows."""


def _friction(
    model: ActuatorModel, target: Vocabulary, speeds: FloatArray | None
) -> tuple[dict[str, float], Refit | None]:
    """Dry, linear and quadratic friction of the target, and how well they do where they cannot be exact."""
    parts = [(e, p) for e, p in model.torque_effects if e.id in OF_SPEED]
    parts = parts if target.has("frictionloss") else [(e, p) for e, p in parts if e.id not in DRY]
    has = {e.id: p for e, p in parts}
    plain = {
        "frictionloss": float(has.get("coulomb", {}).get("coulomb", 0.0)),
        "damping": float(has.get("viscous", {}).get("viscous", 0.0)),
        "quadratic": float(has.get("quadratic_viscous", {}).get("quadratic_viscous", 0.0)),
    }
    exact = {"viscous", *(["coulomb"] if target.has("frictionloss") else [])}
    exact |= {"quadratic_viscous"} if target.has("quadratic") else set()
    if target.has("stribeck"):
        parts = [(e, p) for e, p in parts if e.id != "stribeck"]
    odd = tuple(e.id for e, _ in parts if e.id not in exact)
    if not odd:
        return plain, None
    v = np.linspace(0.0, FASTEST, 401)[1:] if speeds is None else np.abs(speeds[np.abs(speeds) > 0.0])
    names = [name for name in ("frictionloss", "damping", "quadratic") if name == "damping" or target.has(name)]
    curve = _curve(parts, v)
    basis = np.column_stack(
        [{"frictionloss": np.ones_like(v), "damping": v, "quadratic": v**2}[name] for name in names]
    )
    fitted, _ = nnls(basis, curve)
    left_out = curve - basis @ np.array([plain[name] for name in names])
    refit = Refit(odd, _rms(left_out), _rms(curve - basis @ fitted), float(v.max()), speeds is not None)
    return dict(zip(names, fitted.tolist(), strict=True)), refit


def _peak(model: ActuatorModel) -> StribeckPeak | None:
    for value in model.effects:
        if value.effect.id == "stribeck":
            names = ("stribeck", "stribeck_velocity", "stribeck_exponent")
            return StribeckPeak(*(value.parameters[name] for name in names))
    return None


def _curve(parts: Sequence[tuple[TorqueEffect, Mapping[str, float]]], speed: FloatArray) -> FloatArray:
    """(T,) friction torque at positive velocities (T,) [N m]."""
    signals = plain_signals(speed.size, {"velocity": speed, "direction": np.ones_like(speed)})
    return np.asarray(sum((e.torque(signals, p) for e, p in parts), np.zeros_like(speed)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
