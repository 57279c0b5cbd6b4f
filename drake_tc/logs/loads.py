"""Where the load torque of a joint comes from when no sensor at it measures it: a pendulum, a model, or unknown."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal, TypeAlias

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import LogError
from drake_tc.logs.record import Run
from drake_tc.types import GRAVITY, FloatArray


@dataclass(frozen=True)
class Pendulum:
    """A rigid pendulum on the joint.

    Its torque on the link side is  tau = inertia qddot + mass g length sin(q - zero)  [N m].

    Attributes:
        mass: [kg], > 0.
        length: From the axis to the centre of mass [m], > 0.
        inertia: About the axis [kg m^2]; a point mass's m l^2 when not given.
        zero: Joint position at which it hangs [rad].
        by_run: (pattern of file names, pendulum) of runs with different masses; the first pattern that fits counts.
            This pendulum is then the first of them. Empty where all runs have this one.
    """

    mass: float
    length: float
    inertia: float = float("nan")
    zero: float = 0.0
    by_run: tuple[tuple[str, "Pendulum"], ...] = ()

    def __post_init__(self) -> None:
        if np.isnan(self.inertia):
            object.__setattr__(self, "inertia", self.mass * self.length**2)
        for name in ("mass", "length", "inertia"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, got {value!r}")
        if not np.isfinite(self.zero):
            raise ValueError(f"zero must be a finite angle [rad], got {self.zero!r}")

    def in_run(self, run: Run) -> "Pendulum":
        """The pendulum of one run.

        Raises:
            LogError: No pattern fits the name of its file.
        """
        if not self.by_run:
            return self
        name = run.file_name
        for pattern, pendulum in self.by_run:
            if fnmatchcase(name, pattern) or fnmatchcase(run.name, pattern):
                return pendulum
        patterns = [pattern for pattern, _ in self.by_run]
        raise LogError(
            f"{run.source or run.name}: no mass: the name fits none of the patterns of load.pendulum.mass "
            f"({', '.join(patterns)}){did_you_mean(run.name, patterns)}; "
            "add the file, or the pattern '*', to the rig file"
        )

    @property
    def weight(self) -> float:
        """Largest torque of gravity m g l [N m]."""
        return self.mass * GRAVITY * self.length

    def torque(self, position: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Link-side torque (T,) [N m] at q (T,) [rad] and qddot (T,) [rad/s^2]."""
        gravity = self.weight * np.sin(position - self.zero)
        return np.asarray(self.inertia * acceleration + gravity)


RobotMethod = Literal["estimate", "inverse_dynamics", "fitted"]


@dataclass(frozen=True)
class RobotLoad:
    """Torques from the model of the whole robot that the rig file names.

    Attributes:
        method: "estimate": encoders, IMU and F/T sensors (Del Prete et al., 2016, Algorithm 1); "inverse_dynamics":
            encoders and, where there is one, the IMU, for a robot that nothing touches or whose F/T sensors are not in
            the way; "fitted": the same, but the links' inertial parameters are fitted together with the joints' models.
        tolerance: Of a fitted robot: standard deviation of a link's mass as a share of the file's; its first moments
            and inertia follow with the link's size (`robot.link_parameters`).
        gain_tolerance: Of a fitted robot: standard deviation of the common relative error of the declared drive gains.
        payload: Of a fitted robot: names of the logs in which a link carries a load that is not known.
        carrier: That link; empty for the robot's only outermost link.
    """

    method: RobotMethod = "estimate"
    tolerance: float = 1.0
    gain_tolerance: float = 0.0
    payload: tuple[str, ...] = ()
    carrier: str = ""

    @property
    def fitted(self) -> bool:
        """Whether the links' parameters are fitted."""
        return self.method == "fitted"


UnknownForm = Literal["pendulum", "smooth"]


@dataclass(frozen=True)
class UnknownLoad:
    """A load of which nothing is measured and nothing is declared but its form.

    In a rig file: `load: {unknown: smooth}`. The form "pendulum" is written, and kept, as the word "unknown".

    Attributes:
        form: "pendulum": J qddot + m g l sin(q - zero) + c of unknown J, m l, zero and c; "smooth": J qddot plus a
            smooth function of the position.
    """

    form: UnknownForm = "pendulum"


Load: TypeAlias = Literal["torque", "unknown"] | Pendulum | RobotLoad | UnknownLoad


def unknown_form(load: Load) -> UnknownForm | None:
    """The form of an unknown load; None where the load is known."""
    if isinstance(load, UnknownLoad):
        return load.form
    return "pendulum" if load == "unknown" else None
