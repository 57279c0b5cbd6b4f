"""A link in two parts, for a force/torque sensor inside it that no joint of the URDF stands for."""

import copy
import xml.etree.ElementTree as ET
from dataclasses import dataclass


@dataclass(frozen=True)
class LinkSplit:
    """A sensor inside a link: the part beyond it hangs on a fixed joint, and so does all that hung on the link.

    The two parts share the link's mass m and inertia I about its centre of mass c:

        this side    (1 - s) m, (1 - s) I      beyond    s m, s I      both at c

    so that both together are the link. The part beyond has the link's frame.

    Attributes:
        link: The link, and the name of the part on the base's side.
        sensor: Name of the sensor.
        share: s, of the link's mass beyond the sensor, in [0, 1].
    """

    link: str
    sensor: str
    share: float

    @property
    def joint(self) -> str:
        """Name of the fixed joint that carries the sensor."""
        return f"{self.sensor}_inside_{self.link}"

    @property
    def beyond(self) -> str:
        """Name of the part beyond the sensor."""
        return f"{self.link}_beyond_{self.sensor}"

    def apply(self, root: ET.Element) -> None:
        """Split the link in the URDF `root`, which has it."""
        link = next(each for each in root.findall("link") if each.get("name") == self.link)
        part = ET.Element("link", {"name": self.beyond})
        part.extend(copy.deepcopy(inertial) for inertial in link.findall("inertial"))
        _scale(part, self.share)
        _scale(link, 1.0 - self.share)
        for parent in root.iterfind("joint/parent"):
            if parent.get("link") == self.link:
                parent.set("link", self.beyond)
        joint = ET.Element("joint", {"name": self.joint, "type": "fixed"})
        ET.SubElement(joint, "parent", {"link": self.link})
        ET.SubElement(joint, "child", {"link": self.beyond})
        root.extend([part, joint])


def _scale(link: ET.Element, share: float) -> None:
    """Mass and moments of inertia times `share`; without an inertial where nothing is left."""
    for inertial in link.findall("inertial"):
        if share == 0.0:
            link.remove(inertial)
            continue
        for entry in (*inertial.findall("mass"), *inertial.findall("inertia")):
            for key, value in entry.attrib.items():
                entry.set(key, repr(share * float(value)))
