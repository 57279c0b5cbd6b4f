"""What else may be behind the mass of a link that was found."""

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
