"""One joint of the leg in torque control, the others locked, with a drive of linear effects only."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from pydrake.systems.analysis import Simulator

from drake_tc.analysis.torque_loop.one_joint import one_joint_loop
from drake_tc.control.joint_loop import JointLoop
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.running import build_loop
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import sliding_scenario, torque_gains
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import make_plant

MODELS = Path(__file__).parents[2] / "models" / "hrp2_like"
POSTURE = {
    "r_hip_yaw": 0.0,
    "r_hip_roll": 0.0,
    "r_hip_pitch": -0.45,
    "r_knee": 0.87,
    "r_ankle_pitch": -0.42,
    "r_ankle_roll": 0.0,
}


def drive(joint, k_tau, k_v, rotor):
    effects = [{"effect": "viscous", "viscous": k_v / k_tau}]
    if rotor:
        effects.append({"effect": "rotor_inertia", "rotor_inertia": rotor})
    return {"joints": {joint: {"drive": {"kind": "position_servo", "gain": k_tau}, "effects": effects}}}


def write_scenario(folder, joint, true, model, scenario):
    """Robot, both drive models and a scenario file; `true` and `model` are (K_tau, K_v, rotor)."""
    robot = yaml.safe_load((MODELS / "hrp2_like_leg.yaml").read_text())
    robot |= {
        "urdf": str(MODELS / "hrp2_like_leg.urdf"),
        "joints": [joint],
        "locked": {name: angle for name, angle in POSTURE.items() if name != joint},
        "posture": {joint: POSTURE[joint]},
        "actuators": "true.yaml",
    }
    scenario = {"robot": "robot.yaml", "model": "model.yaml", "sensors": "perfect", "tare": 0.0, **scenario}
    scenario["guard"] = {"start_time": 0.05}
    for name, document in (
        ("robot", robot),
        ("true", drive(joint, *true)),
        ("model", drive(joint, *model)),
        ("scenario", {"one": scenario}),
    ):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(document))
    return Scenario.load(folder / "scenario.yaml", "one")


def started(scenario, until=0.4):
    """(loop, context) at rest with full filters and the guard in its normal mode."""
    loop = build_loop(scenario)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    simulator.Initialize()
    simulator.AdvanceTo(until)
    return loop, context


def about_joint(loop, context):
    """(inertia, gravity stiffness) of the links that move, by Drake's mass matrix and a difference of its gravity."""
    plant = make_plant(loop.robot, 0.0)
    own = plant.CreateDefaultContext()
    here = loop.plant.GetPositions(loop.plant.GetMyContextFromRoot(context))
    plant.SetPositions(own, here)
    inertia = plant.CalcMassMatrix(own)[0, 0]
    torques = []
    for step in (1e-4, -1e-4):
        plant.SetPositions(own, here + step)
        torques.append(plant.CalcGravityGeneralizedForces(own)[0])
    return float(inertia), float(-(torques[0] - torques[1]) / 2e-4)


def beyond_sensor(loop, context):
    """The same of the foot alone, from its spatial inertia about the joint."""
    plant = make_plant(loop.robot, 0.0)
    own = plant.CreateDefaultContext()
    plant.SetPositions(own, loop.plant.GetPositions(loop.plant.GetMyContextFromRoot(context)))
    joint = plant.GetJointByName(loop.robot.joints[0])
    frame, axis = joint.frame_on_parent(), joint.revolute_axis()
    spatial = plant.CalcSpatialInertia(own, frame, [plant.GetBodyByName("r_foot").index()])
    weight = frame.CalcPoseInWorld(own).rotation().matrix().T @ [0.0, 0.0, -9.81 * spatial.get_mass()]
    inertia = axis @ spatial.CalcRotationalInertia().CopyToFullMatrix3() @ axis
    return float(inertia), float(-axis @ np.cross(np.cross(axis, spatial.get_com()), weight))


def closed_form(loop, context, true, model, **changes):
    """The JointLoop of the same numbers."""
    scenario = loop.scenario
    link, gravity = about_joint(loop, context)
    sensed, sensed_gravity = beyond_sensor(loop, context)
    gains = torque_gains(scenario, loop.robot)
    values = {
        "inertia": link + true[2],
        "link_inertia": link,
        "k_tau": true[0],
        "k_v": true[1],
        "k_tau_model": model[0],
        "k_v_model": model[1],
        "window": scenario.filters.window,
        "order": scenario.filters.encoder_order,
        "inertial_order": scenario.filters.inertial_order,
        "dt": scenario.dt,
        "kp": float(gains.kp[0]),
        "ki": float(gains.ki[0]),
        "ks": float(gains.ks[0]),
        "kd": float(gains.kd[0]),
        "kf": float(gains.kf[0, 0]),
        "gravity_stiffness": gravity,
        "gravity_at": scenario.configuration,
        "sensed_inertia": sensed,
        "sensed_gravity": sensed_gravity,
        "velocity_from": scenario.compensation.velocity,
    }
    return JointLoop(**(values | changes))


def spring_loop(folder, kf, stiffness=300.0):
    """(loop, context, its JointLoop) of the yaw joint alone against a spring, linear drives, small window."""
    scenario = diagram_entry("hrp2_leg").scenario("hanging")
    scenario = replace(
        scenario,
        sensors="perfect",
        tare=0.0,
        guard=replace(scenario.guard, start_time=0.05),
        gains=replace(scenario.gains, k6=0.25, k7=0.0, kp=1.0, kf=kf),
        filters=replace(scenario.filters, window=10),
    )
    scenario = sliding_scenario(scenario, folder)
    loop = one_joint_loop(scenario, "r_hip_yaw", stiffness)
    context = loop.settled(0.3).get_context()
    return loop, context, replace(joint_loops(scenario)["r_hip_yaw"], environment_stiffness=stiffness)
