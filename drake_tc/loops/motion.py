"""The motion of a recorded run as one HTML file: Meshcat's recording, which opens without a network."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from drake_tc.loops.plant import start_meshcat
from drake_tc.loops.surroundings import add_objects
from drake_tc.loops.torque.running import TorqueRecording
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.running import TsidRecording
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

FRAMES_PER_SECOND = 30.0
STEP = 1e-3
"""Of the plant that is shown [s]; it is never advanced."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A robot's configurations over time.

    Attributes:
        robot: Whose.
        time: (T,) [s].
        base: (T, 7) quaternion [w x y z] and position [m] of a floating base; (T, 0) for a fixed one.
        joints: (T, n) positions in the order of `robot.joints` [rad].
        surroundings: Adds what stands around the robot to a plant that is not finalized.
    """

    robot: Robot
    time: FloatArray
    base: FloatArray
    joints: FloatArray
    surroundings: Callable[[MultibodyPlant], None]


def torque_motion(recording: TorqueRecording, scenario: Scenario) -> Motion:
    """Of a run of the torque loop."""
    robot = recording.robot
    base = np.zeros((recording.time.size, 0)) if robot.fixed_base else recording["base_state"][:, :7]
    return Motion(robot, recording.time, base, recording.position, lambda plant: add_objects(plant, scenario.objects))


def tsid_motion(recording: TsidRecording) -> Motion:
    """Of a run of the whole-body loop."""
    model, scenario = recording.law.model, recording.scenario
    state = recording["state"]
    base = np.zeros((recording.time.size, 0)) if model.robot.fixed_base else state[:, :7]
    return Motion(
        model.robot,
        recording.time,
        base,
        state[:, model.positions],
        lambda plant: add_ground(plant, model.contacts, scenario.ground),
    )


def motion_html(motion: Motion, frames_per_second: float = FRAMES_PER_SECOND) -> str:
    """The text of an HTML file that plays the motion; it loads nothing from elsewhere.

    Args:
        motion: What to show.
        frames_per_second: Of the recording, at the speed of the simulated time.
    """
    builder = DiagramBuilder()
    plant: Any
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, STEP)
    add_robot(plant, motion.robot, visuals=True)
    motion.surroundings(plant)
    plant.Finalize()
    meshcat = start_meshcat(quiet=True)
    shown = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    places = [plant.GetJointByName(name).position_start() for name in motion.robot.joints]
    meshcat.StartRecording(frames_per_second=frames_per_second, set_visualizations_while_recording=False)
    for row in _frames(motion.time, frames_per_second):
        positions = plant.GetPositions(own)
        positions[places] = motion.joints[row]
        if motion.base.shape[1]:
            first = plant.GetBodyByName(motion.robot.base).floating_positions_start()
            positions[first : first + 7] = motion.base[row]
        plant.SetPositions(own, positions)
        context.SetTime(float(motion.time[row]))
        shown.ForcedPublish(shown.GetMyContextFromRoot(context))
    meshcat.StopRecording()
    meshcat.PublishRecording()
    text: str = meshcat.StaticHtml()
    return text


def _frames(time: FloatArray, frames_per_second: float) -> list[int]:
    """Rows of the frames."""
    count = max(2, int(np.ceil((time[-1] - time[0]) * frames_per_second)) + 1)
    requested = np.linspace(time[0], time[-1], count)
    rows = np.clip(np.searchsorted(time, requested), 0, time.size - 1)
    return sorted({int(row) for row in rows})
