"""`ActuatorPlant`: the actuators of all joints as one Drake system in front of a MultibodyPlant."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    InputPort,
    LeafSystem,
    OutputPort,
    ValueProducer,
)

from drake_tc.actuation.joint_program import JointInput, JointOutput, JointProgram
from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.thermal_friction import REFERENCE_CELSIUS
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

OUTPUTS: Mapping[str, str] = {
    "actuation": "actuation",
    "motor_torque": "motor_torque",
    "friction_torque": "friction_torque",
    "effort": "effort",
    "fault": "fault",
}


class ActuatorPlant(LeafSystem):  # type: ignore[misc]
    """n geared, driven joints, sampled every `dt`.

    Inputs (vectors, in the order of `models`):
        command (n): q_d [rad], i [A] or V [V], by each joint's drive.
        state (2n): [q; v] of the joints [rad, rad/s].
        temperature (n): [deg C]; 25 when not connected.
        load_torque (n): what the gears transmit to the links [N m], for load-dependent friction; when not connected,
            what the motion since the last update says.
    Outputs (n each), all with direct feedthrough of every input:
        actuation: for the MultibodyPlant [N m].
        motor_torque: y*/K [N m].
        friction_torque: dry and viscous [N m], positive against positive motion.
        effort: y, asked of the drive [rad | A | V].
        fault: 1 where the command (the last finite one is held) or the state (no torque) is not finite.

    State x: see `drake_tc.actuation.joint_program`. With F the step of the joints' programs,
        x[n+1], y[n] = F(x[n], u[n]).
    The torque of a tick sees the state of the same tick: the system adds no delay of its own.
    """

    def __init__(self, models: Sequence[ActuatorModel], dt: float = 1e-3, inertias: FloatArray | None = None) -> None:
        """Declare ports and compile the models.

        Args:
            models: One a joint, in the plant's actuator order.
            dt: Period of the updates [s]; the plant's step, or a multiple.
            inertias: (n,) what each torque moves [kg m^2] (`joint_inertias`), with which friction is held implicitly; None
                takes each model's own inertia.

        Raises:
            ParamsError: no joint, or dt or an inertia that is not possible.
        """
        super().__init__()
        if not models:
            raise ParamsError("models: wanted one a joint; got none")
        if not (np.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"dt: wanted a positive period [s]; got {dt!r}")
        size = len(models)
        moved = np.array([model.inertia for model in models]) if inertias is None else np.asarray(inertias, float)
        if moved.shape != (size,) or not np.all(np.isfinite(moved) & (moved >= 0.0)):
            raise ParamsError(f"inertias: wanted {size} numbers >= 0 [kg m^2]; got {moved.tolist()}")
        self._joints = tuple(model.joint for model in models)
        self._dt = float(dt)
        self._programs = tuple(
            JointProgram(model, dt, inertia) for model, inertia in zip(models, moved.tolist(), strict=True)
        )
        bounds = np.cumsum([0, *(program.size for program in self._programs)]).tolist()
        self._slices = tuple(slice(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True))
        self._no_load = (None,) * size
        self._room = (REFERENCE_CELSIUS,) * size

        self._command: InputPort = self.DeclareVectorInputPort("command", size)
        self._state: InputPort = self.DeclareVectorInputPort("state", 2 * size)
        self._temperature: InputPort = self.DeclareVectorInputPort("temperature", size)
        self._load: InputPort = self.DeclareVectorInputPort("load_torque", size)
        rest = [value for program in self._programs for value in program.initial()]
        self._memory = self.DeclareDiscreteState([*rest, -np.inf])
        everything = {
            self._command.ticket(),
            self._state.ticket(),
            self._temperature.ticket(),
            self._load.ticket(),
            self.discrete_state_ticket(self._memory),
            self.time_ticket(),
        }
        self._solution = self.DeclareCacheEntry(
            "solution", ValueProducer(allocate=Value(()).Clone, calc=self._solve), everything
        )
        for index, name in enumerate(JointOutput._fields):
            self.DeclareVectorOutputPort(name, size, self._writer(index), {self._solution.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)
