"""`ActuatorPlant`: the actuators of all joints as one Drake system in front of a MultibodyPlant."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from drake_tc.actuation.joint_program import JointOutput, JointProgram
from drake_tc.actuation.joint_values import JointValues, Models, joint_values, model_list
from drake_tc.actuation.spring_joints import spring_joints
from drake_tc.effects.thermal_friction import REFERENCE_CELSIUS
from drake_tc.errors import ParamsError
from drake_tc.port_methods import PortMethods
from drake_tc.types import FloatArray


def _array(values: list[float]) -> Any:
    """An array for pydrake, whose stubs refuse numpy's own type."""
    return np.array(values)


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
        effort: y, asked of the drive [rad | A | V | N m].
        fault: 1 where the command (the last finite one is held) or the state (no torque) is not finite.
        step (5n + memory): those five of the first joint, of the second, and so on; then x[n+1].
    Outputs at a tick, of the state x[n] and the input `state` alone:
        motor_state (2n): [theta; theta'] over the gear ratio [rad, rad/s]; that of the joint where its gear is stiff.
        transmitted_torque (n): what a gear with a TransmissionEffect passes to the link [N m]; 0 where it is stiff.

    State x: see `drake_tc.actuation.joint_program`. With F the step of the joints' programs,
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
        self._programs = tuple(
            JointProgram(model, dt, inertia) for model, inertia in zip(models, moved.tolist(), strict=True)
        )
        bounds = np.cumsum([0, *(program.size for program in self._programs)]).tolist()
        slices = (slice(a, b) for a, b in pairwise(bounds))
        self._steps = tuple((program.run, part) for program, part in zip(self._programs, slices, strict=True))
        kept = (first + np.array(program.own) for first, program in zip(bounds, self._programs, strict=False))
        self._own = np.concatenate(list(kept))
        self._springs = spring_joints(models, moved.tolist(), self._dt)
        self._no_load = (None,) * size
        self._room = (REFERENCE_CELSIUS,) * size
        self._nominal = (np.nan,) * size

        self._command: Any = self.DeclareVectorInputPort("command", size)
        self._state: Any = self.DeclareVectorInputPort("state", 2 * size)
        self._temperature: Any = self.DeclareVectorInputPort("temperature", size)
        self._supply: Any = self.DeclareVectorInputPort("supply_voltage", size)
        self._load: Any = self.DeclareVectorInputPort("load_torque", size)
        rest = [value for program in self._programs for value in program.initial()]
        memory = self.DeclareDiscreteState(_array([*rest, -np.inf]))
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
        self._step: Any = self.DeclareVectorOutputPort("step", kinds * size + len(rest) + 1, self._solve, everything)
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
        starts = zip(self._programs, np.asarray(velocity, float).tolist(), strict=True)
        memory = [value for program, v in starts for value in program.initial(v)]
        context.SetDiscreteState(self._memory, _array([*memory, -np.inf]))

    def coordinates(self, context: Context) -> FloatArray:
        """The programs' memories without their bookkeeping, joint by joint (`drake_tc.analysis`)."""
        memory: FloatArray = np.array(context.get_discrete_state(self._memory).value())
        return np.asarray(memory[self._own])

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make the memories x; started flags, held commands and the time of the last update stay."""
        memory: Any = np.array(context.get_discrete_state(self._memory).value())
        memory[self._own] = x
        context.SetDiscreteState(self._memory, memory)

    def coordinate_names(self) -> tuple[str, ...]:
        """Of `coordinates`: "joint/state", such as "knee/deflection"."""
        return tuple(
            f"{joint}/{name}"
            for joint, program in zip(self._joints, self._programs, strict=True)
            for name in program.own_names
        )

    def _solve(self, context: Any, vector: Any) -> None:
        """(outputs, x[n+1]) into the port `step`, which all others and the update read."""
        kept: FloatArray = context.get_discrete_state(self._memory).value()
        command, moving = self._command.Eval(context), self._state.Eval(context)
        time, size = context.get_time(), len(self._steps)
        at_tick = time - kept[-1] > 0.99 * self._dt
        if self._springs is not None:
            memory_now, q_now, v_now = kept[:-1].reshape(size, -1), moving[:size], moving[size:]
            answer = self._springs.step(memory_now, command, q_now, v_now, at_tick=at_tick)
            if answer is not None:
                vector.set_value(np.concatenate((answer[0].ravel(), answer[1].ravel(), [time])))
                return
        held: list[float] = kept.tolist()
        state = moving.tolist()
        joints = zip(
            self._steps,
            command.tolist(),
            state[:size],
            state[size:],
            self._load.Eval(context).tolist() if self._load.HasValue(context) else self._no_load,
            self._temperature.Eval(context).tolist() if self._temperature.HasValue(context) else self._room,
            self._supply.Eval(context).tolist() if self._supply.HasValue(context) else self._nominal,
            strict=True,
        )
        memory: list[float] = []
        outputs: list[float] = []
        for (run, part), asked, q, v, load, celsius, supply in joints:
            own = held[part]
            outputs += run(own, asked, q, v, load, celsius, supply, at_tick=at_tick)
            memory += own
        vector.set_value(_array([*outputs, *memory, time]))

    def _writer(self, part: slice) -> Callable[[Context, Any], None]:
        """The calc function of one output port."""

        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._step.Eval(context)[part])

        return write

    def _motor(self, context: Any) -> FloatArray:
        """(3, n): theta, theta', transmitted torque of each joint, at a tick."""
        held: list[float] = context.get_discrete_state(self._memory).value().tolist()
        state, size = self._state.Eval(context).tolist(), len(self._programs)
        joints = zip(self._programs, self._steps, state[:size], state[size:], strict=True)
        return np.array([program.motor(held[part], q, v) for program, (_, part), q, v in joints]).T

    def _write_motor(self, context: Any, vector: Any) -> None:
        if self._springs is not None:
            memory: FloatArray = context.get_discrete_state(self._memory).value()
            found = self._springs.motor_state(memory[:-1].reshape(len(self._steps), -1))
            if found is not None:
                vector.set_value(found)
                return
        vector.set_value(self._motor(context)[:2].ravel())

    def _write_transmitted(self, context: Any, vector: Any) -> None:
        if self._springs is not None:
            memory: FloatArray = context.get_discrete_state(self._memory).value()
            moving, size = self._state.Eval(context), len(self._steps)
            found = self._springs.transmitted(memory[:-1].reshape(size, -1), moving[:size], moving[size:])
            if found is not None:
                vector.set_value(found)
                return
        vector.set_value(self._motor(context)[2])

    def _update(self, context: Context, values: Any) -> None:
        """x[n+1]."""
        values.set_value(self._memory, self._step.Eval(context)[self._after])
