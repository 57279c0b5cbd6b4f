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
from drake_tc.control.guard import GuardMode
from drake_tc.errors import ParamsError
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.references import posture, references, table_source
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import LoopDesign, actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.wiring import Desired, wire_torque_loop
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

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
    design = LoopDesign(
        robot=robot,
        plant_robot=robot,
        spec=scenario,
        actuators=(actuator_models(scenario, whole)[joint] if drive is None else drive,),
        models=tuple(actuator_models(scenario, robot, controller=True).values()),
        gains=torque_gains(scenario, robot),
        posture=robot.posture,
    )
    wire_torque_loop(builder, plant, design, Desired(source.get_output_port()))
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
