"""From an actuator model to the few terms that simulators know, and the account of what is lost on the way.

What each target can express, and what to do about the rest.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import nnls

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.config.joint_units import EFFORT_UNIT, JointType
from drake_tc.effects.base import SensorEffect, TorqueEffect, plain_signals
from drake_tc.simulator_files.terms import Ripple, StribeckPeak, Terms
from drake_tc.types import FloatArray

LOADED = "load_dependent_friction"
"""Effect of which the mean over the recorded loads is refitted where the target lacks it."""
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
    """An effect that the target lacks: its key in the model, "drive gain", or "torque_constant" of a data sheet.

    Attributes:
        effect: This key.
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
        joint_type: Whether the joint turns or slides.
    """

    joint: str
    terms: Terms
    losses: tuple[Loss, ...]
    refit: Refit | None
    joint_type: JointType = "revolute"


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
        stribeck_exponent: The only exponent of a Stribeck peak that it has; None: any.
        no_motor: Why it has no motor with the torque constant of a data sheet, for a drive on a voltage of these terms,
            a clause; "" where it has one.
    """

    name: str
    terms: frozenset[str]
    missing: Mapping[str, str]
    drives: frozenset[str] = frozenset()
    inexact: Mapping[str, str] = field(default_factory=dict)
    delay_step: float = 0.0
    stribeck_exponent: float | None = None
    no_motor: Callable[[Terms], str] = lambda _terms: ""

    def has(self, term: str) -> bool:
        """Whether it has a term."""
        return term in self.terms


def project(
    model: ActuatorModel, target: Vocabulary, speeds: FloatArray | None = None, loads: FloatArray | None = None
) -> Projection:
    """The model in the target's terms; friction that these cannot express is refitted by least squares.

    Args:
        model: Of one joint.
        target: What can be expressed.
        speeds: (T,) velocities at which the friction counts [rad/s]; None: all up to 2 rad/s or m/s alike.
        loads: (T,) load torque at these [N m]: friction that grows with the load is refitted too; None: it is lost
            where the target lacks it.
    """
    known = speeds is not None and loads is not None
    terms, losses = _direct(model, target, refits_load=known and target.has("frictionloss"))
    friction, peak, refit = _friction(model, target, speeds, loads if known else None)
    terms = replace(
        terms,
        damping=friction["damping"],
        frictionloss=friction["frictionloss"] if target.has("frictionloss") else 0.0,
        quadratic=friction.get("quadratic", 0.0) if target.has("quadratic") else 0.0,
        stribeck=peak,
        derivative_gain=min(terms.derivative_gain, friction["damping"]),
    )
    lost = [("rotor_inertia", "armature")] if model.inertia and "rotor_inertia" in _keys(model) else []
    lost += [(value.key, "frictionloss") for value in model.effects if value.effect.id in DRY]
    missing = [Loss(name, target.missing.get(term, "")) for name, term in lost if not target.has(term)]
    return Projection(model.joint, terms, (*_drive_lost(terms, target), *missing, *losses), refit, model.joint_type)


def _drive_lost(terms: Terms, target: Vocabulary) -> tuple[Loss, ...]:
    if terms.drive in target.drives or (terms.drive == "torque" and terms.kp == 1.0):
        return ()
    unit = EFFORT_UNIT[terms.drive].replace("*", " ")
    return (Loss("drive gain", f"your controller has to apply {terms.kp:.6g} N m per {unit}"),)


def _keys(model: ActuatorModel) -> tuple[str, ...]:
    return tuple(value.key for value in model.effects)


SUMS = (
    *("delay", "backlash", "load_friction", "stiffness", "preload", "lag", "integral_rate", "compliance"),
    "derivative_gain",
)
"""Terms of which several effects add up."""


