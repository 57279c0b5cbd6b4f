"""One joint's actuator, compiled into a row of tables (`drake_tc.kernels.joint_layout`) and, for what these cannot say,
functions on plain floats: the first tick, and effects without a compiled equation.

Motor and link on the two sides of a gear with play or softness, over one step.

The two sides are stepped together, finer than the plant, the link by its own inertia and by the load that its last
step showed; the plant then gets the *mean* torque that passed the gear. Neither a stiff contact nor an impact
inside the step can then make the plant unstable.

    J omega' = thrust - friction - tau,      M v' = tau - load,      tau = (deadband(theta - q, b/2) + t_d d/dt(.))/c

t_d gives the closed gear a damping ratio of `CONTACT_DAMPING`; a closed gear never pulls across its gap.

Arguments of several joints: models and numbers, by joint or in order.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from drake_tc.actuation.model import ActuatorModel, split_parts, term_tables
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings, EquationKernel, TorqueKernel
from drake_tc.errors import ParamsError
from drake_tc.kernels import joint_layout as at
from drake_tc.kernels.equations import gear_torque
from drake_tc.types import FloatArray

CONTACT_DAMPING = 0.05
"""Damping ratio of the two inertias on the closed gear."""
RESOLUTION = 0.25
"""Largest product of the sub-step and the closed gear's angular frequency."""
MOST_SUB_STEPS = 40
"""A gear that would need more is taken to be as soft as these can follow."""


@dataclass(frozen=True)
class Gear:
    """Two inertias with a gap and a spring between them; see the module.

    Attributes:
        half_gap: b/2 [rad].
        compliance: c [rad/(N m)].
        motor_inertia: J [kg m^2].
        link_inertia: M [kg m^2].
        contact_time: t_d [s].
        sub_step: [s].
        sub_steps: Number of them in one step.
    """

    half_gap: float
    compliance: float
    motor_inertia: float
    link_inertia: float
    contact_time: float
    sub_step: float
    sub_steps: int

    def twist(self, torque: float) -> float:
        """Lead of the motor [rad] when the gear passes `torque` [N m] at rest."""
        return torque * self.compliance + (math.copysign(self.half_gap, torque) if torque else 0.0)

    def torque(self, twist: float, rate: float) -> float:
        """What the gear passes [N m] when the motor leads by `twist` [rad] and gains on the link by `rate` [rad/s]."""
        return gear_torque(twist, rate, self.half_gap, self.compliance, self.contact_time)


def gear_of(model: ActuatorModel, link_inertia: float, period: float) -> Gear | None:
    """The gear of a model with TransmissionEffects (gaps and compliances in series), or None without.

    Raises:
        ParamsError: motor or link has no inertia.
    """
    parts = [effect.transmission(parameters) for effect, parameters in model.transmission_effects]
    if not parts:
        return None
    if model.inertia <= 0.0 or link_inertia <= 0.0:
        side = "rotor_inertia > 0 in the model" if model.inertia <= 0.0 else "a link with inertia > 0"
        names = ", ".join(effect.key for effect, _ in model.transmission_effects)
        raise ParamsError(f"joint {model.joint!r}: {names} needs {side}: the motor moves apart from the link")
    compliance = sum(part.compliance for part in parts)
    reduced = model.inertia * link_inertia / (model.inertia + link_inertia)
    compliance = max(compliance, (period / (MOST_SUB_STEPS * RESOLUTION)) ** 2 / reduced)
    frequency = 1.0 / math.sqrt(compliance * reduced)
    sub_steps = max(1, math.ceil(period * frequency / RESOLUTION - 1e-9))
    return Gear(
        half_gap=sum(part.half_gap for part in parts),
        compliance=compliance,
        motor_inertia=model.inertia,
        link_inertia=link_inertia,
        contact_time=2.0 * CONTACT_DAMPING / frequency,
        sub_step=period / sub_steps,
        sub_steps=sub_steps,
    )


_NAMES = (
    "started",
    "deflection",
    "position",
    "velocity",
    "torque",
    "load",
    "command",
    "motor_position",
    "motor_velocity",
)
_DRIVE_NUMBERS = 3


