"""Axes of revolute and prismatic joints, read from how the joints move.

In Drake's newer bindings the Python type of a joint can be that of another joint, of a plant that is gone: joints are
therefore told apart by `type_name()`, which asks the joint itself, and not by their Python type.
"""

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint
from scipy.spatial.transform import Rotation

from drake_tc.types import FloatArray

REVOLUTE, PRISMATIC = "revolute", "prismatic"


def has_axis(joint: Joint) -> bool:
    """Whether the joint is revolute or prismatic."""
    return joint.type_name() in (REVOLUTE, PRISMATIC)


def is_revolute(joint: Joint) -> bool:
    """Whether the joint turns about an axis."""
    return bool(joint.type_name() == REVOLUTE)


def joint_axes(plant: MultibodyPlant, joints: Sequence[Joint]) -> FloatArray:
    """Unit axes (n, 3) of joints that have one, in the joint's frame on its parent (and on its child: it is the same).

    Args:
        plant: Finalized, with the joints.
        joints: Revolute or prismatic: see `has_axis`.
    """
    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context).copy()
    q[[j.position_start() for j in joints]] = 1.0
    plant.SetPositions(context, q)
    axes = []
    for joint in joints:
        moved = plant.CalcRelativeTransform(context, joint.frame_on_parent(), joint.frame_on_child())
        if is_revolute(joint):
            axes.append(Rotation.from_matrix(moved.rotation().matrix()).as_rotvec())
        else:
            axes.append(moved.translation())
    return np.array(axes).reshape(-1, 3)
