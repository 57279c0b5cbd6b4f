"""A parameter of an effect: its unit, the bounds of its fit, and where its value is physically possible."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from drake_tc.config.joint_units import JointType
from drake_tc.types import FloatArray

Scale = Literal[
    "one", "effort", "torque", "torque/speed", "torque/speed^2", "torque/span", "load", "load/duration", "speed",
    "span", "1/torque", "effort/speed", "effort/supply", "coulomb", "viscous",
]  # fmt: skip
"""The quantity of the rig by which a plausible range is multiplied; `Context.scale` computes it."""
Values: TypeAlias = Mapping[str, FloatArray | float]
"""Values of parameters by name, each one number or one a joint."""


@dataclass(frozen=True)
class Plausible:
    """The range in which a parameter is physically possible: lower * scale <= value <= upper * scale.

    The bounds of a fit keep the arithmetic sound and may be wide. This range decides whether a value that was fitted
    may be reported as a cause.

    Attributes:
        lower, upper: Limits, inclusive, in units of `scale`.
        source: Why the range is what it is: a law, a definition, a data sheet or a publication.
        scale: What the limits are multiplied by.
        sliding: The range of a joint that slides, where it is another one.
    """

    lower: float
    upper: float
    source: str
    scale: Scale = "one"
    sliding: "Plausible | None" = None

    def on(self, joint_type: JointType) -> "Plausible":
        """The range of a joint of this type."""
        return self.sliding if self.sliding is not None and joint_type == "prismatic" else self


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its unit, where it may lie, and what it is before any data speak.

    Attributes:
        name: As it stands in YAML files and reports.
        unit: SI, as text, of a joint that turns (`drake_tc.config.joint_units` gives that of one that slides); "effort"
            means the unit of the drive's effort.
        lower, upper: Bounds of the fit, inclusive; an estimate that rests on one is reported `at_bound`.
        default: Value of a model that names the effect without this parameter.
        description: One line for reports and docs.
        plausible: Where the value is physically possible (`drake_tc.effects.plausibility`). None for a coefficient
            of a fit that no report shows.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    default: float = 0.0
    description: str = ""
    plausible: Plausible | None = None
