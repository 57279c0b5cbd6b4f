"""Units of a joint that turns and of one that slides: the one place that decides between them.

The library writes all units for a joint that turns: position [rad], torque [N*m], inertia [kg*m^2], damping
[N*m*s/rad]. The same equations hold for a joint that slides, with a position in m and a force in N in place of the
torque, so each unit follows from the one for a joint that turns:

    N*m -> N,   kg*m^2 -> kg,   rad -> m,   1/turn -> rad/m                                                 (slides)

A wave of n periods in a turn has the phase n q. Of a position in m, n is a phase over a length.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

JointType: TypeAlias = Literal["revolute", "prismatic"]
"""Types of joints, as a URDF names them; a continuous joint is revolute."""
EFFORT_UNIT: Mapping[str, str] = {"position_servo": "rad", "current": "A", "voltage": "V", "torque": "N*m"}
"""Unit of the effort by the kind of drive, of a joint that turns."""
TORQUE = "N*m"
_SLIDES = (
    (re.compile(r"\bkg[*· ]m(?:\^2|²)"), "kg"),
    (re.compile(r"\(([mk]?)N[*· ]m\)"), r"\1N"),
    (re.compile(r"\b([mk]?)N[*· ]m\b"), r"\1N"),
    (re.compile(r"\b1/turn\b"), "rad/m"),
    (re.compile(r"\b([mµ]?)rad\b(?!/m\b)"), r"\1m"),
)


@dataclass(frozen=True)
class JointUnits:
    """The units of one joint.

    Attributes:
        joint_type: Whether the joint turns or slides.
        drive: Kind of drive, which gives the unit of the effort; empty where no effort is told.
        torque_as_effort: Whether torques are told in the unit of the effort, because nothing fixes their scale.
    """

    joint_type: JointType = "revolute"
    drive: str = ""
    torque_as_effort: bool = False

    def on(self, drive: str) -> "JointUnits":
        """The units with another kind of drive."""
        return replace(self, drive=drive)

    @property
    def slides(self) -> bool:
        """Whether the joint is prismatic."""
        return self.joint_type == "prismatic"

    @property
    def large_travel(self) -> float:
        """Travel of a joint that shows what repeats with the position [rad]; half a turn of a small gear [m]."""
        return 0.1 if self.slides else 0.5

    @property
    def effort(self) -> str:
        """Unit of the drive's effort."""
        return self.text(EFFORT_UNIT[self.drive])

    @property
    def torque(self) -> str:
        """Unit of a torque about the joint's axis, or of a force along it."""
        return self.effort if self.torque_as_effort else self.text(TORQUE)

    @property
    def position(self) -> str:
        """Unit of the position."""
        return self.text("rad")

    @property
    def gain(self) -> str:
        """Unit of the drive gain, effort for a unit of torque."""
        return f"{self.effort}/{'N' if self.slides else f'({TORQUE})'}"

    def of(self, unit: str) -> str:
        """The unit of a parameter whose unit for a joint that turns is `unit`; "effort" in it is the drive's effort.

        Where torques are told as effort, the effort's unit stands for that of the torque.
        """
        if self.drive:
            unit = unit.replace("effort", EFFORT_UNIT[self.drive])
            if self.torque_as_effort:
                told = EFFORT_UNIT[self.drive]
                unit = unit.replace("kg*m^2", f"{told}*s^2/rad").replace("(N*m)", told).replace("N*m", told)
        return self.text(unit)

    def text(self, text: str) -> str:
        """A text with units for a joint that turns, such as "0.3 N*m at 2 rad/s", with those of this joint."""
        return in_units_of(self.joint_type, text)


TURNING = JointUnits()
"""Of a joint that turns."""


def in_units_of(joint_type: JointType, text: str) -> str:
    """A text with units for a joint that turns, with those of a joint of this type: see (slides)."""
    if joint_type == "revolute":
        return text
    for pattern, unit in _SLIDES:
        text = pattern.sub(unit, text)
    return text