def _direct(model: ActuatorModel, target: Vocabulary, *, refits_load: bool) -> tuple[Terms, list[Loss]]:
    """Drive, inertia, delay, limit, friction under load and backlash; and everything that no target knows.

    Effects that are listed twice act one after the other: delays add up, and the smaller limit holds.
    """
    kp = _gain_factor(model) / model.drive.gain
    found = dict.fromkeys(SUMS, 0.0) | {"torque_limit": math.inf}
    ripple: Ripple | None = None
    losses, late = [], ""
    for value in model.effects:
        name = value.effect.id
        if name in OF_SPEED or name == "rotor_inertia" or (name == "servo_gain" and _gain_factor(model) != 1.0):
            continue
        if value.key == LOADED and refits_load and not target.has("load_friction"):
            continue
        if value.key == "torque_ripple" and target.has("ripple") and ripple is None:
            ripple = Ripple(*(value.parameters[each] for each in ("ripple_cosine", "ripple_sine", "cycles_per_turn")))
            continue
        numbers = _terms(value, model.drive.kind, kp)
        if not numbers or not all(map(target.has, numbers)):
            losses.append(_lost(value, next(iter(numbers), ""), target))
            continue
        for term, number in numbers.items():
            found[term] = min(found[term], number) if term == "torque_limit" else found[term] + number
        term = next(iter(numbers))
        late = value.key if term == "delay" else late
        losses += [Loss(value.key, target.inexact[term], partly=True)] if term in target.inexact else []
    found["delay"], rounded = _rounded(late, found["delay"], target.delay_step)
    armature = model.inertia if target.has("armature") else 0.0
    if found["lag"] and found["integral_rate"] and model.drive.kind == "position_servo":
        key = next(value.key for value in model.effects if value.effect.id == "current_lag")
        losses.append(Loss(key, "the target has no filter of the command of a servo with integral action"))
        found["lag"] = 0.0
    limit = found.pop("torque_limit")
    terms = replace(
        Terms(model.drive.kind, kp, armature=armature, torque_limit=limit if math.isfinite(limit) else None),
        ripple=ripple,
        **found,  # type: ignore[arg-type]
    )
    scaled = [key for key in _keys(model) if key == "servo_gain" and _gain_factor(model) != 1.0]
    if terms.delay or terms.torque_limit is not None:
        losses += [Loss(key, SCALES_ALL, partly=True) for key in scaled]
    return terms, losses + rounded


def _gain_factor(model: ActuatorModel) -> float:
    """By which errors of the drive gain change the torque for one unit of effort; 1 where no torque would be left."""
    factor = math.prod(1.0 + value.parameters["gain_error"] for value in model.effects if value.key == "servo_gain")
    return factor if factor > 0.0 else 1.0


def _lost(value: EffectValue, term: str, target: Vocabulary) -> Loss:
    """An effect that the target does not have, or of which it has the inertia alone."""
    effect = value.effect
    if isinstance(effect, SensorEffect):
        return Loss(value.key, OF_A_SENSOR)
    if target.has("armature") and isinstance(effect, TorqueEffect) and effect.inertia(value.parameters):
        return Loss(value.key, IN_THE_ARMATURE, partly=True)
    why = target.missing.get(term) or target.missing.get(effect.id) or LOST.get(value.key) or LOST.get(effect.id, "")
    return Loss(value.key, why)


def _rounded(key: str, delay: float, step: float) -> tuple[float, list[Loss]]:
    """The delay as the target has it, and what is lost by its rounding."""
    if not (delay and step):
        return delay, []
    found = round(delay / step) * step
    if abs(found - delay) <= 1e-6 * delay:
        return found, []
    return found, [Loss(key, f"delays are whole physics steps, {found:.6g} s in place of {delay:.6g} s", partly=True)]


def _terms(value: EffectValue, drive: str, kp: float) -> dict[str, float]:
    """Terms of an effect and their values, the one that names a loss first; empty where no target has any."""
    key, parameters = value.key, value.parameters
    if key == "delay.command" or (key == "delay.loop" and drive != "position_servo"):  # the command is the effort
        return {"delay": parameters["delay"]}
    if key == "saturation":
        return {"torque_limit": kp * parameters["limit"]}
    if key == "saturation.servo" and drive == "position_servo":
        return {"torque_limit": kp * parameters["limit"], "derivative_gain": kp * parameters["derivative_time"]}
    if key in ("cable_spring", "cable_spring.beside_weight"):
        return {"stiffness": parameters["spring_stiffness"], "preload": parameters.get("spring_preload", 0.0)}
    if key == "current_lag.command" or (key == "current_lag" and drive != "position_servo"):
        return {"lag": parameters["lag"]}
    of_key = {
        "backlash": ("backlash", "backlash"),
        LOADED: ("load_friction", "load_friction"),
        "servo_integrator": ("integral_rate", "integral_rate") if drive == "position_servo" else ("", ""),
        "elasticity": ("compliance", "compliance"),
    }
    term, name = of_key.get(key, ("", ""))
    return {term: parameters[name]} if term else {}


