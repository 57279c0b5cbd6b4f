"""Where things sit on links: poses, sensor frames, contact frames."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """A pose as in URDF.

    Attributes:
        xyz: Translation [m].
        rpy: Roll, pitch, yaw about the fixed x, y, z axes [rad].
    """

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)

    @property
    def transform(self) -> RigidTransform:
        """X: the same as Drake's transform."""
        translation: Any = np.array(self.xyz)
        return RigidTransform(RollPitchYaw(*self.rpy), translation)


@dataclass(frozen=True)
class Mount:
    """A named frame on a link.

    Attributes:
        name: As it stands in logs and ports.
        link: Link it is fixed to.
        pose: X_LM: frame M in the link's frame L.
    """

    name: str
    link: str
    pose: Pose = Pose()


@dataclass(frozen=True)
class ForceTorqueMount:
    """A 6-axis force/torque sensor inside a fixed joint.

    Attributes:
        name: As it stands in logs and ports.
        joint: The fixed joint that carries all of the load.
        pose: X_LS: sensor frame S in the frame L of the joint's child link.
        contact: Link and frame C that takes the external wrench of the part beyond the sensor.
    """

    name: str
    joint: str
    pose: Pose
    contact: Mount
