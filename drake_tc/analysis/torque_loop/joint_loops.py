"""The joints of a torque loop as closed-form loops, each by itself while the others stand still (`JointLoop`).

One joint of a scenario in torque control, all others locked, against a spring: the smallest complete loop.

The wiring is that of the whole robot (`add_torque_loop`).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, LinearBushingRollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from drake_tc.actuation.model import ActuatorModel
from drake_tc.analysis.joint_loop import JointLoop
from drake_tc.control.guard import GuardMode
from drake_tc.errors import ParamsError
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.parts import LoopDesign, actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.references import posture, references, table_source
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.robot.plant import add_robot, make_plant
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


FASTEST = 50.0
"""A joint that is faster [rad/s] has run away."""
CHUNK = 0.02


@dataclass(frozen=True, eq=False)
class OneJointLoop:
    """A built loop: diagram, its plant, and the log of [q; v]."""

    diagram: Diagram
    plant: Any
    log: VectorLogSink

    def settled(self, at: float) -> Simulator:
        """A simulator that has run to a time [s] from rest in the posture."""
        simulator = Simulator(self.diagram)
        simulator.Initialize()
        simulator.AdvanceTo(at)
        return simulator

    def speed_after(self, simulator: Simulator, kick: float, duration: float) -> tuple[FloatArray, FloatArray]:
        """(time since, speed [rad/s]) after a `kick` [rad/s] of its speed; ends where monitor or guard stop it."""
        context = simulator.get_mutable_context()
        own = self.plant.GetMyMutableContextFromRoot(context)
        self.plant.SetVelocities(own, self.plant.GetVelocities(own) + kick)
        begin = context.get_time()
        guard: Any = self.diagram.GetSubsystemByName("guard")
        mode = guard.GetOutputPort("mode")
        for chunk in range(1, round(duration / CHUNK) + 1):
            simulator.AdvanceTo(begin + chunk * CHUNK)
            now = float(mode.Eval(guard.GetMyContextFromRoot(context))[0])
            if now != GuardMode.NORMAL or not abs(float(self.plant.GetVelocities(own)[0])) < FASTEST:
                break
        log = self.log.FindLog(context)
        time, speed = np.array(log.sample_times()), np.array(log.data())[1]
        return time[time > begin] - begin, speed[time > begin]


def alone(robot: Robot, scenario: Scenario, joint: str) -> Robot:
    """The robot with all joints but one locked in the scenario's posture.

    Raises:
        ParamsError: no such joint.
    """
    if joint not in robot.joints:
        raise ParamsError(f"no joint {joint!r} in {robot.name}; joints: {', '.join(robot.joints)}")
    angles = dict(zip(robot.joints, posture(scenario.motion, robot).tolist(), strict=True))
    locked = {**robot.locked, **{name: angle for name, angle in angles.items() if name != joint}}
    limits = {joint: robot.limits.get(joint, {})}
    return replace(robot, joints=(joint,), locked=locked, limits=limits, posture=np.array([angles[joint]]))


def one_joint_loop(
    scenario: Scenario, joint: str, stiffness: float = 0.0, drive: ActuatorModel | None = None
) -> OneJointLoop:
    """Build the loop.

    Args:
        scenario: Of the whole robot, at rest in its posture; its motion is not run.
        joint: Which.
        stiffness: Of a spring between the first F/T sensor's contact link and the world, about the joint's axis
            [N m/rad]; it turns about the axis only where link and joint have parallel z axes, as a yaw joint's do.
        drive: What is simulated; None: the scenario's.

    Raises:
        ParamsError: no such joint, or a scenario that cannot be built.
    """
    whole = loop_robot(scenario)
    robot = alone(whole, scenario, joint)
    motion = replace(scenario.motion, posture={joint: float(robot.posture[0])}, knots={}, sinusoids={}, times=())
    scenario = replace(scenario, motion=motion, force={}, objects=(), pushes=(), faults={})
    builder = DiagramBuilder()

    def hold(plant: MultibodyPlant) -> None:
        if stiffness:
            _add_spring(plant, robot, stiffness)

    plant = add_robot_plant(builder, robot, scenario.plant_step, prepare=hold)
    path = references(scenario, robot)
    source = builder.AddNamedSystem("reference", table_source(path.time, path.motion))
    add_torque_loop(
        builder,
        plant,
        robot,
        {joint: actuator_models(scenario, whole)[joint] if drive is None else drive},
        source.get_output_port(),
        scenario,
        gains=torque_gains(scenario, robot),
        controller_models=actuator_models(scenario, robot, controller=True),
    )
    log = LogVectorOutput(plant.get_state_output_port(), builder, scenario.dt)
    return OneJointLoop(builder.Build(), plant, log)


def _add_spring(plant: Any, robot: Robot, stiffness: float) -> None:
    """About the vertical, at rest in the posture; a bushing, so that the F/T sensor feels it."""
    own: Any = MultibodyPlant(0.0)
    add_robot(own, robot)
    own.Finalize()
    link, nil = robot.force_torque[0].contact.link, _nothing()
    X_WL: RigidTransform = own.GetBodyByName(link).EvalPoseInWorld(own.CreateDefaultContext())
    offset = RigidTransform(X_WL.rotation().inverse(), nil)  # axes of the world
    frame = plant.AddFrame(FixedOffsetFrame("spring", plant.GetBodyByName(link).body_frame(), offset))
    here = plant.AddFrame(FixedOffsetFrame("spring_rest", plant.world_frame(), RigidTransform(X_WL.translation())))
    about: Any = np.array([0.0, 0.0, stiffness])
    plant.AddForceElement(LinearBushingRollPitchYaw(here, frame, about, nil, nil, nil))


def _nothing() -> Any:
    return np.zeros(3)
