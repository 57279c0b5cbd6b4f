"""`add_robot_plant`: a robot in its own finalized plant, in a diagram.

A Meshcat server, or one line on why there is none.

What surrounds the robot: rigid objects to touch, hands that push, and springs to hang in.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Box, Meshcat, MeshcatVisualizer
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import FixedOffsetFrame, LinearBushingRollPitchYaw, ModelInstanceIndex, PrismaticJoint
from pydrake.symbolic import Expression, Variable
from pydrake.symbolic import max as symbolic_max
from pydrake.symbolic import min as symbolic_min
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import ObjectSpec, PushSpec, SuspensionSpec
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY


def start_meshcat(*, quiet: bool = False) -> Any:
    """A Meshcat at the first free port from 7000 to 7999.

    Args:
        quiet: Do not tell its address: nobody needs to open it.

    Raises:
        ParamsError: none of the ports is free.
    """
    log = logging.getLogger("drake")
    level = log.level
    if quiet:
        log.setLevel(logging.WARNING)
    try:
        return Meshcat()
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ParamsError(
            f"Meshcat could not be started: {reason}; expected a free port from 7000 to 7999: end other programs that"
            " show robots"
        ) from None
    finally:
        log.setLevel(level)


def add_robot_plant(
    builder: DiagramBuilder,
    robot: Robot,
    step: float = 1e-3,
    *,
    scene: bool = False,
    collisions: bool = False,
    visuals: bool = False,
    meshcat: bool = False,
    posture_deviation: float = 0.01,
    prepare: Callable[[MultibodyPlant], None] | None = None,
) -> MultibodyPlant:
    """Add a finalized plant with the robot to a diagram, as system `plant` whose ports are live.

    Live means that sensors read the state of the instant (`SetUseSampledOutputPorts(False)`), as the loops need it.

    Args:
        builder: Takes the plant.
        robot: From `load_robot`.
        step: Time step of the plant [s].
        scene: Add a SceneGraph too, so that the robot can touch what `prepare` adds.
        collisions: Keep the robot's primitive collision shapes; adds a SceneGraph.
        visuals: Draw the robot's visual geometry, meshes too; adds a SceneGraph.
        meshcat: Show the robot in a browser; adds a SceneGraph.
        posture_deviation: Standard deviation of the joints' positions about the posture in a random context
            (`SetRandomContext`) [rad or m]; the default context is the posture.
        prepare: Gets the plant before it is finalized: add a floor, objects, springs.

    Raises:
        ParamsError: the URDF or the actuator file cannot be read.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> add_robot_plant(DiagramBuilder(), robot).num_actuators()
        6
    """
    if not 0.0 <= step < np.inf:
        raise ParamsError(f"step: expected a time step >= 0 [s], got {step!r}")
    if not 0.0 <= posture_deviation < np.inf:
        raise ParamsError(f"posture_deviation: expected a number >= 0 [rad or m], got {posture_deviation!r}")
    plant: Any
    if scene or collisions or visuals or meshcat:
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, step)
        if meshcat:
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, start_meshcat())
    else:
        plant = builder.AddNamedSystem("plant", MultibodyPlant(step))
    add_robot(plant, robot, visuals=visuals or meshcat, collisions=collisions)
    if prepare is not None:
        prepare(plant)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    _declare_random(plant, robot, posture_deviation)
    plant.set_name("plant")
    built: MultibodyPlant = plant
    return built


def _declare_random(plant: MultibodyPlant, robot: Robot, deviation: float) -> None:
    """Positions about the posture, within the joints' ranges."""
    limits = joint_limits(robot)
    for i, name in enumerate(robot.joints):
        joint: Any = plant.GetJointByName(name)
        about = robot.posture[i] + deviation * Variable(name, Variable.Type.RANDOM_GAUSSIAN)
        lower, upper = Expression(limits.lower[i]), Expression(limits.upper[i])
        within = [
            symbolic_min(symbolic_max(about, lower), upper)
            if np.isfinite([limits.lower[i], limits.upper[i]]).all()
            else about
        ]
        slides = isinstance(joint, PrismaticJoint)
        (joint.set_random_translation_distribution if slides else joint.set_random_angle_distribution)(within[0])


def require_fitting_plant(plant: MultibodyPlant, period: float, robot: Robot | None = None) -> None:
    """Refuse a plant whose output ports are sampled: its forces and accelerations lag the encoders by one step.

    Args:
        plant: Of the loop.
        period: Of the control [s], which the plant's time step must divide.
        robot: Which must be in it, where it is known.

    Raises:
        ParamsError: the plant is not finalized, its ports are sampled, its step does not fit, or it has no model
            instance of the robot's name.
    """
    if not plant.is_finalized():
        raise ParamsError("plant: expected a finalized plant; call plant.Finalize() first")
    if plant.has_sampled_output_ports():
        raise ParamsError(
            "plant: its output ports are sampled, so that forces and accelerations lag the encoders by one step;"
            " call plant.SetUseSampledOutputPorts(False) before plant.Finalize(), or use drake_tc.add_robot_plant"
        )
    step = plant.time_step()
    if step and (period < 0.5 * step or abs(period / step - round(period / step)) > 1e-6):
        raise ParamsError(
            f"plant: expected a time step of {period:g} s, the period of the control, or of it over a whole number, got"
            f" {step:g} s"
        )
    if robot is not None and not plant.HasModelInstanceNamed(robot.name):
        there = [plant.GetModelInstanceName(ModelInstanceIndex(i)) for i in range(2, plant.num_model_instances())]
        raise ParamsError(
            f"plant: expected a model instance {robot.name!r}, the name in the robot file, got"
            f" {', '.join(there) or 'none'}; use drake_tc.add_robot_plant, or give both the same name"
        )


