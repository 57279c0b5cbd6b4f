"""Actuators of an MJCF file as MuJoCo compiles them: every kind but a motor on a voltage and a PID is one equation.

    force = gain a + b0 + b1 gear q + b2 gear v,   torque = gear clip(force),   a: the command, or its filtered value

Default classes hand on these numbers from an actuator of one kind to those of another; that this happens as in MuJoCo
is tested by files that are drawn at random.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field

from drake_tc.simulator_files.xml_tree import Defaults, finite, place

AFFINE = ("general", "motor", "position", "velocity", "intvelocity")
"""Kinds of actuator that are one equation."""
ACTUATORS = (*AFFINE, "damper", "cylinder", "muscle", "adhesion", "dcmotor", "pid", "orientation", "plugin")
FIELDS = (
    *("gear", "ctrlrange", "ctrllimited", "forcerange", "forcelimited", "delay", "nsample", "damping", "armature"),
    *("group", "interp", "actrange", "actlimited", "lengthrange", "cranklength", "actearly"),
)
"""Attributes that a default class hands on from an actuator of one kind to those of all kinds."""
TOLERANCE = 1e-9


@dataclass
class Actuator:
    """One actuator.

    Attributes:
        element: Of the file.
        kind: Its tag.
        gain: Force for one unit of the command; None: it has another equation.
        bias: (b0, b1, b2).
        dynamics: none, integrator, filter, filterexact or another of MuJoCo's.
        time_constant: Of a filter [s].
        values: Attributes, those of default classes among them.
        enabled: Whether its group is not switched off.
        number: Its place among the actuators of the file, which is that in MuJoCo's model.
    """

    element: ET.Element
    kind: str
    gain: float | None = 1.0
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dynamics: str = "none"
    time_constant: float = 1.0
    values: dict[str, str] = field(default_factory=dict)
    enabled: bool = True
    number: int = 0

    def numbers(self, name: str) -> list[float]:
        """The numbers of an attribute."""
        return finite(self.element, name, self.values.get(name, ""))

    def first(self, name: str, absent: float = 0.0) -> float:
        """The first number of an attribute."""
        return (self.numbers(name) or [absent])[0]

    @property
    def name(self) -> str:
        """The actuator for people."""
        return place(self.element)

    @property
    def gear(self) -> float:
        """Its first number."""
        return self.first("gear", 1.0)

    @property
    def is_servo(self) -> bool:
        """Whether the force is kp (a - gear q) - kv gear v."""
        return (
            self.gain is not None and self.gain != 0.0 and abs(self.bias[1] + self.gain) <= TOLERANCE * abs(self.gain)
        )

    @property
    def damping_ratio(self) -> float:
        """A ratio from which MuJoCo computes the damping of a servo; 0 where the file has the damping itself."""
        if self.kind == "pid":
            return 0.0 if self.values.get("kv") else self.first("dampratio")
        return self.bias[2] if self.is_servo and self.bias[2] > 0.0 else 0.0

    @property
    def filter(self) -> float:
        """Time constant of the command's filter [s]; 0: none."""
        return self.time_constant if self.dynamics in ("filter", "filterexact") else 0.0

    def limits(self, name: str) -> tuple[float, float] | None:
        """`forcerange` or `ctrlrange` where it acts."""
        found, limited = self.numbers(name), self.values.get(name.removesuffix("range") + "limited", "auto")
        return (found[0], found[1]) if len(found) == 2 and limited != "false" and found[0] < found[1] else None


def actuators(root: ET.Element, defaults: Defaults) -> list[Actuator]:
    """All actuators of a file, in its order."""
    elements = (each for group in root.findall("actuator") for each in group if each.tag in ACTUATORS)
    return [compiled(element, defaults, number) for number, element in enumerate(elements)]


def compiled(element: ET.Element, defaults: Defaults, number: int) -> Actuator:
    """The actuator with what its classes hand on."""
    state, values = _Compiled(), dict[str, str]()
    for each in defaults.elements(element):
        if each.tag in ACTUATORS:
            same = each.tag in (element.tag, "general") or (element.tag == "general" and each.tag in AFFINE)
            state.apply(each)
            values |= {name: text for name, text in each.attrib.items() if same or name in FIELDS}
    state.apply(element)
    values |= element.attrib
    if element.tag not in AFFINE:
        return Actuator(element, element.tag, None, values=values, number=number)
    odd = state.gaintype != "fixed" or state.biastype not in ("none", "affine")
    b0, b1, b2 = state.bias if state.biastype == "affine" else (0.0, 0.0, 0.0)
    gain = None if odd else state.gain[0]
    return Actuator(element, element.tag, gain, (b0, b1, b2), state.dyntype, state.dyn[0], values, number=number)


class _Compiled:
    """What MuJoCo's compiler has of an actuator after a few elements."""

    def __init__(self) -> None:
        self.gaintype, self.biastype, self.dyntype = "fixed", "none", "none"
        self.gain, self.bias, self.dyn = [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0]
        self.last = ""

    def apply(self, element: ET.Element) -> None:
        """Read one element over what is there."""
        get: Mapping[str, str] = element.attrib
        tag = element.tag
        if tag != "general" and self.last not in ("", "general", tag):
            self.__init__()  # type: ignore[misc]
        if tag == "general":
            for name in ("gaintype", "biastype", "dyntype"):
                setattr(self, name, get.get(name, getattr(self, name)))
            for name, array in (("gainprm", self.gain), ("biasprm", self.bias), ("dynprm", self.dyn)):
                given = finite(element, name, get.get(name, ""))[: len(array)]
                array[: len(given)] = given
        elif tag == "motor":
            self.__init__()  # type: ignore[misc]
        elif tag in ("position", "intvelocity"):
            self._servo(element, tag)
        elif tag == "velocity":
            kv = self._one(element, "kv", self.gain[0])
            self.__init__()  # type: ignore[misc]
            self.biastype, self.gain[0], self.bias[2] = "affine", kv, -kv
        self.last = tag

    def _servo(self, element: ET.Element, tag: str) -> None:
        self.gain[0] = kp = self._one(element, "kp", self.gain[0])
        self.bias[0], self.bias[1] = 0.0, -kp
        if element.get("dampratio"):
            self.bias[2] = self._one(element, "dampratio", 0.0)
        if element.get("kv"):
            self.bias[2] = -self._one(element, "kv", 0.0)
        self.gaintype, self.biastype = "fixed", "affine"
        if tag == "intvelocity":
            self.dyntype = "integrator"
        elif element.get("timeconst"):
            self.dyn[0] = self._one(element, "timeconst", 0.0)
            self.dyntype = "filterexact" if self.dyn[0] else "none"
        elif self.dyntype != "filterexact":
            self.dyntype, self.dyn[0] = "none", 1.0

    @staticmethod
    def _one(element: ET.Element, name: str, absent: float) -> float:
        return (finite(element, name, element.get(name, "")) or [absent])[0]
