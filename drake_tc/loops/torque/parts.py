"""What a scenario comes to before anything is wired: robot, actuators, gains."""

from dataclasses import replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import models_of_joints
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.parts import ModelFactors
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.spec import base_source
from drake_tc.robot.robot import Robot, load_robot


def loop_robot(scenario: Scenario) -> Robot:
    """The scenario's robot, its base free where it hangs in springs, without joint stops where it says so.

    Raises:
        ParamsError: a file that cannot be read, or a base that floats and is taken to have no angular acceleration.
    """
    robot = load_robot(scenario.path(scenario.robot))
    if scenario.suspension is not None:
        robot = replace(robot, fixed_base=False)
    base_source(scenario, robot)
    if scenario.joint_stops == "none":
        endless = {"lower": -np.inf, "upper": np.inf}
        robot = replace(robot, limits={joint: {**robot.limits.get(joint, {}), **endless} for joint in robot.joints})
    return robot


def actuator_models(scenario: Scenario, robot: Robot, *, controller: bool = False) -> dict[str, ActuatorModel]:
    """The simulated actuators, or those that the controller compensates, joint by joint.

    Raises:
        ParamsError: no model file at all, or one that lacks a joint.
    """
    named = scenario.actuators if not (controller and scenario.model) else scenario.model
    path = robot.actuators if named is None else scenario.path(named)
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
