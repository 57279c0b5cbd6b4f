"""The drives under the controller: torque control of geared joints without torque sensors (Del Prete et al., 2016).

torque --> torque_control --> guard --> actuators --> plant
^ torque estimate           (position servos, friction, dead zones)

`TorqueNoise`: torques that err, e ~ N(0, Sigma), drawn anew every `period`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.framework import DiscreteValues, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import models_of_joints
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard, GuardSpec, rated_guard
from drake_tc.control.torque_control import TorqueControl
from drake_tc.errors import ParamsError
from drake_tc.loops.loop_builder import behind, product
from drake_tc.loops.scenarios import SEEDS
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, estimated_torque, required_models
from drake_tc.loops.whole_body.series_elastic_drives import check_springs
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import Readings
from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.types import FloatArray


def known_drives(scenario: TsidScenario) -> Path | None:
    """The model file that the scenario names for the controller of geared drives; None: that of the robot file."""
    spec = scenario.drives
    named = (spec.model or spec.actuators) if scenario.torque == "drives" else None
    return None if named is None else scenario.path(named)


def drive_models(scenario: TsidScenario, robot: Robot, *, controller: bool = False) -> dict[str, ActuatorModel] | None:
    """The simulated drives, or those that the torque control compensates, by joint; None where torques act directly.

    Raises:
        ParamsError: no model file at all, or one that lacks a joint, or a spring with `torque: series_elastic`.
    """
    if scenario.torque == "direct":
        return None
    named = (scenario.drives if scenario.torque == "drives" else scenario.series_elastic).actuators
    path = robot.actuators if named is None else scenario.path(named)
    path = (known_drives(scenario) or path) if controller else path
    if path is None:
        where = "drives" if scenario.torque == "drives" else "series_elastic"
        raise ParamsError(f"{robot.source}: expected `actuators`, here or in the scenario's {where}, got none")
    models = models_of_joints(path, robot.joints)
    if scenario.torque == "series_elastic":
        check_springs(models, str(path))
    return models


def control_drives(wiring: WholeBodyBuilder, readings: Readings, torque: OutputPort, state: OutputPort) -> OutputPort:
    """Torque control and guard between the controller's torque and the drives; the command of the drives.

    Args:
        wiring: Of the diagram.
        readings: Of the sensors.
        torque: What is desired of the joints.
        state: What the controller knows of the robot.
    """
    law, n = wiring.law, wiring.law.model.n
    spec, limits = wiring.scenario.drives, joint_limits(law.model.robot)
    assumed = required_models(wiring, "controller_models")
    models = [assumed[joint] for joint in law.model.robot.joints]
    encoder = readings.encoder
    known = estimated_torque(wiring, readings)
    nothing: Any = np.zeros(6 * n)
    terms = behind(wiring.builder, "no_terms", ConstantVectorSource(nothing))
    gains = TorqueGains(np.full(n, spec.kp), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((0, 0)))
    inputs: Mapping[str, OutputPort] = {
        "desired_torque": torque,
        "torque_terms": terms,
        "estimated_torque": known["estimated_torque"],
        "joint_estimate": known["joint_estimate"],
        "position": encoder,
    }
    if spec.compensation.needs_reference:
        inputs = {**inputs, "reference": _desired_motion(wiring, state)}
    wiring.add(
        "torque_control",
        lambda: TorqueControl(models, gains, limits.effort, law.period, spec.compensation),
        **inputs,
    )
    servo = tuple(model.drive.kind == "position_servo" for model in models)
    start = GuardSpec(start_time=spec.start_time, start_rate=2.0)
    start = rated_guard(start, models, limits.effort, limits.velocity)
    command = wiring.output("torque_control", "command")
    wiring.add(
        "guard",
        lambda: CommandGuard(n, law.period, start, servo),
        command=command,
        position=encoder,
        fault=known["fault"],
    )
    sent = wiring.output("guard", "command")
    wiring.signals |= {"estimated_torque": known["estimated_torque"], "command": sent}
    return sent


def _desired_motion(wiring: WholeBodyBuilder, state: OutputPort) -> OutputPort:
    """(3n) [q; qdot + qddot period/2; qddot] to which the controller's accelerations lead, half a period ahead."""
    model, n = wiring.law.model, wiring.law.model.n
    known = wiring.join("known_motion", [state, wiring.output("tsid", "acceleration")])  # [q; v; vdot]
    matrix, first = np.zeros((3, n, known.size())), model.nq + model.nv
    joints = np.arange(n)
    matrix[0, joints, model.positions] = matrix[1, joints, model.nq + model.actuated] = 1.0
    matrix[1, joints, first + model.actuated] = 0.5 * wiring.law.period
    matrix[2, joints, first + model.actuated] = 1.0
    return product(wiring.builder, "desired_motion", matrix.reshape(3 * n, -1), known)


class TorqueNoise(LeafSystem):
    """A torque error e = scale L zeta, zeta ~ N(0, I), L L^T = Sigma; held for `period`.

    Output:
        torque_error (n): e[k] [N m]; follows the state alone.
    State: e (n), k.  e[k], zeta[k] a function of (seed, k): the stream is counter-based, so it has no memory.
    """

    def __init__(self, error: TorqueError, period: float, seed: int, scale: float = 1.0) -> None:
        """Declare the port.

        Args:
            error: Sigma.
            period: How long a draw lasts [s].
            seed: Of the draws, from 0 to 2^64 - 1.
            scale: On e.

        Raises:
            ParamsError: a period that is not positive, or a seed that is not possible.
        """
        super().__init__()
        if not (np.isfinite(period) and period > 0.0):
            raise ParamsError(f"torque noise: expected a positive period [s], got {period!r}")
        if not 0 <= seed < SEEDS:
            raise ParamsError(f"torque noise: expected a seed from 0 to 2^64 - 1, got {seed}")
        self._root, self._seed = scale * error.root, seed
        first: Any = self._draw(0)
        now = self.DeclareDiscreteState(first)
        zero: Any = np.zeros(1)
        count = self.DeclareDiscreteState(zero)
        self._now, self._count = int(now), int(count)
        self.DeclareStateOutputPort("torque_error", now)
        self.DeclarePeriodicDiscreteUpdateEvent(period, period, self._update)

    def _draw(self, tick: int) -> FloatArray:
        """e[k]."""
        key = np.array([self._seed, tick], dtype=np.uint64)
        zeta = np.random.Generator(np.random.Philox(key=key)).standard_normal(self._root.shape[1])
        return np.asarray(self._root.dot(zeta))

    def _update(self, context: Any, values: DiscreteValues) -> None:
        """The next e."""
        new: Any = values
        tick = int(context.get_discrete_state(self._count).value()[0]) + 1
        new.set_value(self._now, self._draw(tick))
        new.set_value(self._count, np.array([float(tick)]))
