"""What surrounds the robot: rigid objects to touch, hands that push, and springs to hang in."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import CoulombFriction, ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, LinearBushingRollPitchYaw
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem

from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios.parts import ObjectSpec, PushSpec, SuspensionSpec
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY


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
