"""`ActuatorPlant`: the actuators of all joints as one Drake system in front of a MultibodyPlant.

A motor with voltage drive behind a gear and in front of a spring, as its data sheet has it.

Source: Faraji et al., 2015, section II.A.

    (v - ke N theta') kt N/Rm = tau_co sign(theta') + tau_v theta' + Jm N^2 theta'' + tau,   tau = Ks (theta - q)

theta is the motor's angle over the gear ratio, before the spring; q the link's. An actuator model writes the same as

    v/K = F_c sign(theta') + F_v theta' + J theta'' + tau,   K = Rm/(kt N), F_v = tau_v + ke kt N^2/Rm, J = Jm N^2

so that the back-EMF is part of the viscous friction: what passes the gear tells F_v, never ke and tau_v apart.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from drake_tc.actuation.joint_effects import JointEffects, JointValues, Models, joint_values, model_list
from drake_tc.actuation.joint_step import UNCONNECTED, JointInputs, JointOutput, JointStep
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import copying
from drake_tc.types import Call, FloatArray


class ActuatorPlant(PortMethods, LeafSystem):
    """n geared, driven joints, sampled every `dt`.

    Inputs (vectors, in the order of `models`):
        command (n): q_d [rad], i [A] or V [V], by each joint's drive.
        state (2n): [q; v] of the joints [rad, rad/s].
        temperature (n): [deg C]; 25 when not connected.
        supply_voltage (n): [V], of drives whose strength follows it; their nominal one when not connected.
        load_torque (n): what the gears transmit to the links [N m], for load-dependent friction; when not connected,
            what the motion since the last update says.
    Outputs (n each), all with direct feedthrough of every input:
        actuation: for the MultibodyPlant [N m].
        motor_torque: y*/K [N m].
        friction_torque: dry and viscous [N m], positive against positive motion.
        effort: y, commanded effort of the drive [rad | A | V | N m].
        fault: 1 where the command (the last finite one is held) or the state (no torque) is not finite.
        step (5n + memory): those five of the first joint, of the second, and so on; then x[n+1].
    Outputs at a tick, of the state x[n] and the input `state` alone:
        motor_state (2n): [theta; theta'] over the gear ratio [rad, rad/s]; that of the joint where its gear is stiff.
        transmitted_torque (n): what a gear with a TransmissionEffect passes to the link [N m]; 0 where it is stiff.

    State x: see `drake_tc.kernels.joint_layout`. With F the step of the joints' programs,
        x[n+1], y[n] = F(x[n], u[n]).
    The torque of a tick sees the state of the same tick: the system adds no delay of its own.

    Example:
        >>> knee = ActuatorModel("knee", Drive("current", 0.4))
        >>> ActuatorPlant([knee], dt=1e-3, inertias=0.1).get_command_input_port().size()
        1
    """

    def __init__(self, models: Models, dt: float = 1e-3, inertias: JointValues | None = None) -> None:
        """Declare ports and compile the models.

        Args:
            models: One a joint, in the plant's actuator order or by joint in this order.
            dt: Period of the updates [s]; the plant's step, or a multiple.
            inertias: (n,) or by joint, what each torque moves [kg m^2] (`joint_inertias`), with which friction is held
                implicitly; None takes each model's own inertia. Err on the low side: from half the true value to 1.3 of
                it friction at rest is firm; a fifth, or twice, lets it creep or chatter by some mrad.

        Raises:
            ParamsError: no joint, or dt or an inertia that is not possible.
        """
        super().__init__()
        models = model_list(models)
        if not (np.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: expected a positive period [s], got {dt!r}")
        size = len(models)
        own = [model.inertia for model in models]
        moved = joint_values("inertias", own if inertias is None else inertias, [model.joint for model in models])
        if not np.all(np.isfinite(moved) & (moved >= 0.0)):
            raise ParamsError(f"inertias: expected {size} numbers >= 0 [kg m^2], got {moved.tolist()}")
        self._joints = tuple(model.joint for model in models)
        self._dt = float(dt)
        self._step_of_joints = step = JointStep(
            [JointEffects(model, dt, inertia) for model, inertia in zip(models, moved.tolist(), strict=True)]
        )
        kept = (part.start + np.array(joint.own) for joint, part in zip(step.joints, step.parts, strict=True))
        self._own = np.concatenate(list(kept))
        self._unconnected = tuple(np.full(size, value) for value in UNCONNECTED)

        self._command: Any = self.DeclareVectorInputPort("command", size)
        self._state: Any = self.DeclareVectorInputPort("state", 2 * size)
        self._temperature: Any = self.DeclareVectorInputPort("temperature", size)
        self._supply: Any = self.DeclareVectorInputPort("supply_voltage", size)
        self._load: Any = self.DeclareVectorInputPort("load_torque", size)
        rest: Any = step.initial([0.0] * size)
        memory = self.DeclareDiscreteState(rest)
        self._memory = int(memory)
        everything = {
            self._command.ticket(),
            self._state.ticket(),
            self._temperature.ticket(),
            self._supply.ticket(),
            self._load.ticket(),
            self.discrete_state_ticket(memory),
            self.time_ticket(),
        }
        kinds = len(JointOutput._fields)
        for index, name in enumerate(JointOutput._fields):
            self.DeclareVectorOutputPort(name, size, self._writer(slice(index, kinds * size, kinds)), everything)
        self._after = slice(kinds * size, None)
        self._step: Any = self.DeclareVectorOutputPort("step", step.width, self._solve, everything)
        seen = {self._state.ticket(), self.discrete_state_ticket(memory)}
        self.DeclareVectorOutputPort("motor_state", 2 * size, self._write_motor, seen)
        self.DeclareVectorOutputPort("transmitted_torque", size, self._write_transmitted, seen)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints' names, in the order of every port."""
        return self._joints

    @property
    def actuation_places(self) -> range:
        """Where `actuation` stands in the port `step`."""
        kinds = len(JointOutput._fields)
        return range(JointOutput._fields.index("actuation"), kinds * len(self._joints), kinds)

    @property
    def dt(self) -> float:
        """Period of the updates [s]."""
        return self._dt

    def set_initial_velocity(self, context: Context, velocity: FloatArray) -> None:
        """Wind up the friction of joints that start in motion.

        Args:
            context: This system's context.
            velocity: (n,) [rad/s].
        """
        self.ValidateContext(context)
        start: Any = self._step_of_joints.initial(np.asarray(velocity, float).tolist())
        context.SetDiscreteState(self._memory, start)

    def coordinates(self, context: Context) -> FloatArray:
        """The programs' memories without their bookkeeping, joint by joint (`drake_tc.analysis`)."""
        self.ValidateContext(context)
        memory: FloatArray = np.array(context.get_discrete_state(self._memory).value())
        return np.asarray(memory[self._own])

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make the memories x; started flags, held commands and the time of the last update stay."""
        self.ValidateContext(context)
        memory: Any = np.array(context.get_discrete_state(self._memory).value())
        memory[self._own] = x
        context.SetDiscreteState(self._memory, memory)

    def coordinate_names(self) -> tuple[str, ...]:
        """Of `coordinates`: "joint/state", such as "knee/deflection"."""
        return tuple(
            f"{joint}/{name}"
            for joint, effects in zip(self._joints, self._step_of_joints.joints, strict=True)
            for name in effects.own_names
        )

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        step, n, kinds = self._step_of_joints, len(self._joints), len(JointOutput._fields)
        start = step.initial([0.0] * n)

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, out, before, after = arrays.inputs, arrays.out, arrays.before, arrays.after
            command, state, load, reached = given["command"], given["state"], given.get("load_torque"), out[kinds * n :]
            around = self._around(given.get("temperature"), given.get("supply_voltage"))
            return step.bind(out, before, JointInputs(command, state, load, around)), copying(reached, after)

        ports = {name: np.arange(i, kinds * n, kinds) for i, name in enumerate(JointOutput._fields)}
        reads = frozenset({"command", "state", "temperature", "supply_voltage", "load_torque"})
        ports["step"] = np.arange(step.width)

        def bind_motors(arrays: Arrays) -> tuple[Call, None]:
            return step.bind_motors(arrays.before, arrays.inputs["state"], arrays.out), None

        motors = places({"motor_state": slice(2 * n), "transmitted_torque": slice(2 * n, 3 * n)})
        early = ArrayStage(3 * n, motors, bind_motors, frozenset({"state"}))
        return ArrayStage(step.width, ports, bind, reads, start=start, period=self._dt, early=early)

    def _solve(self, context: Any, vector: Any) -> None:
        """(outputs, x[n+1]) into the port `step`, which all others and the update read."""
        ports = (self._temperature, self._supply)
        around = self._around(*(port.Eval(context) if port.HasValue(context) else None for port in ports))
        load = self._load.Eval(context) if self._load.HasValue(context) else None
        inputs = JointInputs(self._command.Eval(context), self._state.Eval(context), load, around)
        kept = context.get_discrete_state(self._memory).value()
        self._step_of_joints.step(vector.get_mutable_value(), kept, inputs, context.get_time())

    def _around(self, temperature: FloatArray | None, supply: FloatArray | None) -> Any:
        """Both (n,), with nominal values for what is not connected; None where neither is."""
        if temperature is None and supply is None:
            return None
        given = zip((temperature, supply), self._unconnected, strict=True)
        return tuple(nominal if value is None else value for value, nominal in given)

    def _writer(self, part: slice) -> Callable[[Context, Any], None]:
        """The calc function of one output port."""

        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._step.Eval(context)[part])

        return write

    def _motors(self, context: Any) -> FloatArray:
        """(3n,) theta, theta', transmitted torque, at a tick."""
        kept = context.get_discrete_state(self._memory).value()
        return self._step_of_joints.motors(kept, self._state.Eval(context))

    def _write_motor(self, context: Any, vector: Any) -> None:
        vector.set_value(self._motors(context)[: 2 * len(self._joints)])

    def _write_transmitted(self, context: Any, vector: Any) -> None:
        vector.set_value(self._motors(context)[2 * len(self._joints) :])

    def _update(self, context: Context, values: Any) -> None:
        """x[n+1]."""
        values.set_value(self._memory, self._step.Eval(context)[self._after])


LARGEST, SMALLEST = 1e9, 1e-12
"""No number of a motor in SI is as large, and no positive one as small."""
POSITIVE = ("torque_constant", "resistance", "rotor_inertia", "gear_ratio", "stiffness", "voltage_limit")


@dataclass(frozen=True)
class VoltageMotor:
    """Motor, gear and spring of one joint.

    Attributes:
        torque_constant: kt [N m/A], of the motor's shaft.
        back_emf: ke [V s/rad], of the motor's shaft; equal to kt in SI for an ideal motor.
        resistance: Rm [Ohm].
        rotor_inertia: Jm [kg m^2], rotor and wave generator, on the motor's shaft.
        gear_ratio: N [-].
        coulomb: tau_co [N m], on the joint's side.
        viscous: tau_v [N m s/rad], on the joint's side, without the back-EMF.
        stiffness: Ks [N m/rad] of the spring.
        voltage_limit: Largest |v| [V]; infinite for none.

    Raises:
        ParamsError: a value that is not possible.
    """

    torque_constant: float
    back_emf: float
    resistance: float
    rotor_inertia: float
    gear_ratio: float
    coulomb: float
    viscous: float
    stiffness: float
    voltage_limit: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            low = value >= SMALLEST if field.name in POSITIVE else value >= 0.0
            high = value <= LARGEST or (field.name == "voltage_limit" and value == math.inf)
            if not (low and high):
                sign = f"a number from {SMALLEST:g}" if field.name in POSITIVE else "a number from 0"
                sign += f" to {LARGEST:g}"
                raise ParamsError(f"{field.name}: expected {sign}, got {value!r}")

    @property
    def volts_per_torque(self) -> float:
        """K = Rm/(kt N) [V/(N m)]."""
        return self.resistance / (self.torque_constant * self.gear_ratio)

    @property
    def volts_per_speed(self) -> float:
        """Back-EMF of the joint's speed, ke N [V s/rad]."""
        return self.back_emf * self.gear_ratio

    @property
    def inertia(self) -> float:
        """J = Jm N^2 [kg m^2]."""
        return self.rotor_inertia * self.gear_ratio**2

    @property
    def damping(self) -> float:
        """F_v = tau_v + ke kt N^2/Rm [N m s/rad]."""
        return self.viscous + self.volts_per_speed / self.volts_per_torque

    def actuator_model(self, joint: str) -> ActuatorModel:
        """The actuator of the module's docstring, for `ActuatorPlant`."""
        effects = [
            EffectValue("rotor_inertia", {"rotor_inertia": self.inertia}),
            EffectValue("viscous", {"viscous": self.damping}),
            EffectValue("coulomb", {"coulomb": self.coulomb}),
            EffectValue("elasticity", {"compliance": 1.0 / self.stiffness}),
        ]
        if math.isfinite(self.voltage_limit):
            effects.append(EffectValue("saturation", {"limit": self.voltage_limit}))
        return ActuatorModel(joint, Drive("voltage", self.volts_per_torque), tuple(effects))

    def scaled(self, **factors: float) -> "VoltageMotor":
        """The same with fields multiplied: what a controller believes that is wrong by so much.

        Raises:
            ParamsError: no such field, or a result that is not possible.
        """
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        for name, factor in factors.items():
            if name not in values:
                raise ParamsError(f"motor: no field {name!r}; fields: {', '.join(values)}")
            values[name] *= factor
        return VoltageMotor(**values)
