"""What a TsidModel adds to the links of its plant before that is finalized: named frames; and its rotors, checked."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.multibody.tree import FixedOffsetFrame

from drake_tc.errors import ParamsError
from drake_tc.robot.mounts import Mount
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import Contact

_SUFFIX = "_of_tsid"


def checked_rotors(robot: Robot, rotor_inertia: Mapping[str, float]) -> Mapping[str, float]:
    """Reflected inertias by joint [kg m^2], as given; a joint that is not there has none.

    Raises:
        ParamsError: an unknown joint, or an inertia that is negative or not finite.
    """
    for name, inertia in rotor_inertia.items():
        if name not in robot.joints:
            raise ParamsError(f"rotor_inertia: no joint {name!r}; joints: {', '.join(robot.joints)}")
        if not (np.isfinite(inertia) and inertia >= 0.0):
            raise ParamsError(f"rotor_inertia: {name}: expected a number >= 0 [kg m^2], got {inertia!r}")
    return rotor_inertia


def add_frames(plant: Any, model: Any, contacts: Sequence[Contact], more: Sequence[Mount]) -> dict[str, Any]:
    """The frame of each link, contact and mount, by name.

    Args:
        plant: Not finalized; gets the frames of contacts and mounts.
        model: Instance of the robot.
        contacts: Each with its frame C.
        more: Other frames.

    Raises:
        ParamsError: a link that is not there, or a name that is taken.
    """
    links = {plant.get_body(index).name(): plant.get_body(index) for index in plant.GetBodyIndices(model)}
    frames = {name: body.body_frame() for name, body in links.items()}
    named = [("contact", contact.name, contact.frame) for contact in contacts]
    for kind, name, mount in [*named, *(("frame", mount.name, mount) for mount in more)]:
        if mount.link not in links:
            raise ParamsError(f"{kind} {name!r}: no link {mount.link!r}; links: {', '.join(links)}")
        if name in frames:
            raise ParamsError(f"{kind} {name!r}: expected a name that no link, contact or frame has; it is taken")
        offset = FixedOffsetFrame(name + _SUFFIX, links[mount.link].body_frame(), mount.pose.transform)
        frames[name] = plant.AddFrame(offset)
    return frames