OF_A_SENSOR = "an error of the sensor, not of the actuator"
IN_THE_ARMATURE = (
    "its inertia was added to the rotor inertia; its weight belongs to the link: change the link's mass in the robot's"
    " model, and subtract this inertia from the rotor inertia if that mass includes it"
)
SCALES_ALL = "in the target, the error of the gain also scales the delayed and limited part of the effort"
_WINDING = "the target's winding has the same resistance at all temperatures"
LOST = {
    "deadzone": "the target's servo reacts to the smallest error, so that errors at rest are too small",
    "elasticity": "the target's gear is stiff",
    "asymmetric_friction": "the mean of both directions is exported",
    "presliding_hysteresis": "the target's friction at rest is stiff or creeps",
    "load_dependent_friction": "the target's friction does not grow with the load; with --rig and --log of runs with"
    " known loads, its mean is fitted instead",
    "directional_efficiency": "the target's friction does not grow with the load",
    "torque_ripple": "the target's torque does not depend on the position",
    "position_dependent_friction": "the target's friction is the same at all positions",
    "thermal_friction": "the target's friction is that at 25 degrees Celsius",
    "current_lag.command": "the target's drive follows its command at once",
    "saturation.servo": "the target limits the torque of the gain without that of the damping",
    "current_lag": "the target's drive reacts at once",
    "velocity_sign_switch": "the target's servo does not depend on the sign of the velocity",
    "servo_integrator": "the target's servo has no integrator",
    "effort_bias": OF_A_SENSOR,
    "delay.loop": "the target delays the command of a servo, not the position that the servo measures",
    "saturation.supply": "the target's limit of the torque does not follow the supply voltage",
    "supply_sag": "the target's drive does not depend on the supply voltage",
    "servo_gain": "a gain error of -1 or below is a drive without torque",
    "winding_heat": _WINDING,
    "winding_temperature": _WINDING,
    "drive_compression": "the target's torque is proportional to the effort",
    "gain_ripple": "the target's torque for an effort is the same at all positions",
    "load_stribeck": "the target's friction does not grow with the load",
    "load_tilt": "belongs to the link: change its centre of mass in the robot's model",
    "position_dependent_load": "the target has no load that is a curve over the position",
    "run_in_friction": "the target's friction is that of a joint that has run in",
    "payload": "belongs to the link: change its mass in the robot's model",
    "cable_spring": "the target's joint has no spring",
    "unknown_load": "belongs to the link: change its mass and centre of mass in the robot's model",
}
"""Effects that no target expresses, and what follows."""


