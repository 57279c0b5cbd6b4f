"""What a scenario comes to before anything is wired: robot, actuators, gains.

`LoopDesign`: what a torque loop is wired from, of a scenario or of a diagram of the user's own.

`sliding_scenario`: its drives in sliding, where friction is linear, which is what a linear analysis takes.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import models_of_joints, save_models
from drake_tc.actuation.wiring import sliding
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.parts import ModelFactors
from drake_tc.loops.torque.references import posture
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, base_source
from drake_tc.robot.link_changes import link_changes
from drake_tc.robot.plant import check_joint_types
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.types import FloatArray


def loop_robot(scenario: Scenario, *, controller: bool = False) -> Robot:
    """The scenario's robot, its base free where it hangs in springs, without joint stops where it says so.

    Masses and payloads of links that `close-loop` found are those of the actuators' model file: the simulated one, or
    the controller's.

    Raises:
        ParamsError: a file that cannot be read, or a base that floats and is taken to have no angular acceleration.
    """
    robot = load_robot(scenario.path(scenario.robot))
    named = model_file(scenario, controller=controller)
    if named is not None:
        robot = replace(robot, changes=link_changes(named))
    if scenario.suspension is not None:
        robot = replace(robot, fixed_base=False)
    base_source(scenario, robot)
    if scenario.joint_stops == "none":
        endless = {"lower": -np.inf, "upper": np.inf}
        robot = replace(robot, limits={joint: {**robot.limits.get(joint, {}), **endless} for joint in robot.joints})
    return robot


def model_file(scenario: Scenario, *, controller: bool) -> Path | None:
    """The model file that the scenario names for plant or controller; None: that of the robot file."""
    named = scenario.actuators if not (controller and scenario.model) else scenario.model
    return None if named is None else scenario.path(named)


def actuator_models(scenario: Scenario, robot: Robot, *, controller: bool = False) -> dict[str, ActuatorModel]:
    """The simulated actuators, or those that the controller compensates, joint by joint.

    Raises:
        ParamsError: no model file at all, or one that lacks a joint.
    """
    path = model_file(scenario, controller=controller) or robot.actuators
    if path is None:
        raise ParamsError(f"{robot.source}: expected `actuators`, here or in the scenario, got neither")
    chosen = models_of_joints(path, robot.joints)
    return (
        {joint: _mistaken(model, scenario.model_factors) for joint, model in chosen.items()} if controller else chosen
    )


def _mistaken(model: ActuatorModel, factors: ModelFactors) -> ActuatorModel:
    """A drive's model with K_tau and K_v = K_tau x viscous multiplied."""
    if factors == ModelFactors():
        return model

    def scaled(value: EffectValue) -> EffectValue:
        if value.key != "viscous":
            return value
        return EffectValue("viscous", {"viscous": value.parameters["viscous"] * factors.k_v / factors.k_tau})

    drive = replace(model.drive, gain=model.drive.gain * factors.k_tau)
    return replace(model, drive=drive, effects=tuple(scaled(value) for value in model.effects))


def torque_gains(scenario: Scenario, robot: Robot) -> TorqueGains:
    """The scenario's gains in the parametrisation of the torque loop: Ks = K6/(K (1 + Kp)), Kd = K7/(K (1 + Kp)).

    Raises:
        ParamsError: a gain that is not possible, or a joint that the robot does not have.
    """
    spec = scenario.gains
    k6, k7, kp, ki = (np.array(spec.of(name, robot.joints)) for name in ("k6", "k7", "kp", "ki"))
    kf = np.tile(np.broadcast_to(np.asarray(spec.kf, dtype=np.float64), 6), len(robot.force_torque))
    return TorqueGains.from_servo(actuator_models(scenario, robot, controller=True), k6, k7, kp, ki=ki, kf=kf)


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopDesign:
    """What a torque loop is wired from.

    Attributes:
        robot: What the controller takes the robot for.
        plant_robot: The simulated one.
        spec: How the loop is controlled.
        actuators: (n) models of the simulated drives, in the order of the robot's joints.
        models: (n) what the controller takes the drives for.
        gains: Feedback gains.
        posture: (n,) where the motion rests [rad].

    Example:
        >>> scenario = TORQUE_LOOP.scenario("brisk_swing")
        >>> LoopDesign.of_scenario(scenario).gains.size
        6
    """

    robot: Robot
    plant_robot: Robot
    spec: TorqueLoopSpec
    actuators: tuple[ActuatorModel, ...]
    models: tuple[ActuatorModel, ...]
    gains: TorqueGains
    posture: FloatArray

    def __post_init__(self) -> None:
        n, sensors = len(self.robot.joints), len(self.robot.force_torque)
        if self.gains.size != n:
            raise ParamsError(f"gains: expected {n}, one per joint, got {self.gains.size}")
        if self.gains.kf.size and self.gains.kf.shape[0] != 6 * sensors:
            raise ParamsError(f"gains.kf: expected {6 * sensors} rows, six per F/T sensor, got {len(self.gains.kf)}")
        check_joint_types(self.robot, (*self.models, *self.actuators))

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> "LoopDesign":
        """A scenario's.

        Raises:
            ParamsError: a file that cannot be read, or a joint or gain that is not possible.
        """
        robot = loop_robot(scenario, controller=True)
        return cls(
            robot=robot,
            plant_robot=loop_robot(scenario),
            spec=scenario,
            actuators=tuple(actuator_models(scenario, robot).values()),
            models=tuple(actuator_models(scenario, robot, controller=True).values()),
            gains=torque_gains(scenario, robot),
            posture=posture(scenario.motion, robot),
        )


def sliding_scenario(scenario: Scenario, folder: Path, direction: float = 0.0) -> Scenario:
    """The scenario with drives, true and assumed, that hold only what is linear in sliding.

    The inverse of a dead zone in the controller's model is constant there as the dead zone itself is.

    Args:
        scenario: Whose drives.
        folder: Takes the two model files; must exist for as long as the scenario is used.
        direction: Of the sliding, 1 or -1; 0 takes the mean gain of drives that switch with it.

    Raises:
        ParamsError: drives that cannot be read.
    """
    plain = replace(scenario, model_factors=ModelFactors())

    def saved(name: str, *, controller: bool) -> str:
        robot = loop_robot(scenario, controller=controller)
        models = actuator_models(plain, robot, controller=controller)
        path = str((folder / f"sliding_{name}.yaml").resolve())
        save_models(sliding(models, direction), path, shared=robot.changes.causes, links=robot.changes.fitted)
        return path

    return replace(scenario, actuators=saved("actuators", controller=False), model=saved("model", controller=True))
