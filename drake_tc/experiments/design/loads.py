"""Known masses that are hung on a joint for an experiment: what they change, and how a rig file declares them.

A mass m at an arm r along the link hangs beside what the joint carries already, so that

    tau = (J_l + m r^2) qddot + m_0 g l sin(q - zero) + m g r sin(q - hang) + c

and both hang at the same position where the joint carries a pendulum. Of a joint that slides, a mass adds its inertia
and the share of its weight that acts along the axis, as the load so far shows it: tau = (M + m)(qddot + c/M).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.search import MARGIN
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.rig import Rig
from drake_tc.types import GRAVITY

MOST_LOADS = 6
"""Loads among which a design chooses."""
SHOWN = 0.05
"""Share of the joint's largest torque from which on its gravity shows where its link hangs."""
KINDS = ("torque", "pendulum")
"""Kinds of load beside which a rig file can have known masses: a diagnosis then knows the load of every log."""


@dataclass(frozen=True)
class KnownLoad:
    """A mass that the user hangs on the joint.

    Attributes:
        mass: [kg]; 0 for the joint as it is.
        arm: Distance of its centre from the axis [m]; 0 for a joint that slides.
        hangs: Position at which it hangs straight down [rad]; None for that of the link.
    """

    mass: float
    arm: float = 0.0
    hangs: float | None = None

    @property
    def text(self) -> str:
        """As on the command line."""
        parts = [self.mass, *([self.arm] if self.arm else []), *([] if self.hangs is None else [self.hangs])]
        return "@".join(f"{part:g}" for part in parts)

    @property
    def words(self) -> str:
        """In a sentence."""
        if not self.mass:
            return "no added mass"
        return f"{self.mass:g} kg at {self.arm:g} m" if self.arm else f"{self.mass:g} kg"


def parse_loads(texts: Sequence[str]) -> tuple[KnownLoad, ...]:
    """The loads of the command line: MASS@ARM or MASS@ARM@ANGLE [kg, m, rad], MASS of a joint that slides, or 0.

    Raises:
        ParamsError: Another text, a mass or an arm that is not positive, a load twice, none beside 0, or too many.
    """
    loads = tuple(_parsed(text) for text in texts)
    twice = next((load for i, load in enumerate(loads) if load in loads[:i]), None)
    if twice is not None:
        raise ParamsError(f"--load {twice.text}: named twice")
    if loads and not any(load.mass for load in loads):
        raise ParamsError("--load 0: expected at least one load beside 0, such as --load 0 --load 1.5@0.3")
    if len(loads) > MOST_LOADS:
        raise ParamsError(f"--load: expected at most {MOST_LOADS} loads, got {len(loads)}")
    return loads


def _parsed(text: str) -> KnownLoad:
    expected = "expected MASS@ARM in kg and m, such as 1.5@0.3, MASS of a prismatic joint, or 0"
    try:
        values = [float(part) for part in text.split("@")]
    except ValueError:
        raise ParamsError(f"--load {text}: {expected}") from None
    if not all(map(math.isfinite, values)) or len(values) > 3:
        raise ParamsError(f"--load {text}: {expected}")
    if values[0] < 0.0:
        raise ParamsError(f"--load {text}: expected a mass of at least 0 kg, got {values[0]:g}")
    if len(values) > 1 and not values[1] > 0.0:
        raise ParamsError(f"--load {text}: expected an arm above 0 m, got {values[1]:g}")
    return KnownLoad(*values) if values[0] else KnownLoad(0.0)