class Row(NamedTuple):
    """A joint's part of the tables, see `drake_tc.kernels.actuator.advance`; places count from the joint's first."""

    layout: list[int]
    numbers: list[float]
    drives: list[tuple[int, int]]
    parameters: list[list[float]]
    terms: list[tuple[EquationKernel, int]]
    travels: list[float]


class JointEffects:
    """A model of one joint, sampled every `period` [s]; holds no changing data.

    Attributes:
        size: How many floats of memory the joint needs.
        compiled: Whether every effect has a compiled equation.
    """

    def __init__(self, model: ActuatorModel, period: float, inertia: float) -> None:
        """Compile.

        Args:
            model: The joint's actuator.
            period: Time between updates [s].
            inertia: What the torque to the plant moves [kg m^2], reflected rotor inertia included unless the model has
                a TransmissionEffect; 0 when not known.
        """
        self._period, self._inertia, self._rotor = period, inertia, model.inertia
        self._servo = model.drive.kind == "position_servo"
        self._per_effort = 1.0 / model.drive.gain
        self._gear: Gear | None = gear_of(model, inertia, period)
        place = at.MOTOR_VELOCITY + 1 if self._gear else at.MOTOR
        self._hysteretic = place
        self._constant, changing = split_parts(model)
        self._terms: list[tuple[EquationKernel, int]] = []
        self._closures: list[tuple[TorqueKernel, int]] = []
        self._travels: list[float] = []
        for kernel, travel in changing:
            state = place if travel > 0.0 else -1
            if isinstance(kernel, EquationKernel):
                self._terms.append((kernel, state))
            else:
                self._closures.append((kernel, state))
            if travel > 0.0:
                self._travels.append(travel)
                place += 1
        self._command: list[tuple[DriveKernel, int]] = []
        self._effort: list[tuple[DriveKernel, int]] = []
        acting: dict[str, list[str]] = {"command": [], "effort": []}
        for drive, parameters in model.drive_effects:
            on_command = drive.acts_on == "command"
            acting["command" if on_command else "effort"].append(drive.key)
            of_drive = drive.kernel(parameters, period)
            (self._command if on_command else self._effort).append((of_drive, place))
            place += of_drive.size
        self._drive_ids = (*acting["command"], *acting["effort"])
        self.size = place
        both = (*self._command, *self._effort)
        self.compiled = not self._closures and all(of_drive.kind != at.INTERPRETED for of_drive, _ in both)

    @property
    def own(self) -> list[int]:
        """Places in the memory that are state at a tick: not the flag, nor what is computed anew or only held."""
        return [place for place in range(self.size) if place not in (at.STARTED, at.LOAD, at.COMMAND)]

    @property
    def own_names(self) -> tuple[str, ...]:
        """Of the states in `own`, such as "deflection" of the friction's bristle or "current_lag[0]" of a drive."""
        named = dict(enumerate(_NAMES))
        named |= {self._hysteretic + i: f"hysteresis[{i}]" for i in range(len(self._travels))}
        for effect, (kernel, place) in zip(self._drive_ids, self._command + self._effort, strict=True):
            named |= {place + i: f"{effect}[{i}]" for i in range(kernel.size)}
        return tuple(named[place] for place in self.own)

    def initial(self, velocity: float = 0.0) -> list[float]:
        """Memory of a joint that has moved at `velocity` [rad/s] for long, or rested for 0."""
        memory = [0.0] * self.size
        direction = math.copysign(1.0, velocity) if velocity else 0.0
        memory[at.DEFLECTION] = direction
        for i in range(len(self._travels)):
            memory[self._hysteretic + i] = direction
        return memory

    def row(self) -> Row:
        """The joint's part of the tables."""
        both = [*self._command, *self._effort]
        end = self._hysteretic + len(self._travels)
        flags = [int(self._gear is not None), int(self.compiled), int(self._servo)]
        gear = self._gear
        of_gear = [0.0] * 7
        if gear is not None:
            of_gear = [gear.half_gap, gear.compliance, gear.contact_time, gear.motor_inertia, gear.link_inertia]
            of_gear += [gear.sub_step, float(gear.sub_steps)]
        travels = [0.0] * self.size
        travels[self._hysteretic : end] = self._travels
        padded = [[*kernel.numbers, *[0.0] * (_DRIVE_NUMBERS - len(kernel.numbers))] for kernel, _ in both]
        return Row(
            [0, *flags, self._hysteretic, end, 0, len(self._command), len(both), 0, len(self._terms)],
            [self._period, self._inertia, self._rotor, self._per_effort, *self._constant, *of_gear],
            [(kernel.kind, place) for kernel, place in both],
            padded,
            self._terms,
            travels,
        )

    def start(
        self,
        memory: list[float],
        command: float,
        motion: tuple[float, float],
        tau: float,
        around: tuple[float, float],
    ) -> None:
        """First tick: a drive that has always seen this command, a joint whose load is the one given, or nil.

        Args:
            memory: The joint's; updated.
            command: Where it is not finite, a servo is taken to hold its position, another drive to rest.
            motion: q [rad], v [rad/s].
            tau: Load [N m], NaN where it is not known.
            around: Temperature [deg C] and supply voltage [V].
        """
        q, v = motion
        target = command if math.isfinite(command) else q if self._servo else 0.0
        memory[at.STARTED], memory[at.COMMAND] = at.JUST_STARTED, target
        memory[at.POSITION], memory[at.VELOCITY] = q, v
        memory[at.LOAD] = 0.0 if math.isnan(tau) else tau
        drive_q = q
        if self._gear is not None:
            drive_q = q + self._gear.twist(memory[at.LOAD])
            memory[at.MOTOR], memory[at.MOTOR_VELOCITY] = drive_q, v
        for kernel, place in self._command:
            memory[place : place + kernel.size] = kernel.start(target, target)
        value = raw = target - drive_q if self._servo else target
        for kernel, place in self._effort:
            memory[place : place + kernel.size] = kernel.start(value, raw)
            if kernel.observe is not None:
                kernel.observe(DriveSurroundings(drive_q, v, *around), memory, place)
            value = kernel.step(value, raw, memory[at.DEFLECTION], list(memory), place)

    def evaluate(self, memory: list[float], work: Sequence[float], around: tuple[float, float]) -> tuple[float, ...]:
        """The drive and all effects at a tick, for a joint that is not `compiled`.

        Args:
            memory: The joint's; updated.
            work: Its row, as the first call has left it, with the parts of the torque effects that are compiled.
            around: Temperature [deg C] and supply voltage [V].

        Returns:
            Commanded effort, effective effort, level, damping and rest, as they go into `work`.
        """
        q, v, tau, command = work[at.DRIVE_POSITION], work[at.DRIVE_VELOCITY], work[at.LOAD_TORQUE], work[at.ACTED]
        seen = DriveSurroundings(q, v, *around)
        for kernel, place in (*self._command, *self._effort):
            if kernel.observe is not None:
                kernel.observe(seen, memory, place)
        direction = memory[at.DEFLECTION]
        target = command
        for kernel, place in self._command:
            target = kernel.step(target, command, direction, memory, place)
        asked, effort = (command - q, target - q) if self._servo else (command, target)
        for kernel, place in self._effort:
            effort = kernel.step(effort, asked, direction, memory, place)
        level, damping, rest = work[at.NOW_LEVEL :]
        for torque, place in self._closures:
            a, b, c = torque(q, v, direction, tau, around[0], memory[place] if place >= 0 else 0.0)
            level, damping, rest = level + a, damping + b, rest + c
        return asked, effort, level, damping, rest