def _friction(
    model: ActuatorModel, target: Vocabulary, speeds: FloatArray | None, loads: FloatArray | None
) -> tuple[dict[str, float], StribeckPeak | None, Refit | None]:
    """Dry, linear and quadratic friction of the target with its peak, and how well they do where they are not exact."""
    ids = (*OF_SPEED, LOADED) if loads is not None and not target.has("load_friction") else OF_SPEED
    parts = [(e, p) for e, p in model.torque_effects if e.id in ids]
    parts = parts if target.has("frictionloss") else [(e, p) for e, p in parts if e.id not in (*DRY, LOADED)]
    plain = {
        name: sum(float(p[key]) for e, p in parts if e.id == key)
        for name, key in (("frictionloss", "coulomb"), ("damping", "viscous"), ("quadratic", "quadratic_viscous"))
    }
    exact = {"viscous", *(["coulomb"] if target.has("frictionloss") else [])}
    exact |= {"quadratic_viscous"} if target.has("quadratic") else set()
    peak = _peak(model) if target.has("stribeck") else None
    only = target.stribeck_exponent
    if peak is not None and only is not None and abs(peak.exponent - only) > SAME_EXPONENT:
        peak = None
    elif peak is not None:
        parts = [(e, p) for e, p in parts if e.id != "stribeck"]
    odd = tuple(e.id for e, _ in parts if e.id not in exact)
    if not odd:
        return plain, peak, None
    moves = None if speeds is None else np.abs(speeds) > 0.0
    v = np.linspace(0.0, FASTEST, 401)[1:] if speeds is None or moves is None else np.abs(speeds[moves])
    load = np.zeros_like(v) if loads is None or moves is None else loads[moves]
    names = [name for name in ("frictionloss", "damping", "quadratic") if name == "damping" or target.has(name)]
    curve = _curve(parts, v, load)
    basis = np.column_stack(
        [{"frictionloss": np.ones_like(v), "damping": v, "quadratic": v**2}[name] for name in names]
    )
    fitted, left = nnls(basis, curve)
    if "stribeck" in odd and only is not None and target.has("stribeck"):
        for velocity in np.geomspace(*PEAKS, 40):  # a peak of the exponent that the target has
            with_peak = np.column_stack([basis, np.exp(-((v / velocity) ** only))])
            tried, miss = nnls(with_peak, curve)
            if miss < left:
                left, fitted = miss, tried[:-1]
                peak = StribeckPeak(float(tried[-1]), float(velocity), only) if tried[-1] > 0.0 else None
    left_out = curve - basis @ np.array([plain[name] for name in names])
    refit = Refit(odd, _rms(left_out), float(left) / math.sqrt(v.size), float(v.max()), speeds is not None)
    return dict(zip(names, fitted.tolist(), strict=True)), peak, refit


SAME_EXPONENT = 1e-3
PEAKS = (1e-3, 2.0)
"""Stribeck velocities that are tried [rad/s]."""


def _peak(model: ActuatorModel) -> StribeckPeak | None:
    for value in model.effects:
        if value.effect.id == "stribeck":
            names = ("stribeck", "stribeck_velocity", "stribeck_exponent")
            return StribeckPeak(*(value.parameters[name] for name in names))
    return None


def _curve(
    parts: Sequence[tuple[TorqueEffect, Mapping[str, float]]], speed: FloatArray, load: FloatArray
) -> FloatArray:
    """(T,) friction torque at positive velocities (T,) and load torques (T,) [N m]."""
    known = {"velocity": speed, "direction": np.ones_like(speed), "load_torque": load}
    known |= dict.fromkeys(("expected_torque", "slow_torque"), load)
    signals = plain_signals(speed.size, known)
    return np.asarray(sum((e.torque(signals, p) for e, p in parts), np.zeros_like(speed)))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


PHYSICS_STEP = 0.005
"""Of Isaac Lab's examples [s], in which its delays are counted."""
_NO_DELAY = "delay the commands in your controller's loop instead"
_NO_BACKLASH = "the target's gear has no play"
_REDUCED_MJCF = frozenset(
    {"armature", "frictionloss", "torque_limit", "backlash", "stiffness", "preload", "compliance", "derivative_gain"}
)
"""What readers of MJCF other than MuJoCo itself take."""
_DELAYED_POSITION = "the target delays the position command, and not the position that the servo measures"


def _no_motor(_terms: Terms) -> str:
    return "the back-EMF is a part of the viscous friction in the target"


def _no_motor_of_isaaclab(terms: Terms) -> str:
    """Why a `DCMotorCfg` cannot be written."""
    if terms.delay:
        why = "a delay needs a DelayedPDActuatorCfg, which has no line of torque over speed"
    elif terms.torque_limit is None:
        why = "a DCMotorCfg needs a limit of the voltage, and the model has none"
    else:
        return ""
    return f"{why}; the efforts do not include the back-EMF, which is a part of viscous_friction"


