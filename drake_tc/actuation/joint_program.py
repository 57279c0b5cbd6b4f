"""One joint's actuator over one step: its effects compiled into a function on plain floats.

The joint's memory is a slice of one list of floats, so that the system beside it can keep it in the Context:

    0 started   1 z   2 q   3 v   4 torque to the plant   5 load   6 command   [7 theta   8 omega]   hysteresis   drives

q, v, torque: at the last update; load: all that resisted the joint in the step before it, as far as its motion told.
"""

import math
from math import isfinite, nan
from typing import NamedTuple

from drake_tc.actuation.constant_parts import CONSTANT, split_parts
from drake_tc.actuation.friction import PRESLIDING_DISPLACEMENT, friction_law
from drake_tc.actuation.gear import Gear, gear_of
from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.kernel import DriveKernel, TorqueKernel

STARTED, DEFLECTION, POSITION, VELOCITY, TORQUE, LOAD, COMMAND, MOTOR, MOTOR_VELOCITY = range(9)
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


class JointInput(NamedTuple):
    """What one joint sees at a tick: command, position, velocity, load torque or None, temperature [deg C], supply [V].

    A supply voltage of NaN or 0 counts as the drive's nominal one.
    """

    command: float
    position: float
    velocity: float
    load_torque: float | None
    temperature: float
    supply_voltage: float = nan


class JointOutput(NamedTuple):
    """Torque to the plant, motor and friction torque [N m], effort asked for, 1 when an input was not finite."""

    actuation: float
    motor_torque: float
    friction_torque: float
    effort: float
    fault: float