def add_objects(plant: MultibodyPlant, objects: Sequence[ObjectSpec]) -> None:
    """Fix boxes to the world; before `Finalize`, with a SceneGraph."""
    for number, item in enumerate(objects):
        centre: Any = np.array(item.xyz)
        pose = RigidTransform(RollPitchYaw(*item.rpy), centre)
        rough = CoulombFriction(item.friction, item.friction)
        world = plant.world_body()
        plant.RegisterCollisionGeometry(world, pose, Box(*item.size), f"object_{number}", rough)
        grey: Any = np.array([0.6, 0.6, 0.62, 1.0])
        plant.RegisterVisualGeometry(world, pose, Box(*item.size), f"object_{number}_visual", grey)


def add_suspension(plant: MultibodyPlant, robot: Robot, spec: SuspensionSpec) -> None:
    """Hang a floating base in springs; before `Finalize`. At its starting pose they carry the robot's weight."""
    body = plant.GetBodyByName(robot.base)
    point: Any = np.array(spec.point)
    held = FixedOffsetFrame("suspended", body.body_frame(), RigidTransform(point))
    mass = sum(plant.get_body(index).default_mass() for index in plant.GetBodyIndices(body.model_instance()))
    start = robot.base_pose.transform.multiply(RigidTransform(point))
    raised: Any = start.translation() + np.array([0.0, 0.0, mass * GRAVITY / spec.stiffness[2]])
    hook = FixedOffsetFrame("hook", plant.world_frame(), RigidTransform(start.rotation(), raised))
    values: Any = [np.array(v) for v in (spec.turn_stiffness, spec.turn_damping, spec.stiffness, spec.damping)]
    plant.AddForceElement(LinearBushingRollPitchYaw(plant.AddFrame(hook), plant.AddFrame(held), *values))


def check_masses(plant: MultibodyPlant, robot: Robot, factors: Mapping[str, float]) -> None:
    """Every link whose mass is to change is there.

    Raises:
        ParamsError: one is not.
    """
    for link in factors:
        if not plant.HasBodyNamed(link):
            raise ParamsError(f"masses: no link {link!r} in {robot.name}")


def set_masses(plant: MultibodyPlant, context: Context, factors: Mapping[str, float]) -> None:
    """Multiply the masses of links in the plant's context; their rotational inertias grow with them."""
    for link, factor in factors.items():
        body = plant.GetBodyByName(link)
        body.SetMass(context, factor * body.CalcSpatialInertiaInBodyFrame(context).get_mass())


def add_pushes(builder: DiagramBuilder, plant: MultibodyPlant, pushes: Sequence[PushSpec]) -> None:
    """Let something push on a finalized plant, where anything does: a system `pushes`.

    Raises:
        ParamsError: a link that is not there.
    """
    if pushes:
        system = builder.AddNamedSystem("pushes", Pushes(plant, pushes))
        builder.Connect(system.get_output_port(), plant.get_applied_spatial_force_input_port())


class Pushes(LeafSystem):
    """Wrenches on links over time: sum over the pushes of w sin^2(pi (t - begin)/duration) within their time.

    Output: spatial_forces, a list of ExternallyAppliedSpatialForce in world axes; y(t), no state.
    """

    def __init__(self, plant: MultibodyPlant, pushes: Sequence[PushSpec]) -> None:
        """Declare the port.

        Args:
            plant: Finalized plant, for the links' indices.
            pushes: What pushes.

        Raises:
            ParamsError: a link that is not there.
        """
        super().__init__()
        for push in pushes:
            if not plant.HasBodyNamed(push.link):
                raise ParamsError(f"pushes: no link {push.link!r} in the robot")
        self._pushes = tuple((plant.GetBodyByName(push.link).index(), push) for push in pushes)
        write: Any = self._push
        self.DeclareAbstractOutputPort(
            "spatial_forces", lambda: Value[list[ExternallyAppliedSpatialForce]](), write, {self.time_ticket()}
        )

    def _push(self, context: Context, forces: Any) -> None:
        time = context.get_time()
        acting = []
        for body, push in self._pushes:
            share = (time - push.begin) / push.duration
            if not 0.0 < share < 1.0:
                continue
            rise = np.sin(np.pi * share) ** 2
            force = ExternallyAppliedSpatialForce()
            force.body_index = body
            point: Any = np.array(push.point)
            force.p_BoBq_B = point
            force.F_Bq_W = SpatialForce(rise * np.array(push.torque), rise * np.array(push.force))
            acting.append(force)
        forces.set_value(acting)
