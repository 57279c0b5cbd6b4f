"""The motion of a run as one HTML file: Meshcat's recording, which opens without a network.

Also the plants of a diagram of the user's own in Meshcat, live or recorded.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, System

from drake_tc.errors import ParamsError
from drake_tc.loops.plant import add_objects, start_meshcat
from drake_tc.loops.torque.running import TorqueRecording
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.running import TsidRecording
from drake_tc.robot.pictures import GREY, Picture, frustums
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


def motion_html(motion: Motion) -> str:
    """The text of an HTML file that plays the motion; it loads nothing from elsewhere."""
    builder = DiagramBuilder()
    plant: Any
    plant, _ = AddMultibodyPlantSceneGraph(builder, STEP)
    add_robot(plant, motion.robot, visuals=True)
    motion.surroundings(plant)
    plant.Finalize()
    diagram = builder.Build()
    pictures, frames = DiagramPictures(diagram, diagram.GetSystems()), []
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    places = [plant.GetJointByName(name).position_start() for name in motion.robot.joints]
    for row in _frames(motion.time):
        positions = plant.GetPositions(own)
        positions[places] = motion.joints[row]
        for name, law in motion.robot.followers.items():
            leader = motion.joints[row, motion.robot.joints.index(law.of)]
            positions[plant.GetJointByName(name).position_start()] = law.multiplier * leader + law.offset
        if motion.base.shape[1]:
            first = plant.GetBodyByName(motion.robot.base).floating_positions_start()
            positions[first : first + 7] = motion.base[row]
        plant.SetPositions(own, positions)
        frames.append((float(motion.time[row]), pictures.poses(context)))
    return pictures.html(frames)


def look_at(meshcat: Any, places: Sequence[Any]) -> None:
    """Put the camera in front of what is shown, a little to its side and above it.

    Args:
        meshcat: Where.
        places: (3,) of the bodies in the world [m].
    """
    points = np.array(places)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = max(float(np.ptp(points, axis=0).max()), 0.3)
    meshcat.SetCameraPose(middle + size * np.array([1.5, -1.3, 0.7]), middle)


class DiagramPictures:
    """The plants of a diagram of the user's own, drawn body by body: their visual geometry, or frustums without one."""

    def __init__(self, diagram: Diagram, systems: Sequence[System]) -> None:
        """Find the plants.

        Args:
            diagram: Built.
            systems: All of its systems.

        Raises:
            ParamsError: there is no MultibodyPlant.
        """
        self.plants: list[Any] = [system for system in systems if isinstance(system, MultibodyPlant)]
        self._scenes: list[Any] = [system for system in systems if isinstance(system, SceneGraph)]
        if not self.plants:
            raise ParamsError(f"{diagram.get_name()}: expected a diagram with a MultibodyPlant to show, it has none")

    def place(self, meshcat: Any) -> None:
        """Put all shapes where they belong to their bodies."""
        for number, plant in enumerate(self.plants):
            drawn = list(_shapes(plant, self._scenes)) or list(_frustums(plant))
            for count, (body, each) in enumerate(drawn):
                path = f"{_path(number, body)}/{count}"
                meshcat.SetObject(path, each.shape, each.colour)
                meshcat.SetTransform(path, each.pose)

    def poses(self, context: Context) -> dict[str, Any]:
        """Path of each body to its pose in the world.

        Args:
            context: Of the diagram.
        """
        found = {}
        for number, plant in enumerate(self.plants):
            own = plant.GetMyContextFromRoot(context)
            for body in _bodies(plant):
                found[_path(number, body)] = plant.EvalBodyPoseInWorld(own, body)
        return found

    def show(self, meshcat: Any, poses: Mapping[str, Any], time: float | None = None) -> None:
        """Move the bodies; into the recording where there is a time [s]."""
        for path, pose in poses.items():
            meshcat.SetTransform(path, pose, time)

    def html(self, frames: Sequence[tuple[float, Mapping[str, Any]]]) -> str:
        """The text of an HTML file that plays the frames, (time [s], poses)."""
        meshcat = start_meshcat(quiet=True)
        self.place(meshcat)
        meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
        for time, poses in frames:
            self.show(meshcat, poses, time)
        meshcat.StopRecording()
        meshcat.PublishRecording()
        look_at(meshcat, [pose.translation() for pose in frames[0][1].values()])
        text: str = meshcat.StaticHtml()
        return text


def _bodies(plant: Any) -> list[Any]:
    """All of them, the world first."""
    return [plant.get_body(BodyIndex(number)) for number in range(plant.num_bodies())]


def _path(number: int, body: Any) -> str:
    return f"/drake_tc/plant_{number}/{int(body.index())}_{body.name()}"


def _shapes(plant: Any, scenes: Sequence[Any]) -> Iterator[tuple[Any, Picture]]:
    """The visual geometry that a plant has in a SceneGraph."""
    if not plant.geometry_source_is_registered():
        return
    scene = next((each for each in scenes if each.model_inspector().SourceIsRegistered(plant.get_source_id())), None)
    if scene is None:
        return
    inspector = scene.model_inspector()
    for body in _bodies(plant):
        for geometry in plant.GetVisualGeometriesForBody(body):
            properties = inspector.GetIllustrationProperties(geometry)
            colour = GREY
            if properties is not None and properties.HasProperty("phong", "diffuse"):
                colour = properties.GetProperty("phong", "diffuse")
            yield body, Picture(inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry), colour)


def _frustums(plant: Any) -> Iterator[tuple[Any, Picture]]:
    """Of a plant that has no visual geometry."""
    bodies = {str(int(body.index())): body for body in _bodies(plant)[1:]}
    ends: dict[str, list[FloatArray]] = {name: [] for name in bodies}
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        parent = str(int(joint.parent_body().index()))
        if parent in ends:
            ends[parent].append(joint.frame_on_parent().GetFixedPoseInBodyFrame().translation())
    for name, each in frustums(ends, tuple(bodies)):
        yield bodies[name], each


def _frames(time: FloatArray) -> list[int]:
    """Rows of the frames."""
    count = max(2, int(np.ceil((time[-1] - time[0]) * FRAMES_PER_SECOND)) + 1)
    requested = np.linspace(time[0], time[-1], count)
    rows = np.clip(np.searchsorted(time, requested), 0, time.size - 1)
    return sorted({int(row) for row in rows})
