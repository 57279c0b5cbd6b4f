"""The step of all joints' actuators on arrays (`drake_tc.kernels.actuator`).

One joint's actuator over one step, on plain floats; the law is that of all joints at once (`joint_step`).

The joint's memory is a list of floats, whose places `drake_tc.kernels.joint_layout` names.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.actuation.joint_effects import JointEffects, tables
from drake_tc.kernels import joint_layout as at
from drake_tc.kernels.calls import ADVANCE, MOTORS, SKIPPED, TIME, Kernel, KernelCall
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import FloatArray

_ADVANCE, _MOTORS = Kernel("actuator", "advance"), Kernel("actuator", "motors")
UNCONNECTED = (REFERENCE_CELSIUS, np.nan)
"""Temperature [deg C] and supply voltage [V] of a joint of which neither is known."""


class JointInputs(NamedTuple):
    """Inputs of n joints' actuators.

    Attributes:
        command: (n,).
        state: (2n,) [q; v].
        load: (n,) torque on the link side [N m]; None: what the motion says.
        around: (n,) temperatures [deg C] and supply voltages [V]; None: as `UNCONNECTED`.
    """

    command: FloatArray
    state: FloatArray
    load: FloatArray | None = None
    around: tuple[FloatArray, FloatArray] | None = None


class JointStep:
    """x[n+1], y[n] = F(x[n], u[n]) of n joints; holds no changing data.

    The memory x is that of the joints one behind the other, and the time of the last update.

    Attributes:
        joints: Their effects.
        width: Numbers that `step` gives: 5 outputs a joint, then x[n+1].
    """

    def __init__(self, joints: Sequence[JointEffects]) -> None:
        """Build the tables.

        Args:
            joints: In the order of all arrays, sampled at one period.
        """
        self.joints = tuple(joints)
        self._tables = tables(self.joints)
        layout = self._tables[0]
        self._parts = [
            slice(first, first + joint.size) for first, joint in zip(layout[:, at.FIRST].tolist(), joints, strict=True)
        ]
        n = len(self.joints)
        self._interpreted = [j for j, joint in enumerate(self.joints) if not joint.compiled]
        self._no_work = np.empty((0, at.WORK))
        self._unknown, self._room = np.full(n, np.nan), np.full(n, REFERENCE_CELSIUS)
        self.width = at.OUTPUTS * n + sum(joint.size for joint in self.joints) + 1

    @property
    def parts(self) -> list[slice]:
        """Of the memory, joint by joint."""
        return list(self._parts)

    def initial(self, velocity: Sequence[float]) -> FloatArray:
        """X of joints that have moved at these velocities (n,) for long, or rested [rad/s]."""
        starts = zip(self.joints, velocity, strict=True)
        return np.array([*(value for joint, v in starts for value in joint.initial(v)), -np.inf])

    def step(self, out: FloatArray, kept: FloatArray, inputs: JointInputs, time: float) -> None:
        """One step.

        Args:
            out: (width,) [outputs; x[n+1]], written.
            kept: x[n].
            inputs: u[n].
            time: Now [s].
        """
        now = kept, *self._given(inputs), time
        work = np.empty((len(self.joints), at.WORK)) if self._interpreted else self._no_work
        done = _ADVANCE(now, self._tables, False, work, out)
        if done == at.UNSTARTED:
            now = (self._started(kept, inputs), *now[1:])
            done = _ADVANCE(now, self._tables, False, work, out)
        if done == at.PENDING:
            memory = out[at.OUTPUTS * len(self.joints) :]
            for j in self._interpreted:
                if work[j, at.STATUS]:
                    own = memory[self._parts[j]].tolist()
                    found = self.joints[j].evaluate(own, work[j].tolist(), _around(inputs.around, j))
                    memory[self._parts[j]] = own
                    work[j, at.ASKED :] = found
            _ADVANCE(now, self._tables, True, work, out)

    def _given(self, inputs: JointInputs) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Command, state, load and temperatures as the kernel has them."""
        load = self._unknown if inputs.load is None else inputs.load
        return inputs.command, inputs.state, load, self._room if inputs.around is None else inputs.around[0]

    def bind(self, out: FloatArray, kept: FloatArray, inputs: JointInputs) -> Callable[[float], object]:
        """`step` on arrays that stay the same objects, as a function of the time [s]; arguments as there."""

        def step(time: float) -> None:
            self.step(out, kept, inputs, time)

        if self._interpreted:
            return step
        return KernelCall(ADVANCE, step, kept, *self._given(inputs), TIME, *self._tables, SKIPPED, self._no_work, out)

    def _started(self, kept: FloatArray, inputs: JointInputs) -> FloatArray:
        """X in which all joints have started whose state is finite."""
        kept, n = kept.copy(), len(self.joints)
        command, state, load, _ = self._given(inputs)
        for j, (joint, part) in enumerate(zip(self.joints, self._parts, strict=True)):
            q, v = float(state[j]), float(state[n + j])
            if kept[part.start] == 0.0 and np.isfinite(q) and np.isfinite(v):
                own = kept[part].tolist()
                joint.start(own, float(command[j]), (q, v), float(load[j]), _around(inputs.around, j))
                kept[part] = own
        return kept

    def motors(self, kept: FloatArray, state: FloatArray) -> FloatArray:
        """(3n,) motor angles [rad], speeds [rad/s] over the gear ratio, and torques through the gears [N m].

        Args:
            kept: x at a tick.
            state: (2n,) [q; v] at the same.
        """
        out = np.empty(3 * len(self.joints))
        _MOTORS(kept, state, *self._tables[:2], out)
        return out

    def bind_motors(self, kept: FloatArray, state: FloatArray, out: FloatArray) -> KernelCall:
        """`motors` into `out` (3n,), on arrays that stay the same objects."""

        def motors(time: float) -> None:
            _MOTORS(kept, state, *self._tables[:2], out)

        return KernelCall(MOTORS, motors, kept, state, *self._tables[:2], out)


def _around(around: tuple[FloatArray, FloatArray] | None, joint: int) -> tuple[float, float]:
    """Temperature [deg C] and supply voltage [V] of a joint."""
    return UNCONNECTED if around is None else (float(around[0][joint]), float(around[1][joint]))


class JointOutput(NamedTuple):
    """Torque to the plant, motor and friction torque [N m], commanded effort, 1 when an input was not finite."""

    actuation: float
    motor_torque: float
    friction_torque: float
    effort: float
    fault: float