class JointProgram:
    """A model of one joint, sampled every `period` [s]; holds no changing data.

    Attributes:
        size: How many floats of memory the joint needs.
    """

    def __init__(self, model: ActuatorModel, period: float, inertia: float) -> None:
        """Compile.

        Args:
            model: The joint's actuator.
            period: Time between updates [s].
            inertia: What the torque to the plant moves [kg m^2], reflected rotor inertia included unless the model has
                a TransmissionEffect; 0 when not known.
        """
        self._period = period
        self._inertia = inertia
        self._rotor = model.inertia
        self._servo = model.drive.kind == "position_servo"
        self._per_effort = 1.0 / model.drive.gain
        self._gear: Gear | None = gear_of(model, inertia, period)
        self._friction = friction_law(inertia, period)
        at = MOTOR_VELOCITY + 1 if self._gear else MOTOR
        self._constant, _ = split_parts(model)
        self._torque: list[tuple[TorqueKernel, int]] = []
        self._hysteresis: list[tuple[int, float]] = []
        for effect, parameters in model.torque_effects:
            if type(effect) in CONSTANT:
                continue
            travel = effect.hysteresis_travel(parameters)
            self._torque.append((effect.kernel(parameters), at if travel > 0.0 else -1))
            if travel > 0.0:
                self._hysteresis.append((at, travel))
                at += 1
        self._command_kernels: list[tuple[DriveKernel, int]] = []
        self._effort_kernels: list[tuple[DriveKernel, int]] = []
        acting: dict[str, list[str]] = {"command": [], "effort": []}
        for drive, parameters in model.drive_effects:
            acting["command" if drive.acts_on == "command" else "effort"].append(drive.key)
            kernel = drive.kernel(parameters, period)
            chain = self._command_kernels if drive.acts_on == "command" else self._effort_kernels
            chain.append((kernel, at))
            at += kernel.size
        self._drive_ids = (*acting["command"], *acting["effort"])
        self._command = tuple((kernel.step, place) for kernel, place in self._command_kernels)
        self._effort = tuple((kernel.step, place) for kernel, place in self._effort_kernels)
        both = (*self._command_kernels, *self._effort_kernels)
        self._observe = tuple((kernel.observe, place) for kernel, place in both if kernel.observe is not None)
        self.size = at

    @property
    def own(self) -> list[int]:
        """Places in the memory that are state at a tick: not the flag, nor what is computed anew or only held."""
        return [at for at in range(self.size) if at not in (STARTED, LOAD, COMMAND)]

    @property
    def own_names(self) -> tuple[str, ...]:
        """Of the states in `own`, such as "deflection" of the friction's bristle or "current_lag[0]" of a drive."""
        named = dict(enumerate(_NAMES))
        named |= {at: f"hysteresis[{i}]" for i, (at, _) in enumerate(self._hysteresis)}
        for effect, (kernel, at) in zip(self._drive_ids, self._command_kernels + self._effort_kernels, strict=True):
            named |= {at + i: f"{effect}[{i}]" for i in range(kernel.size)}
        return tuple(named[at] for at in self.own)

    def initial(self, velocity: float = 0.0) -> list[float]:
        """Memory of a joint that has moved at `velocity` [rad/s] for long, or rested for 0."""
        memory = [0.0] * self.size
        direction = math.copysign(1.0, velocity) if velocity else 0.0
        memory[DEFLECTION] = direction
        for at, _ in self._hysteresis:
            memory[at] = direction
        return memory

    def motor(self, memory: list[float], q: float, v: float) -> tuple[float, float, float]:
        """Motor angle and speed over the gear ratio, and the torque through the gear, at a tick.

        Args:
            memory: The joint's memory at the tick.
            q: Of the link [rad].
            v: Of the link [rad/s].
        """
        if self._gear is None or not memory[STARTED]:
            return q, v, 0.0
        theta, omega = memory[MOTOR], memory[MOTOR_VELOCITY]
        return theta, omega, self._gear.torque(theta - q, omega - v)

    def step(self, memory: list[float], now: JointInput, *, at_tick: bool) -> JointOutput:
        """The torques from this tick to the next; `memory` becomes that of the next tick.

        Args:
            memory: The joint's memory, overwritten.
            now: The joint at this tick.
            at_tick: Whether a period has passed since the last update; between ticks the load is not re-estimated.
        """
        return JointOutput(*self.run(memory, *now, at_tick=at_tick))

    def run(
        self,
        memory: list[float],
        command: float,
        q: float,
        v: float,
        tau: float | None,
        celsius: float,
        supply: float = nan,
        *,
        at_tick: bool,
    ) -> tuple[float, float, float, float, float]:
        """`step` on the fields of a JointInput, to those of a JointOutput: nothing is packed on the way."""
        fault = 0.0
        if not isfinite(command + q + v):
            if not (isfinite(q) and isfinite(v)):
                return 0.0, 0.0, 0.0, 0.0, 1.0
            if not isfinite(command):
                fault, command = 1.0, (memory[COMMAND] if memory[STARTED] else (q if self._servo else 0.0))
        gear = self._gear
        if not memory[STARTED]:
            self._start(memory, command, (q, v), tau, (celsius, supply))
        elif at_tick:
            slowed = (v - memory[VELOCITY]) / self._period
            memory[LOAD] = memory[TORQUE] - self._inertia * slowed
            if tau is None and gear is None:
                tau = memory[TORQUE] - self._rotor * slowed
        if gear is not None:
            drive_q, drive_v = memory[MOTOR], memory[MOTOR_VELOCITY]
            if tau is None:
                tau = memory[TORQUE]
        else:
            drive_q, drive_v = q, v
            moved = q - memory[POSITION]
            z = memory[DEFLECTION] + moved / PRESLIDING_DISPLACEMENT
            memory[DEFLECTION] = -1.0 if z < -1.0 else (1.0 if z > 1.0 else z)
            if moved and self._hysteresis:
                self._turn_over(memory, moved)
            if tau is None:
                tau = memory[LOAD]
        for observe, at in self._observe:
            observe(drive_v, celsius, supply, memory, at)
        direction = memory[DEFLECTION]
        target = command
        for step, at in self._command:
            target = step(target, command, direction, memory, at)
        if self._servo:
            asked = command - drive_q
            effort = target - drive_q
        else:
            asked, effort = command, target
        for step, at in self._effort:
            effort = step(effort, asked, direction, memory, at)
        motor = effort * self._per_effort
        level, damping, rest = self._constant
        for torque, at in self._torque:
            a, b, c = torque(drive_q, drive_v, direction, tau, celsius, memory[at] if at >= 0 else 0.0)
            level += a
            damping += b
            rest += c
        level = level if level > 0.0 else 0.0
        damping = damping if damping > 0.0 else 0.0
        if gear is not None:
            out, friction = self._geared(gear, memory, q, v, (motor - rest, level, damping))
        else:
            _, _, friction = self._friction(direction, v, motor - rest - memory[LOAD], level, damping)
            out = motor - rest - friction
        memory[POSITION], memory[VELOCITY], memory[TORQUE], memory[COMMAND] = q, v, out, command
        return out, motor, friction, asked, fault

    def _start(
        self,
        memory: list[float],
        command: float,
        motion: tuple[float, float],
        tau: float | None,
        around: tuple[float, float],
    ) -> None:
        """First tick: a drive that has always seen this command, a joint whose load is the one given, or nil."""
        memory[STARTED] = 1.0
        q, v = motion
        memory[POSITION], memory[VELOCITY] = q, v
        memory[LOAD] = tau or 0.0
        if self._gear is not None:
            memory[MOTOR], memory[MOTOR_VELOCITY] = q + self._gear.twist(memory[LOAD]), v
        target = command
        for kernel, at in self._command_kernels:
            memory[at : at + kernel.size] = kernel.start(target, target)
        drive_q = memory[MOTOR] if self._gear is not None else q
        value = target - drive_q if self._servo else target
        raw = value
        for kernel, at in self._effort_kernels:
            memory[at : at + kernel.size] = kernel.start(value, raw)
            if kernel.observe is not None:
                kernel.observe(v, *around, memory, at)
            value = kernel.step(value, raw, memory[DEFLECTION], list(memory), at)

    def _turn_over(self, memory: list[float], moved: float) -> None:
        """Carry the hysteretic states over a motion of `moved` [rad] that has happened."""
        sign = math.copysign(1.0, moved)
        for at, travel in self._hysteresis:
            memory[at] = sign - (sign - memory[at]) * math.exp(-abs(moved) / travel)

    def _geared(
        self, gear: Gear, memory: list[float], q: float, v: float, drive: tuple[float, float, float]
    ) -> tuple[float, float]:
        """Motor and link over one step: mean torque to the link, mean friction torque."""
        motor = (memory[MOTOR], memory[MOTOR_VELOCITY], memory[DEFLECTION])
        theta, omega, z, passed, friction = gear.step(motor, (q, v, memory[LOAD]), drive)
        moved = theta - motor[0]
        if moved and self._hysteresis:
            self._turn_over(memory, moved)
        memory[MOTOR], memory[MOTOR_VELOCITY], memory[DEFLECTION] = theta, omega, z
        return passed, friction
