"""Damaged URDFs: attributes and elements of a sound one changed, repeated, moved or taken away."""

import copy
import xml.etree.ElementTree as ET
from random import Random

from .odd import damage_bytes

VALUES = (
    *("abc", "nan", "inf", "-3.2", "-1", "0", "", " ", "1e308", "1e-300", "1 2", "1 2 3 4", "nan nan nan", "0 0 0"),
    *("thigh", "hip", "base", "world", "[/x]", "\u202e", "é", "floating", "planar", "ball", "mimic", "x" * 5000, "1,5"),
    *("9" * 5000, "true", "../../x", "package://x/y.stl", "fixed", "continuous", "prismatic"),
)


def damaged_urdf(text: str, rng: Random) -> bytes:
    """The URDF with one to three odd places; one in five has odd bytes instead."""
    if rng.random() < 0.2:
        return damage_bytes(text.encode(), rng)
    root = ET.fromstring(text)
    for _ in range(rng.choice((1, 1, 2, 3))):
        _change(root, rng)
    return ET.tostring(root)


def _change(root: ET.Element, rng: Random) -> None:
    parent = rng.choice([element for element in root.iter() if len(element)])
    child = rng.choice(list(parent))
    how = rng.randrange(8)
    if how < 4:
        holders = [element for element in root.iter() if element.attrib]
        holder = rng.choice(holders)
        name = rng.choice(list(holder.attrib))
        if how == 3:
            del holder.attrib[name]
        else:
            holder.set(name, rng.choice(VALUES))
    elif how == 4:
        parent.remove(child)
    elif how == 5:
        parent.append(copy.deepcopy(child))
    elif how == 6:
        child.tag = rng.choice(("joint", "link", "inertial", "mass", "xacro:if", "mimic", "origin", "robot"))
    else:
        tag = rng.choice(("mimic", "limit", "dynamics", "transmission", "collision", "visual", "mass"))
        odd = {name: rng.choice(VALUES) for name in ("value", "lower", "effort")}
        ET.SubElement(parent, tag, {"joint": "hip", **odd})
