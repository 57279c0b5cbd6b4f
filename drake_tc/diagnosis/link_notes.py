"""What else may be behind an error of a link that was found: one small record a kind."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LoadInAllRuns:
    """A mass that is larger than the link itself, as a load in all runs is.

    Attributes:
        link: Where it was found. mass: found beyond the robot file's [kg]. own: that of the robot file [kg].
    """

    link: str
    mass: float
    own: float


@dataclass(frozen=True)
class ZeroOrCentre:
    """A shifted centre of mass, which a wrong zero of the encoder before the link imitates.

    Attributes:
        link: Whose centre of mass. joint: that moves the link.
    """

    link: str
    joint: str


LinkNote = LoadInAllRuns | ZeroOrCentre
