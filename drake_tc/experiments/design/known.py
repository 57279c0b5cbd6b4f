"""What is known of a joint before the next experiment: from its logs, or from its model and rig file alone."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.effects.base import Context, JointNumbers, TorqueEffect
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.check.run import with_loads
from drake_tc.experiments.design.joint import PER_SECOND, DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.fitted import FittedJoint, fitted_joint
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray, IntArray

DECLARED = ("viscous", "coulomb", "rotor_inertia")
"""Effects of the declared model, each with the one parameter of the same name."""
NOISE_OF_TORQUE = 0.002
"""Noise of the balance over the largest torque, where no log tells it."""
REWEIGHTED = 30
"""Iterations of the weights of runs in the fit of a load."""
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
    fitted, samples = fitted_joint(prepared), prepared.train.samples
    numbers, s, rows = fitted.numbers, samples.signals, samples.rows
    inertia, gravity, zero, constant = _load(prepared, rig_used, joint)
    made = DesignJoint(
        name=joint,
        numbers=numbers,
        context=prepared.context,
        rotor_inertia=s.rotor_inertia,
        link_inertia=inertia,
        gravity=gravity,
        zero=zero,
        constant=constant,
        declared=tuple(Term(t.effect, t.shape) for t in prepared.terms),
        noise=fitted.noise * float(np.sqrt(1.0 + fitted.evidence.noise.ratio)),  # away from rest
        independent_per_second=fitted.per_second,
        slowest=samples.resolution.least_speed,
        floor=fitted.balance.floor,
        resolution=samples.resolution,
        gain_held=prepared.train.declared_gain is not None,
        servo_damping=servo_damping(rig, joint, numbers.gain),
        left=fitted.evidence.noise,
        spread=fitted.evidence.spread,
        rig=rig_used,
    )
    torque = numbers.torque
    if made.servo_damping > 0.0:
        torque = float(np.max(np.abs(s.effort[rows] / numbers.gain - made.servo_damping * s.velocity[rows])))
    speed, acceleration = (float(np.percentile(np.abs(x[rows]), 99.9)) for x in (s.velocity, s.acceleration))
    units = prepared.context.units
    limits = JointLimits(prepared.context.position_span, speed, acceleration, torque=1.05 * torque, units=units)
    return made if model is None else with_model(made, model), limits, fitted


def servo_damping(rig: Rig, joint: str, gain: float) -> float:
    """Damping of a position servo [N m s/rad],  K_0 D/K: its gain 1/K multiplies the damped error."""
    damping = rig.derivative_gain.get(joint)
    return 0.0 if damping is None else rig.drive_gain[joint] * damping / gain


def _load(prepared: Prepared, rig: Rig, joint: str) -> tuple[float, float, float, float]:
    """(J_l, m g l, zero, c) of the load: declared, or least squares of the measured torque."""
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        return load.inertia, load.weight, load.zero, 0.0
    samples = prepared.train.samples
    s, rows = samples.signals, samples.rows
    q, tau = s.position[rows], s.load_torque[rows]
    basis = np.column_stack([s.acceleration[rows], np.sin(q), np.cos(q), np.ones(rows.size)])
    small = np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) > 300.0  # such a travel tells no gravity
    shown = [0, 3] if small or prepared.context.units.slides else [0, 1, 2, 3]
    beta = np.zeros(4)
    beta[shown] = _by_run(basis[:, shown], tau, samples.run)
    inertia, sine, cosine, constant = beta.tolist()
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
    declared = _declared(model)
    rotor = declared.pop("rotor_inertia", joint.rotor_inertia)
    numbers = replace(joint.numbers, gain=model.drive.gain, **declared)
    present = tuple((value.key, dict(value.parameters)) for value in model.effects if value.key not in DECLARED)
    added = tuple(
        Term(effect(key), {p.name: each[p.name] for p in (*effect(key).shapes, *effect(key).given_shapes)})
        for key, each in present
        if isinstance(effect(key), TorqueEffect)
    )
    taken = {t.effect.key for t in joint.declared}
    terms = (*joint.declared, *(t for t in added if t.effect.key not in taken))
    return replace(joint, numbers=numbers, rotor_inertia=rotor, present=present, declared=terms)


def _declared(model: ActuatorModel) -> dict[str, float]:
    """Those of the numbers of the declared model that an actuator model has."""
    return {value.key: value.parameters[value.key] for value in model.effects if value.key in DECLARED}


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
    rotor = _declared(model).get("rotor_inertia", rig.known(joint, "rotor_inertia"))
    torque = load.weight + (load.inertia + rotor) * limits.acceleration
    effort = torque * model.drive.gain
    low, high = limits.position
    inertia, speed = rotor + load.inertia, limits.velocity
    context = Context(
        drive=rig.drive[joint],
        load="pendulum",
        recorded=frozenset(),
        declared={"rotor_inertia": rotor} if rotor else {},
        link_inertia=load.inertia,
        hang_angle=load.zero,
        max_speed=speed,
        position_span=limits.position,
        effort_span=(-effort, effort),
        torque_span=(-torque, torque),
    )
    made = DesignJoint(
        name=joint,
        numbers=JointNumbers(model.drive.gain, 0.0, 0.0, inertia, torque, effort, speed, high - low),
        context=context,
        rotor_inertia=rotor,
        link_inertia=load.inertia,
        gravity=load.weight,
        zero=load.zero,
        constant=0.0,
        declared=(Term(effect("viscous")), Term(effect("coulomb"))),
        noise=NOISE_OF_TORQUE * torque,
        independent_per_second=PER_SECOND,
        slowest=0.005 * speed,
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
