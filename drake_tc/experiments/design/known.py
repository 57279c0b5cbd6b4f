"""What is known of a joint before the next experiment: from its logs, or from its model and rig file alone.

Known masses that are hung on a joint for an experiment: what they change, and how a rig file declares them.

A mass m at an arm r along the link hangs beside what the joint carries already, so that

    tau = (J_l + m r^2) qddot + m_0 g l sin(q - zero) + m g r sin(q - hang) + c

and both hang at the same position where the joint carries a pendulum. Of a joint that slides, a mass adds its inertia
and the share of its weight that acts along the axis, as the load so far shows it: tau = (M + m)(qddot + c/M).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.effects.base import Context, JointNumbers, TorqueEffect
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.check.run import with_loads
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.search import MARGIN
from drake_tc.experiments.fitted import FittedJoint, fitted_joint
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import GRAVITY, FloatArray, IntArray

DECLARED = ("viscous", "coulomb", "rotor_inertia")
NOISE_OF_TORQUE = 0.002
"""Noise of the balance over the largest torque, where no log tells it."""
REWEIGHTED = 30
"""Iterations of the weights of runs in the fit of a load."""
PER_SECOND = 20.0
"""Independent samples a second, where no log tells them."""
LIMIT_NAMES = ("position", "velocity", "acceleration", "jerk", "torque", "bandwidth_hz")


def joint_from_logs(
    rig: Rig, runs: Sequence[Run], joint: str, model: ActuatorModel | None = None
) -> tuple[DesignJoint, JointLimits, FittedJoint]:
    """A joint as its logs show it, the limits that its motions kept so far, and its fit.

    Args:
        rig: Of the logs.
        runs: Read.
        joint: Which.
        model: Numbers in place of those that the logs give; its effects are part of the joint.

    Raises:
        IdentificationError: Runs that cannot identify the declared model.
    """
    loaded, rig_used = with_loads(rig, runs)
    prepared = prepare_joint(loaded, [], rig_used, joint)
    fitted = fitted_joint(prepared)
    numbers = fitted.numbers
    samples = prepared.train.samples
    s, rows = samples.signals, samples.rows
    inertia, gravity, zero, constant = _load(prepared, rig_used, joint)
    declared = tuple(Term(t.effect, t.shape) for t in prepared.terms)
    torque, damping = numbers.torque, servo_damping(rig, joint, numbers.gain)
    if damping > 0.0:
        torque = float(np.max(np.abs(s.effort[rows] / numbers.gain - damping * s.velocity[rows])))
    made = DesignJoint(
        name=joint,
        numbers=numbers,
        context=prepared.context,
        rotor_inertia=s.rotor_inertia,
        link_inertia=inertia,
        gravity=gravity,
        zero=zero,
        constant=constant,
        declared=declared,
        noise=fitted.noise * float(np.sqrt(1.0 + fitted.evidence.noise.ratio)),  # away from rest
        independent_per_second=fitted.per_second,
        slowest=samples.resolution.least_speed,
        floor=fitted.balance.floor,
        resolution=samples.resolution,
        gain_held=prepared.train.declared_gain is not None,
        servo_damping=damping,
        left=fitted.evidence.noise,
        spread=fitted.evidence.spread,
        rig=rig_used,
    )
    made = made if model is None else with_model(made, model)
    low, high = prepared.context.position_span
    limits = JointLimits(
        position=(low, high),
        velocity=float(np.percentile(np.abs(s.velocity[rows]), 99.9)),
        acceleration=float(np.percentile(np.abs(s.acceleration[rows]), 99.9)),
        torque=1.05 * torque,
        units=prepared.context.units,
    )
    return made, limits, fitted


def servo_damping(rig: Rig, joint: str, gain: float) -> float:
    """Damping of a position servo [N m s/rad],  K_0 D/K: its gain 1/K multiplies the damped error."""
    damping = rig.derivative_gain.get(joint)
    return 0.0 if damping is None else rig.drive_gain[joint] * damping / gain


def _load(prepared: Prepared, rig: Rig, joint: str) -> tuple[float, float, float, float]:
    """(J_l, m g l, zero, c) of the load: declared, or least squares of the measured torque."""
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        return load.inertia, load.weight, load.zero, 0.0
    s, rows = prepared.train.samples.signals, prepared.train.samples.rows
    q, tau = s.position[rows], s.load_torque[rows]
    basis = np.column_stack([s.acceleration[rows], np.sin(q), np.cos(q), np.ones(rows.size)])
    slides = prepared.context.units.slides  # gravity does not follow its position
    if slides or np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) > 300.0:  # a small travel tells no gravity
        basis = basis[:, [0, 3]]
        beta = _by_run(basis, tau, prepared.train.samples.run)
        return max(float(beta[0]), 0.0), 0.0, 0.0, float(beta[1])
    inertia, sine, cosine, constant = (float(b) for b in _by_run(basis, tau, prepared.train.samples.run))
    return max(inertia, 0.0), float(np.hypot(sine, cosine)), float(np.arctan2(-cosine, sine)), constant


def _by_run(basis: FloatArray, tau: FloatArray, run: IntArray) -> FloatArray:
    """Least squares (k,) of a load tau (N,) in which each run has the weight of its own residual.

    Pushes by hand are a load too, and no part of the joint's next load: a run that is free of them counts more.
    """
    weight: FloatArray = np.ones(tau.size)
    beta: FloatArray = np.zeros(basis.shape[1])
    for _ in range(REWEIGHTED):
        root = np.sqrt(weight)
        beta = np.asarray(np.linalg.lstsq(root[:, None] * basis, root * tau, rcond=None)[0])
        square = (tau - basis @ beta) ** 2
        mean = np.bincount(run, square) / np.maximum(np.bincount(run), 1)
        weight = 1.0 / np.maximum(mean, 1e-12 * float(np.mean(tau**2)) + 1e-300)[run]
    return beta


def with_model(joint: DesignJoint, model: ActuatorModel) -> DesignJoint:
    """The joint with the numbers and the effects of an actuator model."""
    values = {value.key: value.parameters for value in model.effects}
    numbers = replace(
        joint.numbers,
        gain=model.drive.gain,
        viscous=values.get("viscous", {}).get("viscous", joint.numbers.viscous),
        coulomb=values.get("coulomb", {}).get("coulomb", joint.numbers.coulomb),
    )
    present = tuple((key, dict(each)) for key, each in values.items() if key not in DECLARED)
    rotor = values.get("rotor_inertia", {}).get("rotor_inertia", joint.rotor_inertia)
    added = tuple(
        Term(effect(key), {p.name: each[p.name] for p in (*effect(key).shapes, *effect(key).given_shapes)})
        for key, each in present
        if isinstance(effect(key), TorqueEffect)
    )
    taken = {t.effect.key for t in joint.declared}
    declared = (*joint.declared, *(t for t in added if t.effect.key not in taken))
    return replace(joint, numbers=numbers, rotor_inertia=rotor, present=present, declared=declared)


def joint_from_model(rig: Rig, joint: str, model: ActuatorModel, limits: JointLimits) -> DesignJoint:
    """A joint of which no log exists: its model, a pendulum, and typical noise.

    Raises:
        ParamsError: The rig file does not say what the joint carries.
    """
    load = rig.load[joint]
    if not isinstance(load, Pendulum):
        raise ParamsError(
            f"joint {joint}: without --log the load must be a pendulum whose mass and length the rig file gives; "
            "name the runs recorded so far with --log"
        )
    values = {value.key: value.parameters for value in model.effects}
    rotor = values.get("rotor_inertia", {}).get("rotor_inertia", rig.known(joint, "rotor_inertia"))
    torque = load.weight + (load.inertia + rotor) * limits.acceleration
    numbers = JointNumbers(
        gain=model.drive.gain,
        viscous=values.get("viscous", {}).get("viscous", 0.0),
        coulomb=values.get("coulomb", {}).get("coulomb", 0.0),
        inertia=rotor + load.inertia,
        torque=torque,
        effort=torque * model.drive.gain,
        speed=limits.velocity,
        span=limits.position[1] - limits.position[0],
    )
    effort = torque * model.drive.gain
    context = Context(
        drive=rig.drive[joint],
        load="pendulum",
        recorded=frozenset(),
        declared={"rotor_inertia": rotor} if rotor else {},
        link_inertia=load.inertia,
        hang_angle=load.zero,
        max_speed=limits.velocity,
        position_span=limits.position,
        effort_span=(-effort, effort),
        torque_span=(-torque, torque),
    )
    made = DesignJoint(
        name=joint,
        numbers=numbers,
        context=context,
        rotor_inertia=rotor,
        link_inertia=load.inertia,
        gravity=load.weight,
        zero=load.zero,
        constant=0.0,
        declared=(Term(effect("viscous")), Term(effect("coulomb"))),
        noise=NOISE_OF_TORQUE * torque,
        independent_per_second=PER_SECOND,
        slowest=0.005 * limits.velocity,
        servo_damping=servo_damping(rig, joint, model.drive.gain),
        rig=rig,
    )
    return with_model(made, model)


def limits_with(found: JointLimits | None, given: Mapping[str, Any], joint: str) -> JointLimits:
    """The limits that were given, and for the others those of the logs.

    Raises:
        ParamsError: A limit that neither gives, or limits that are not possible.
    """
    values = {name: given[name] for name in LIMIT_NAMES if given.get(name) is not None}
    if found is not None:
        return replace(found, **values)
    missing = [name for name in ("position", "velocity", "acceleration") if name not in values]
    if missing:
        raise ParamsError(
            f"joint {joint}: no limit for {', '.join(missing)}; give --{missing[0]}, or --log RUN, whose motions are "
            "then the limits"
        )
    return JointLimits(**values)


MOST_LOADS = 6
"""Loads among which a design chooses."""
SHOWN = 0.05
"""Share of the joint's largest torque from which on its gravity shows where its link hangs."""
KINDS = ("torque", "pendulum")
"""Kinds of load beside which a rig file can have known masses: a diagnosis then knows the load of every log."""