def tables(joints: Sequence[JointEffects]) -> tuple[np.ndarray, ...]:
    """layout, numbers, drives, parameters, terms, values and travels of joints one behind the other."""
    rows = [joint.row() for joint in joints]
    first = drive = term = 0
    layouts, drives, terms = [], [], []
    for joint, row in zip(joints, rows, strict=True):
        layout = np.array(row.layout, dtype=np.int64)
        layout[[at.FIRST, at.HYSTERETIC, at.HYSTERETIC_END]] += first
        layout[[at.DRIVES, at.EFFORT_DRIVES, at.DRIVES_END]] += drive
        layout[[at.TERMS, at.TERMS_END]] += term
        layouts.append(layout)
        drives += [(kind, first + place) for kind, place in row.drives]
        terms += [(kernel, first + place if place >= 0 else -1) for kernel, place in row.terms]
        first, drive, term = first + joint.size, drive + len(row.drives), term + len(row.terms)
    return (
        np.array(layouts, dtype=np.int64),
        np.array([row.numbers for row in rows]),
        np.array(drives, dtype=np.int64).reshape(-1, 2),
        np.array([numbers for row in rows for numbers in row.parameters]).reshape(-1, _DRIVE_NUMBERS),
        *term_tables(terms),
        np.array([travel for row in rows for travel in row.travels]),
    )