TARGETS: Mapping[str, Vocabulary] = MappingProxyType(
    {
        "mjcf": Vocabulary(
            "MuJoCo (MJCF)",
            frozenset({"armature", "frictionloss", "quadratic", "torque_limit", "delay", "backlash"})
            | {"stiffness", "preload", "lag", "integral_rate", "stribeck", "ripple", "compliance", "derivative_gain"},
            {},
            stribeck_exponent=2.0,
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
        ),
        "mjlab": Vocabulary(
            "mjlab",
            frozenset({"armature", "frictionloss", "torque_limit", "delay", "derivative_gain"}),
            {"backlash": _NO_BACKLASH},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
            delay_step=PHYSICS_STEP,
        ),
        "playground": Vocabulary(
            "MuJoCo Playground (MJX)",
            _REDUCED_MJCF | {"lag"},
            {"delay": _NO_DELAY},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
            no_motor=_no_motor,
        ),
        "newton": Vocabulary(
            "Newton",
            _REDUCED_MJCF,
            {"delay": _NO_DELAY},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
        ),
        "urdf": Vocabulary(
            "URDF",
            frozenset({"frictionloss", "torque_limit"}),
            {
                "armature": "export to drake-urdf or mjcf, which have it",
                "delay": _NO_DELAY,
                "backlash": _NO_BACKLASH,
            },
            no_motor=_no_motor,
        ),
        "drake-urdf": Vocabulary(
            "Drake (URDF)",
            frozenset({"armature", "torque_limit", "derivative_gain"}),
            {
                "frictionloss": "Drake's joints have none that is dry; put an ActuatorPlant in front of the plant",
                "delay": "put drake_tc's ActuatorPlant in front of the plant",
                "backlash": "put drake_tc's ActuatorPlant in front of the plant",
            },
            drives=frozenset({"position_servo"}),
            no_motor=_no_motor,
        ),
        "sdf": Vocabulary(
            "SDFormat",
            frozenset({"frictionloss", "torque_limit", "stiffness", "preload"}),
            {
                "armature": "add it to the link's inertia about the axis by hand",
                "delay": _NO_DELAY,
                "backlash": _NO_BACKLASH,
            },
            no_motor=_no_motor,
        ),
        "isaaclab": Vocabulary(
            "Isaac Lab",
            frozenset({"armature", "frictionloss", "torque_limit", "delay", "derivative_gain"}),
            {"backlash": _NO_BACKLASH},
            drives=frozenset({"position_servo"}),
            delay_step=PHYSICS_STEP,
            no_motor=_no_motor_of_isaaclab,
        ),
        "isaaclab-bam": Vocabulary(
            "Isaac Lab (BAM)",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "torque_limit", "delay"}),
            {
                "backlash": "add a hinge for the play to the USD and name it: passive_NAME_backlash of a"
                " BamBacklashActuatorCfg, or the field backlash_joint_template of BamActuatorCfg, whichever your"
                " version of Isaac Lab has"
            },
            drives=frozenset({"voltage"}),
            inexact={
                "load_friction": "its load is that of the last step of the solver",
                "delay": _DELAYED_POSITION,
            },
            delay_step=PHYSICS_STEP,
        ),
        "bam": Vocabulary(
            "BAM",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "delay"}),
            {"backlash": _NO_BACKLASH, "torque_limit": "BAM limits the voltage by the supply"},
            drives=frozenset({"voltage"}),
            inexact={
                "load_friction": "its load consists of gravity and external forces, without the inertia of the link",
                "delay": _DELAYED_POSITION,
            },
        ),
    }
)
"""Name on the command line to vocabulary."""
MJLAB_MOTOR = replace(
    TARGETS["mjlab"],
    terms=TARGETS["mjlab"].terms | {"stribeck", "ripple", "lag"},
    inexact={"torque_limit": "MuJoCo does not apply the limit of a commanded voltage: clip your commands"},
    stribeck_exponent=2.0,
)
"""mjlab's `BuiltinDcMotorActuatorCfg`, which needs a drive on a voltage and its torque constant."""


def vocabulary(target: str, drive: str, torque_constant: float | None) -> Vocabulary:
    """What a target can express of a drive, whose torque constant [N m/A] may be known."""
    if target == "mjlab" and drive == "voltage" and torque_constant is not None:
        return MJLAB_MOTOR
    return TARGETS[target]
