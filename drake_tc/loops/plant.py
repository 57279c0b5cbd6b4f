"""`add_robot_plant`: a robot in its own finalized plant, in a diagram.

A Meshcat server, or one line on why there is none.
"""

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint
from pydrake.symbolic import Expression, Variable
from pydrake.symbolic import max as symbolic_max
from pydrake.symbolic import min as symbolic_min
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.robot import Robot


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


def require_live_ports(plant: MultibodyPlant) -> None:
    """Refuse a plant whose output ports are sampled: its forces and accelerations lag the encoders by one step.

    Raises:
        ParamsError: the plant is not finalized, or its ports are sampled.
    """
    if not plant.is_finalized():
        raise ParamsError("plant: expected a finalized plant; call plant.Finalize() first")
    if plant.has_sampled_output_ports():
        raise ParamsError(
            "plant: its output ports are sampled, so that forces and accelerations lag the encoders by one step;"
            " call plant.SetUseSampledOutputPorts(False) before plant.Finalize(), or use drake_tc.add_robot_plant"
        )