@dataclass(frozen=True)
class KnownLoad:
    """A mass that the user hangs on the joint.

    Attributes:
        mass: [kg]; 0 for the joint as it is.
        arm: Distance of its centre from the axis [m]; 0 for a joint that slides.
        hangs: Position at which it hangs straight down [rad]; None for that of the link.
    """

    mass: float
    arm: float = 0.0
    hangs: float | None = None

    @property
    def text(self) -> str:
        """As on the command line."""
        parts = [self.mass, *([self.arm] if self.arm else []), *([] if self.hangs is None else [self.hangs])]
        return "@".join(f"{part:g}" for part in parts)

    @property
    def words(self) -> str:
        """In a sentence."""
        if not self.mass:
            return "no added mass"
        return f"{self.mass:g} kg at {self.arm:g} m" if self.arm else f"{self.mass:g} kg"


def parse_loads(texts: Sequence[str]) -> tuple[KnownLoad, ...]:
    """The loads of the command line: MASS@ARM or MASS@ARM@ANGLE [kg, m, rad], MASS of a joint that slides, or 0.

    Raises:
        ParamsError: Another text, a mass or an arm that is not positive, a load twice, none beside 0, or too many.
    """
    loads = tuple(_parsed(text) for text in texts)
    twice = next((load for i, load in enumerate(loads) if load in loads[:i]), None)
    if twice is not None:
        raise ParamsError(f"--load {twice.text}: named twice")
    if loads and not any(load.mass for load in loads):
        raise ParamsError("--load 0: expected at least one load beside 0, such as --load 0 --load 1.5@0.3")
    if len(loads) > MOST_LOADS:
        raise ParamsError(f"--load: expected at most {MOST_LOADS} loads, got {len(loads)}")
    return loads


