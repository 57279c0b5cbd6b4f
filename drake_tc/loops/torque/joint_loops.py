"""The joints of a torque loop as closed-form loops, each by itself while the others stand still (`JointLoop`)."""

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.parts import LoopDesign
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import PRISMATIC, joint_axes
from drake_tc.types import GRAVITY, FloatArray


def joint_loops(loop: Scenario | LoopDesign, direction: float = 0.0) -> dict[str, JointLoop]:
    """The loop of every joint, in sliding at the posture in which the motion rests.

    In sliding, dry friction is constant and a dead zone is passed, so neither enters; a velocity-sign switch s makes
    the drive's gain K_tau/(1 + s direction). Of the other effects viscous friction and rotor inertia are taken.

    Args:
        loop: In torque control on estimated torques, without predictor and observer.
        direction: Of the sliding: 1, -1, or 0 for the mean of both.

    Raises:
        ParamsError: another loop, a scenario that cannot be built, or numbers that make no loop.
    """
    design = loop if isinstance(loop, LoopDesign) else LoopDesign.of_scenario(loop)
    spec, gains = design.spec, design.gains
    _check_loop(spec)
    filters = spec.filters
    loops = {}
    true_weights = _weights(design.plant_robot, design.posture)
    for i, (joint, weights) in enumerate(_weights(design.robot, design.posture).items()):
        moved = true_weights[joint]
        true, model = design.actuators[i], design.models[i]
        (k_tau, k_v), (k_tau_model, k_v_model) = _drive(true, direction), _drive(model, direction)
        loops[joint] = JointLoop(
            inertia=moved["link_inertia"] + true.inertia,
            k_tau=k_tau,
            k_v=k_v,
            k_tau_model=k_tau_model,
            k_v_model=k_v_model,
            window=filters.window,
            order=filters.encoder_order,
            inertial_order=filters.inertial_order,
            dt=spec.dt,
            kp=float(gains.kp[i]),
            ki=float(gains.ki[i]),
            ks=float(gains.ks[i]),
            kd=float(gains.kd[i]),
            kf=float(gains.kf[0, 0]) if gains.kf.size else 0.0,
            gravity_at=spec.configuration,
            velocity_from=spec.compensation.velocity,
            rotor_model=0.0 if spec.compensation.acceleration == "none" else model.inertia,
            **weights | {"gravity_stiffness": moved["gravity_stiffness"]},
        )
    return loops


def _check_loop(spec: TorqueLoopSpec) -> None:
    """Refuse what `JointLoop` does not have."""
    expected = {"controller": "torque", "torque_from": "estimate", "predictor": None, "observer": None}
    others = [name for name, value in expected.items() if getattr(spec, name) != value]
    if others:
        raise ParamsError(
            "joint loops: expected a loop in torque control (`controller: torque`, `torque_from: estimate`)"
            f" without predictor and observer; it differs in {', '.join(others)}"
        )


def _drive(model: ActuatorModel, direction: float) -> tuple[float, float]:
    """(K_tau, K_v) in sliding."""
    values = {value.key: value.parameters for value in model.effects}
    switch = values.get("velocity_sign_switch", {}).get("switch", 0.0)
    gain = model.drive.gain / (1.0 + switch * direction)
    return gain, gain * values.get("viscous", {}).get("viscous", 0.0)


def _weights(robot: Robot, at: FloatArray) -> dict[str, dict[str, Any]]:
    """Joint to inertia and gravity stiffness of what it moves, and of what lies beyond the F/T sensor."""
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    positions = np.array(plant.GetPositions(context))
    for name, position in zip(robot.joints, at, strict=True):
        positions[plant.GetJointByName(name).position_start()] = position
    plant.SetPositions(context, positions)
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
    """(inertia [kg m^2], stiffness -d tau_gravity/dq [N m/rad]) of bodies about a joint's axis.

    Of a prismatic joint, (mass [kg], 0 [N/m]): gravity does not change along its axis.
    """
    if joint.type_name() == PRISMATIC:
        return float(plant.CalcSpatialInertia(context, joint.frame_on_parent(), bodies).get_mass()), 0.0
    frame, axis = joint.frame_on_parent(), joint_axes(plant, [joint])[0]
    spatial = plant.CalcSpatialInertia(context, frame, bodies)
    weight = frame.CalcPoseInWorld(context).rotation().matrix().T @ [0.0, 0.0, -GRAVITY * spatial.get_mass()]
    inertia = float(axis @ spatial.CalcRotationalInertia().CopyToFullMatrix3() @ axis)
    return inertia, float(-axis @ np.cross(np.cross(axis, spatial.get_com()), weight))
