"""The sensors of a robot file: where IMUs and force/torque sensors sit."""

from collections.abc import Mapping

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.robot.document import ForceTorqueSensorKeys, FrameKeys, ImuSensorKeys
from drake_tc.robot.fields import ForceTorqueMount, Mount
from drake_tc.robot.urdf_tree import LinkSplit, UrdfTree


def check_link(where: str, link: str, tree: UrdfTree) -> str:
    """The link's name.

    Raises:
        ParamsError: The URDF has no such link; with the nearest match.
    """
    if link not in tree.links:
        listed = f"links: {', '.join(tree.links)}"
        raise ParamsError(f"{where}: no link {link!r} in the URDF{did_you_mean(link, tree.links)}; {listed}")
    return link


def imu_mounts(entries: Mapping[str, ImuSensorKeys], tree: UrdfTree) -> tuple[Mount, ...]:
    """IMUs, each on a link, or on the child link of a joint.

    Raises:
        ParamsError: A link or joint that the URDF does not have.
    """
    mounts = []
    for name, entry in entries.items():
        if entry.joint is None:
            link = check_link(f"imu.{name}.link", entry.link or "", tree)
        elif entry.joint in tree.joints:
            link = tree.joints[entry.joint].child
        else:
            raise ParamsError(
                f"imu.{name}.joint: no joint {entry.joint!r} in the URDF{did_you_mean(entry.joint, tree.joints)}"
            )
        mounts.append(Mount(name, link, entry.pose))
    return tuple(mounts)


def link_splits(entries: Mapping[str, ForceTorqueSensorKeys], tree: UrdfTree) -> tuple[LinkSplit, ...]:
    """Links that force/torque sensors inside them divide.

    Args:
        entries: `force_torque` of the robot file.
        tree: The URDF as it is.

    Raises:
        ParamsError: A link that the URDF does not have or that has two sensors.
    """
    splits: dict[str, LinkSplit] = {}
    for name, entry in entries.items():
        if entry.link is None or entry.mass_beyond is None:
            continue
        at = f"force_torque.{name}.link"
        link = check_link(at, entry.link, tree)
        if link in splits:
            raise ParamsError(
                f"{at}: expected a link without another sensor; {link!r} has the sensor {splits[link].sensor!r} already"
            )
        splits[link] = LinkSplit(link, name, entry.mass_beyond)
    return tuple(splits.values())


def force_torque_mounts(
    entries: Mapping[str, ForceTorqueSensorKeys],
    joints: tuple[str, ...],
    base: str,
    tree: UrdfTree,
    splits: tuple[LinkSplit, ...],
) -> tuple[ForceTorqueMount, ...]:
    """Force/torque sensors, each in a joint that does not move, or inside a link.

    Args:
        entries: `force_torque` of the robot file.
        joints: Driven joints.
        base: Link that is welded or floats.
        tree: The URDF with its links split.
        splits: Of `link_splits`.

    Raises:
        ParamsError: A joint that moves, is not there or carries the base, or a contact that is not beyond the sensor.
    """
    inside = {split.sensor: split for split in splits}
    mounts = []
    for name, entry in entries.items():
        at = f"force_torque.{name}"
        split = inside.get(name)
        key, said = ("joint", entry.joint) if split is None else ("link", entry.link)
        joint = entry.joint or "" if split is None else split.joint
        if joint not in tree.joints or joint in joints:
            rigid = [other for other in tree.joints if other not in joints]
            raise ParamsError(
                f"{at}.joint: expected a joint that does not move, got {joint!r}{did_you_mean(joint, rigid)}; "
                "possible: "
                f"{', '.join(rigid)}"
            )
        beyond = tree.beyond(tree.joints[joint].child)
        if base in beyond:
            raise ParamsError(
                f"{at}.{key}: expected a {key} on the way to a tip; the base {base!r} hangs from {said!r}"
            )
        contact = _contact(name, entry.contact or FrameKeys(), tree.joints[joint].child, beyond, split)
        mounts.append(ForceTorqueMount(name, joint, entry.pose, contact))
    return tuple(mounts)


def _contact(name: str, place: FrameKeys, child: str, beyond: set[str], split: LinkSplit | None) -> Mount:
    """The frame that takes the external wrench; the link that a sensor divides stands for its part beyond."""
    link = place.link or child
    if split is not None and link == split.link:
        link = split.beyond
    if link not in beyond:
        raise ParamsError(
            f"force_torque.{name}.contact.link: expected a link beyond the sensor ({', '.join(sorted(beyond))}), got "
            f"{link!r}{did_you_mean(link, beyond)}"
        )
    return Mount(name, link, place.pose)