def _parsed(text: str) -> KnownLoad:
    expected = "expected MASS@ARM in kg and m, such as 1.5@0.3, MASS of a prismatic joint, or 0"
    try:
        values = [float(part) for part in text.split("@")]
    except ValueError:
        raise ParamsError(f"--load {text}: {expected}") from None
    if not all(map(math.isfinite, values)) or len(values) > 3:
        raise ParamsError(f"--load {text}: {expected}")
    if values[0] < 0.0:
        raise ParamsError(f"--load {text}: expected a mass of at least 0 kg, got {values[0]:g}")
    if len(values) > 1 and not values[1] > 0.0:
        raise ParamsError(f"--load {text}: expected an arm above 0 m, got {values[1]:g}")
    return KnownLoad(*values) if values[0] else KnownLoad(0.0)


def require_usable(joint: DesignJoint, loads: Sequence[KnownLoad], limits: JointLimits) -> None:
    """Refuse loads that a diagnosis of this joint could not know, or that the limits do not let it hold.

    Raises:
        ParamsError: One line.
    """
    units, kind, slides = limits.units, joint.context.load, joint.context.joint_type == "prismatic"
    if kind not in KINDS:
        raise ParamsError(
            f"--load: joint {joint.name}: a diagnosis knows the added mass of a log only where the rig file has load: "
            f"torque or load: {{pendulum: ...}}, and this joint has load: {kind}; declare one of them"
        )
    for load in loads:
        if load.mass and slides and load.arm:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name} is prismatic; expected MASS in kg without an arm"
            )
        if load.mass and not slides and not load.arm:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: the arm is missing; expected MASS@ARM in kg and m, such as "
                f"{load.mass:g}@0.3"
            )
        if load.hangs is not None and kind == "pendulum" and abs(load.hangs - joint.zero) > 1e-6:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: the rig file has one zero for all logs, where its pendulum "
                f"hangs: {joint.zero:.3g} rad; expected a mass that hangs there too"
            )
        needed = carrying(joint, load).largest_load(*limits.position) + joint.numbers.coulomb
        if needed > limits.with_margin(MARGIN).torque:
            unit, at = units.text("N m"), units.position
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: holding this load within {limits.position[0]:.3g} to "
                f"{limits.position[1]:.3g} {at} and overcoming friction needs {needed:.3g} {unit}, and the torque "
                f"limit is {limits.torque:.3g} {unit}; hang less, narrow --position, or give the torque limit of the "
                "motor with --torque"
            )