Models: TypeAlias = Mapping[str, ActuatorModel] | Sequence[ActuatorModel]
"""Actuator models by joint, as `load_models` returns them, or in the order of the joints."""
JointValues: TypeAlias = float | Sequence[float] | FloatArray | Mapping[str, float]
"""One number for all joints, one for each in order, or a mapping by joint."""


def model_list(models: Models, joints: Sequence[str] | None = None) -> tuple[ActuatorModel, ...]:
    """The models in the order of the joints.

    Args:
        models: By joint, or in order.
        joints: Order of a mapping; None takes the mapping's own.

    Raises:
        ParamsError: no model, something that is none, a mapping without one of the joints, or a list of the joints'
            models in another order.
    """
    if not len(models):
        raise ParamsError("models is empty; expected one actuator model per joint")
    if isinstance(models, Mapping):
        missing = [joint for joint in joints or () if joint not in models]
        if missing:
            raise ParamsError(f"models: no model of joint {missing[0]!r}; joints there: {', '.join(models)}")
        listed = tuple(models[joint] for joint in (models if joints is None else joints))
    else:
        listed = tuple(models)
        if joints is not None and len(listed) != len(joints):
            raise ParamsError(f"models: expected {len(joints)}, one per joint, got {len(listed)}")
    for model in listed:
        if not isinstance(model, ActuatorModel):
            raise ParamsError(f"models: expected actuator models, by joint or in a list, got {model!r}")
    order = [model.joint for model in listed]
    if joints is not None and order != list(joints) and sorted(order) == sorted(joints):
        raise ParamsError(f"models: expected the order {', '.join(joints)}, got a list in the order {', '.join(order)}")
    return listed


def models_by_joint(models: Models) -> dict[str, ActuatorModel]:
    """The models by joint.

    Raises:
        ParamsError: as `model_list`; or two models of one joint.
    """
    if isinstance(models, Mapping):
        model_list(models)
        return dict(models)
    listed = model_list(models)
    by_joint = {model.joint: model for model in listed}
    if len(by_joint) < len(listed):
        raise ParamsError(f"models: expected one model per joint, got joints {', '.join(m.joint for m in listed)}")
    return by_joint


def joint_values(name: str, values: JointValues, joints: Sequence[str]) -> FloatArray:
    """(n,) numbers in the order of the joints; their range is checked by the caller.

    Args:
        name: Of the argument, for messages.
        values: One number for all joints, one for each in order, or a mapping by joint.
        joints: n names.

    Raises:
        ParamsError: another count, an unknown joint or one that is missing, or something that is no number.
    """
    if isinstance(values, Mapping):
        unknown = [joint for joint in values if joint not in joints]
        missing = [joint for joint in joints if joint not in values]
        if unknown or missing:
            problem = f"no joint {unknown[0]!r}" if unknown else f"no value of joint {missing[0]!r}"
            raise ParamsError(f"{name}: {problem}; joints: {', '.join(joints)}")
        values = [values[joint] for joint in joints]
    try:
        given = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParamsError(f"{name}: expected a number or {len(joints)} of them, got {values!r}") from None
    if given.shape not in ((), (len(joints),)):
        raise ParamsError(f"{name}: expected a number or {len(joints)} of them, got shape {given.shape}")
    return np.broadcast_to(given, (len(joints),)).copy()
