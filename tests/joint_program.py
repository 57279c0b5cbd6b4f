"""One joint's actuator tick by tick on plain numbers, as tests need it."""

from math import inf, nan
from typing import NamedTuple

import numpy as np

from drake_tc.actuation.joint_effects import JointEffects
from drake_tc.actuation.joint_step import JointInputs, JointOutput, JointStep
from drake_tc.actuation.model import ActuatorModel
from drake_tc.kernels.joint_layout import OUTPUTS


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


class JointProgram:
    """A model of one joint, sampled every `period` [s]; holds no changing data.

    Attributes:
        size: How many floats of memory the joint needs.
        effects: What the model comes to.
    """

    def __init__(self, model: ActuatorModel, period: float, inertia: float) -> None:
        """Compile; arguments as `JointEffects`."""
        self.effects = JointEffects(model, period, inertia)
        self.size = self.effects.size
        self._step = JointStep([self.effects])

    def initial(self, velocity: float = 0.0) -> list[float]:
        """Memory of a joint that has moved at `velocity` [rad/s] for long, or rested for 0."""
        return self.effects.initial(velocity)

    def motor(self, memory: list[float], q: float, v: float) -> tuple[float, float, float]:
        """Motor angle and speed over the gear ratio, and the torque through the gear, at a tick.

        Args:
            memory: The joint's memory at the tick.
            q: Of the link [rad].
            v: Of the link [rad/s].
        """
        theta, omega, torque = self._step.motors(np.array(memory), np.array([q, v])).tolist()
        return theta, omega, torque

    def step(self, memory: list[float], now: JointInput, *, at_tick: bool) -> JointOutput:
        """The torques from this tick to the next; `memory` becomes that of the next tick.

        Args:
            memory: The joint's memory, overwritten.
            now: The joint at this tick.
            at_tick: Whether a period has passed since the last update; between ticks the load is not re-estimated.
        """
        out = np.empty(self._step.width)
        load = None if now.load_torque is None else np.array([now.load_torque])
        around = np.array([now.temperature]), np.array([now.supply_voltage])
        kept, state = np.array([*memory, -inf if at_tick else 0.0]), np.array([now.position, now.velocity])
        self._step.step(out, kept, JointInputs(np.array([now.command]), state, load, around), 0.0)
        memory[:] = out[OUTPUTS:-1].tolist()
        return JointOutput(*out[:OUTPUTS].tolist())