def hang_angle(joint: DesignJoint, load: KnownLoad) -> float:
    """Position at which an added mass hangs straight down [rad]: where the link hangs, 0 where that is not known."""
    if load.hangs is not None:
        return load.hangs
    known = joint.context.load == "pendulum" or joint.gravity > SHOWN * joint.numbers.torque
    return joint.zero if known else 0.0


def carrying(joint: DesignJoint, load: KnownLoad) -> DesignJoint:
    """The joint with an added mass; noise, friction and the sizes of effects stay."""
    if not load.mass:
        return joint
    if joint.context.joint_type == "prismatic":
        along = np.clip(joint.constant / joint.link_inertia, -GRAVITY, GRAVITY) if joint.link_inertia > 0.0 else 0.0
        more = joint.constant + load.mass * float(along)
        return replace(joint, link_inertia=joint.link_inertia + load.mass, constant=more)
    weight = load.mass * GRAVITY * load.arm
    both = joint.gravity * np.exp(1j * joint.zero) + weight * np.exp(1j * hang_angle(joint, load))
    return replace(
        joint,
        link_inertia=joint.link_inertia + load.mass * load.arm**2,
        gravity=float(abs(both)),
        zero=float(np.angle(both)),
    )


def trial_load(joint: DesignJoint) -> KnownLoad | None:
    """A load that doubles the joint's torque, to try whether known loads would help; None where none can be used."""
    if joint.context.load not in KINDS:
        return None
    torque = max(joint.numbers.torque, 1e-6)
    if joint.context.joint_type == "prismatic":
        return KnownLoad(torque / GRAVITY)
    return KnownLoad(torque / (GRAVITY * 0.3), 0.3)


def declaring(rig: Rig, joint: str, loads: Sequence[tuple[str, KnownLoad]]) -> Rig | None:
    """The rig with the masses of further logs; None where it stays as it is, because a sensor measures the load.

    Args:
        rig: Of the logs so far, whose masses it keeps.
        joint: Which.
        loads: (pattern of the logs' names, load).
    """
    base = rig.load[joint]
    if not isinstance(base, Pendulum):
        return None
    first = replace(base, by_run=())
    runs = [(pattern, _together(first, load)) for pattern, load in loads]
    runs += list(base.by_run) or [("*", first)]
    return replace(rig, load={**rig.load, joint: replace(runs[0][1], by_run=tuple(runs))})


def _together(pendulum: Pendulum, load: KnownLoad) -> Pendulum:
    """A pendulum with a mass added, to six digits."""
    mass = pendulum.mass + load.mass
    length = (pendulum.mass * pendulum.length + load.mass * load.arm) / mass
    inertia = pendulum.inertia + load.mass * load.arm**2
    mass, length, inertia = (float(f"{value:.6g}") for value in (mass, length, inertia))
    return Pendulum(mass, length, inertia, pendulum.zero)