def require_usable(joint: DesignJoint, loads: Sequence[KnownLoad], limits: JointLimits) -> None:
    """Refuse loads that a diagnosis of this joint could not know, or that the limits do not let it hold.

    Raises:
        ParamsError: One line.
    """
    units, kind, slides = limits.units, joint.context.load, joint.context.joint_type == "prismatic"
    if kind not in KINDS:
        raise ParamsError(
            f"--load: joint {joint.name}: a diagnosis knows the added mass of a log only where the rig file has load: "
            f"torque or load: {{pendulum: ...}}, and this joint has load: {kind}; declare one of them"
        )
    for load in loads:
        if load.mass and slides and load.arm:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name} is prismatic; expected MASS in kg without an arm"
            )
        if load.mass and not slides and not load.arm:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: the arm is missing; expected MASS@ARM in kg and m, such as "
                f"{load.mass:g}@0.3"
            )
        if load.hangs is not None and kind == "pendulum" and abs(load.hangs - joint.zero) > 1e-6:
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: the rig file has one zero for all logs, where its pendulum "
                f"hangs: {joint.zero:.3g} rad; expected a mass that hangs there too"
            )
        needed = carrying(joint, load).least_torque(*limits.position)
        if needed > limits.with_margin(MARGIN).torque:
            unit, at = units.text("N m"), units.position
            raise ParamsError(
                f"--load {load.text}: joint {joint.name}: holding this load within {limits.position[0]:.3g} to "
                f"{limits.position[1]:.3g} {at} and overcoming friction needs {needed:.3g} {unit}, and the torque "
                f"limit is {limits.torque:.3g} {unit}; hang less, narrow --position, or give the torque limit of the "
                "motor with --torque"
            )


def hang_angle(joint: DesignJoint, load: KnownLoad) -> float:
    """Position at which an added mass hangs straight down [rad]: where the link hangs, 0 where that is not known."""
    if load.hangs is not None:
        return load.hangs
    known = joint.context.load == "pendulum" or joint.gravity > SHOWN * joint.numbers.torque
    return joint.zero if known else 0.0


def carrying(joint: DesignJoint, load: KnownLoad) -> DesignJoint:
    """The joint with an added mass; noise, friction and the sizes of effects stay."""
    if not load.mass:
        return joint
    if joint.context.joint_type == "prismatic":
        along = np.clip(joint.constant / joint.link_inertia, -GRAVITY, GRAVITY) if joint.link_inertia > 0.0 else 0.0
        more = joint.constant + load.mass * float(along)
        return replace(joint, link_inertia=joint.link_inertia + load.mass, constant=more)
    weight = load.mass * GRAVITY * load.arm
    both = joint.gravity * np.exp(1j * joint.zero) + weight * np.exp(1j * hang_angle(joint, load))
    return replace(
        joint,
        link_inertia=joint.link_inertia + load.mass * load.arm**2,
        gravity=float(abs(both)),
        zero=float(np.angle(both)),
    )


def trial_load(joint: DesignJoint) -> KnownLoad | None:
    """A load that doubles the joint's torque, to try whether known loads would help; None where none can be used."""
    if joint.context.load not in KINDS:
        return None
    torque = max(joint.numbers.torque, 1e-6)
    if joint.context.joint_type == "prismatic":
        return KnownLoad(torque / GRAVITY)
    return KnownLoad(torque / (GRAVITY * 0.3), 0.3)


def declaring(rig: Rig, joint: str, loads: Sequence[tuple[str, KnownLoad]]) -> Rig | None:
    """The rig with the masses of further logs; None where it stays as it is, because a sensor measures the load.

    Args:
        rig: Of the logs so far, whose masses it keeps.
        joint: Which.
        loads: (pattern of the logs' names, load).
    """
    base = rig.load[joint]
    if not isinstance(base, Pendulum):
        return None
    first = replace(base, by_run=())
    runs = [(pattern, _together(first, load)) for pattern, load in loads]
    runs += list(base.by_run) or [("*", first)]
    return replace(rig, load={**rig.load, joint: replace(runs[0][1], by_run=tuple(runs))})


def _together(pendulum: Pendulum, load: KnownLoad) -> Pendulum:
    """A pendulum with a mass added, to six digits."""
    mass = pendulum.mass + load.mass
    length = (pendulum.mass * pendulum.length + load.mass * load.arm) / mass
    inertia = pendulum.inertia + load.mass * load.arm**2
    mass, length, inertia = (float(f"{value:.6g}") for value in (mass, length, inertia))
    return Pendulum(mass, length, inertia, pendulum.zero)
