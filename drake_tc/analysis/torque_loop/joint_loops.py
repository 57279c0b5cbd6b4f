"""A scenario's joints as closed-form loops, each by itself while the others stand still (`JointLoop`)."""

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.actuation.model import ActuatorModel
from drake_tc.analysis.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.parts import actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.references import posture
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.robot.joint_axis import joint_axes
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot

GRAVITY = 9.81
"""[m/s^2]; Drake's own."""


def joint_loops(scenario: Scenario, direction: float = 0.0) -> dict[str, JointLoop]:
    """The loop of every joint, in sliding at the scenario's posture.

    In sliding, dry friction is constant and a dead zone is passed, so neither enters; a velocity-sign switch s makes
    the drive's gain K_tau/(1 + s direction). Of the other effects viscous friction and rotor inertia are taken.

    Args:
        scenario: In torque control on estimated torques, without predictor and observer.
        direction: Of the sliding: 1, -1, or 0 for the mean of both.

    Raises:
        ParamsError: another loop, a scenario that cannot be built, or numbers that make no loop.
    """
    _check_loop(scenario)
    robot = loop_robot(scenario)
    true = actuator_models(scenario, robot)
    model = actuator_models(scenario, robot, controller=True)
    gains = torque_gains(scenario, robot)
    spec, filters = scenario.compensation, scenario.filters
    loops = {}
    for i, (joint, weights) in enumerate(_weights(robot, scenario).items()):
        (k_tau, k_v), (k_tau_model, k_v_model) = _drive(true[joint], direction), _drive(model[joint], direction)
        loops[joint] = JointLoop(
            inertia=weights["link_inertia"] + true[joint].inertia,
            k_tau=k_tau,
            k_v=k_v,
            k_tau_model=k_tau_model,
            k_v_model=k_v_model,
            window=filters.window,
            order=filters.encoder_order,
            inertial_order=filters.inertial_order,
            dt=scenario.dt,
            kp=float(gains.kp[i]),
            ki=float(gains.ki[i]),
            ks=float(gains.ks[i]),
            kd=float(gains.kd[i]),
            kf=float(gains.kf[0, 0]) if gains.kf.size else 0.0,
            gravity_at=scenario.configuration,
            velocity_from=spec.velocity,
            rotor_model=0.0 if spec.acceleration == "none" else model[joint].inertia,
            **weights,
        )
    return loops


def _check_loop(scenario: Scenario) -> None:
    """Refuse what `JointLoop` does not have."""
    expected = {"controller": "torque", "torque_from": "estimate", "predictor": None, "observer": None}
    others = [name for name, value in expected.items() if getattr(scenario, name) != value]
    if others:
        raise ParamsError(
            "joint loops: expected a scenario in torque control (`controller: torque`, `torque_from: estimate`)"
            f" without predictor and observer; it differs in {', '.join(others)}"
        )


def _drive(model: ActuatorModel, direction: float) -> tuple[float, float]:
    """(K_tau, K_v) in sliding."""
    values = {value.key: value.parameters for value in model.effects}
    switch = values.get("velocity_sign_switch", {}).get("switch", 0.0)
    gain = model.drive.gain / (1.0 + switch * direction)
    return gain, gain * values.get("viscous", {}).get("viscous", 0.0)


def _weights(robot: Robot, scenario: Scenario) -> dict[str, dict[str, Any]]:
    """Joint to inertia and gravity stiffness of what it moves, and of what lies beyond the F/T sensor."""
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    for name, position in zip(robot.joints, posture(scenario.motion, robot), strict=True):
        plant.GetJointByName(name).set_angle(context, position)
    sensed = [_beyond(plant, mount.joint) for mount in robot.force_torque]
    found: dict[str, dict[str, Any]] = {}
    for name in robot.joints:
        joint = plant.GetJointByName(name)
        moved = plant.GetBodiesKinematicallyAffectedBy([joint.index()])
        beyond = [body for bodies in sensed for body in bodies if body in moved]
        link_inertia, gravity = _about(plant, context, joint, moved)
        inertia, weight = _about(plant, context, joint, beyond) if beyond else (0.0, 0.0)
        found[name] = {
            "link_inertia": link_inertia,
            "gravity_stiffness": gravity,
            "sensed_inertia": inertia,
            "sensed_gravity": weight,
        }
    return found


def _beyond(plant: MultibodyPlant, weld: str) -> list[Any]:
    """Bodies at and beyond a welded sensor joint that move with its child."""
    child = plant.GetJointByName(weld).child_body()
    found = [child.index()]
    for index in plant.GetJointIndices():
        joint: Any = plant.get_joint(index)
        if joint.parent_body().index() in found:
            found.append(joint.child_body().index())
    return found


def _about(plant: Any, context: Any, joint: Any, bodies: list[Any]) -> tuple[float, float]:
    """(inertia [kg m^2], stiffness -d tau_gravity/dq [N m/rad]) of bodies about a joint's axis."""
    frame, axis = joint.frame_on_parent(), joint_axes(plant, [joint])[0]
    spatial = plant.CalcSpatialInertia(context, frame, bodies)
    weight = frame.CalcPoseInWorld(context).rotation().matrix().T @ [0.0, 0.0, -GRAVITY * spatial.get_mass()]
    inertia = float(axis @ spatial.CalcRotationalInertia().CopyToFullMatrix3() @ axis)
    return inertia, float(-axis @ np.cross(np.cross(axis, spatial.get_com()), weight))
