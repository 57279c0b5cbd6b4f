"""The sensors of a robot file: where IMUs and force/torque sensors sit."""

from collections.abc import Mapping
from typing import Any

from drake_tc.config.near import near
from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.robot.mounts import ForceTorqueMount, Mount
from drake_tc.robot.split_link import LinkSplit
from drake_tc.robot.urdf_tree import UrdfTree


def check_link(where: str, link: str, tree: UrdfTree) -> str:
    """The link's name.

    Raises:
        ParamsError: The URDF has no such link; with the nearest match.
    """
    if link not in tree.links:
        listed = f"links: {', '.join(tree.links)}"
        raise ParamsError(f"{where}: no link {link!r} in the URDF{near(link, tree.links)}; {listed}")
    return link


def imu_mounts(where: str, entry: object, tree: UrdfTree) -> tuple[Mount, ...]:
    """IMUs, each on a link, or on the child link of a joint.

    Raises:
        ParamsError: A link or joint that the URDF does not have, both or neither of them, or an unknown key.
    """
    mounts = []
    for name, value in fields.mapping(where, entry, optional=None).items():
        at = f"{where}.{name}"
        given = fields.mapping(at, value, (), ("link", "joint", "xyz", "rpy"))
        if _parent(at, given) == "joint":
            joint = fields.text(f"{at}.joint", given["joint"])
            if joint not in tree.joints:
                raise ParamsError(f"{at}.joint: no joint {joint!r} in the URDF{near(joint, tree.joints)}")
            link = tree.joints[joint].child
        else:
            link = check_link(at, fields.text(f"{at}.link", given["link"]), tree)
        mounts.append(Mount(name, link, fields.pose(at, given)))
    return tuple(mounts)


def link_splits(where: str, entry: object, tree: UrdfTree) -> tuple[LinkSplit, ...]:
    """Links that force/torque sensors inside them divide.

    Args:
        where: Key, for messages.
        entry: `force_torque` of the robot file.
        tree: The URDF as it is.

    Raises:
        ParamsError: A link that the URDF does not have or that has two sensors, or a share of its mass that is missing
            or not between 0 and 1.
    """
    splits: dict[str, LinkSplit] = {}
    for name, value in fields.mapping(where, entry, optional=None).items():
        at = f"{where}.{name}"
        given = _force_torque_keys(at, value)
        if _parent(at, given) == "joint":
            if "mass_beyond" in given:
                raise ParamsError(f"{at}.mass_beyond: only with `link`; the mass beyond a joint is in the URDF")
            continue
        link = check_link(f"{at}.link", fields.text(f"{at}.link", given["link"]), tree)
        if "mass_beyond" not in given:
            raise ParamsError(f"{at}: missing key 'mass_beyond'; wanted the share of {link}'s mass beyond the sensor")
        share = fields.number(f"{at}.mass_beyond", given["mass_beyond"])
        if not 0.0 <= share <= 1.0:
            raise ParamsError(f"{at}.mass_beyond: wanted a share between 0 and 1; got {share:g}")
        if link in splits:
            raise ParamsError(f"{at}.link: {link!r} has the sensor {splits[link].sensor!r} already; wanted one a link")
        splits[link] = LinkSplit(link, name, share)
    return tuple(splits.values())


def force_torque_mounts(
    where: str,
    entry: object,
    joints: tuple[str, ...],
    base: str,
    tree: UrdfTree,
    splits: tuple[LinkSplit, ...],
) -> tuple[ForceTorqueMount, ...]:
    """Force/torque sensors, each in a joint that does not move, or inside a link.

    Args:
        where: Key, for messages.
        entry: `force_torque` of the robot file.
        joints: Driven joints.
        base: Link that is welded or floats.
        tree: The URDF with its links split.
        splits: Of `link_splits`.

    Raises:
        ParamsError: A joint that moves, is not there or carries the base, or a contact that is not beyond the sensor.
    """
    inside = {split.sensor: split for split in splits}
    mounts = []
    for name, value in fields.mapping(where, entry, optional=None).items():
        at = f"{where}.{name}"
        given = _force_torque_keys(at, value)
        split = inside.get(name)
        key = "joint" if split is None else "link"
        joint = fields.text(f"{at}.joint", given["joint"]) if split is None else split.joint
        if joint not in tree.joints or joint in joints:
            rigid = [other for other in tree.joints if other not in joints]
            raise ParamsError(
                f"{at}.joint: wanted a joint that does not move; got {joint!r}{near(joint, rigid)}; possible: "
                f"{', '.join(rigid)}"
            )
        beyond = tree.beyond(tree.joints[joint].child)
        if base in beyond:
            raise ParamsError(
                f"{at}.{key}: the base {base!r} hangs from {given[key]!r}; wanted a {key} on the way to a tip"
            )
        contact = _contact(name, at, given, tree.joints[joint].child, beyond, split)
        mounts.append(ForceTorqueMount(name, joint, fields.pose(at, given), contact))
    return tuple(mounts)


def _contact(
    name: str, at: str, given: Mapping[str, Any], child: str, beyond: set[str], split: LinkSplit | None
) -> Mount:
    """The frame that takes the external wrench; the link that a sensor divides stands for its part beyond."""
    place = fields.mapping(f"{at}.contact", given.get("contact"), (), ("link", "xyz", "rpy"))
    link = fields.text(f"{at}.contact.link", place.get("link", child))
    if split is not None and link == split.link:
        link = split.beyond
    if link not in beyond:
        raise ParamsError(
            f"{at}.contact.link: wanted a link beyond {given.get('joint', given.get('link'))!r} "
            f"({', '.join(sorted(beyond))}); got {link!r}"
        )
    return Mount(name, link, fields.pose(f"{at}.contact", place))


def _force_torque_keys(at: str, value: object) -> dict[str, Any]:
    return fields.mapping(at, value, (), ("joint", "link", "mass_beyond", "xyz", "rpy", "contact"))


def _parent(at: str, given: Mapping[str, Any]) -> str:
    """Which of `joint` and `link` is given."""
    if ("joint" in given) == ("link" in given):
        got = "both" if "joint" in given else "neither"
        raise ParamsError(f"{at}: wanted one of the keys 'joint' and 'link'; got {got}")
    return "joint" if "joint" in given else "link"
