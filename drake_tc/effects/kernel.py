"""An effect at one joint and one instant, compiled for simulation: the same equation on plain floats.

A simulation evaluates every effect at every tick, where arrays of one joint would cost more than the physics. So an
effect hands out a *kernel*: an `EquationKernel`, which runs compiled, or any closure over its parameters. A test holds
kernels and `Effect.columns` together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from drake_tc.kernels.joint_layout import INTERPRETED
from drake_tc.kernels.torque_equations import EQUATIONS, JointState

TorqueParts: TypeAlias = tuple[float, float, float]
"""(level [N m], damping [N m s/rad], rest [N m]): torque = level * direction + damping * velocity + rest.

Friction is split so that the simulation can hold it implicitly: `level` acts through a bristle that winds up before
it slides, `damping` on the velocity at the end of the step, and `rest` (springs, ripple, gravity) as it stands.
"""

TorqueKernel: TypeAlias = Callable[[float, float, float, float, float, float], TorqueParts]
"""(position, velocity, direction, load torque, temperature, hysteresis) to TorqueParts; `hysteresis` is the state in
[-1, 1] of an effect that has one (`TorqueEffect.hysteresis_travel`), else 0."""


@dataclass(frozen=True)
class EquationKernel:
    """A `TorqueKernel` whose equation the simulation and the compensation have compiled.

    Attributes:
        kind: Of the equation (`drake_tc.kernels.torque_equations`).
        numbers: Its numbers.
    """

    kind: int
    numbers: tuple[float, ...]

    def __call__(self, *now: float) -> TorqueParts:
        """The equation on plain floats, those of a `JointState`."""
        level, damping, rest = EQUATIONS[self.kind](JointState(*now), self.numbers)
        return float(level), float(damping), float(rest)


class DriveSurroundings(NamedTuple):
    """What a drive of one joint sees at one instant, beside its command.

    Attributes:
        position: [rad].
        velocity: [rad/s].
        celsius: Temperature [deg C].
        supply: Voltage [V].
    """

    position: float
    velocity: float
    celsius: float
    supply: float


@dataclass(frozen=True)
class DriveKernel:
    """A drive effect sampled at a fixed period, for one joint.

    Attributes:
        size: How many numbers it remembers.
        start: (value, raw effort) to the memory of a drive that has always seen these.
        step: (value, raw effort, direction, memory, at) to the value passed on; the effect's memory is
            `memory[at : at + size]` and is overwritten with the next one.
        observe: (surroundings, memory, at), called before `step` at every sample, writes into the memory what `step`
            needs to know of them; None where it needs none.
        kind: Of the compiled equation that is the same as `step` (`drake_tc.kernels.joint_layout`).
        numbers: Its parameters, three at most.
    """

    size: int
    start: Callable[[float, float], list[float]]
    step: Callable[[float, float, float, list[float], int], float]
    observe: Callable[[DriveSurroundings, list[float], int], None] | None = None
    kind: int = INTERPRETED
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True)
class InverseLaw:
    """What to ask of a drive, of one joint at one instant.

    Attributes:
        invert: (desired effort, position [rad], direction) to the effort to ask for.
        kind: Of the compiled equation that is the same (`drake_tc.kernels.joint_layout`).
        number: Its parameter.
    """

    invert: Callable[[float, float, float], float]
    kind: int = INTERPRETED
    number: float = 0.0


@dataclass(frozen=True)
class Transmission:
    """Play and softness between motor and link.

    Attributes:
        half_gap: Half of the free play [rad].
        compliance: Of the closed gear [rad/(N m)], > 0.
    """

    half_gap: float
    compliance: float


def memoryless(
    step: Callable[[float, float, float], float], kind: int = INTERPRETED, numbers: tuple[float, ...] = ()
) -> DriveKernel:
    """A kernel without memory from (value, raw effort, direction) to the value passed on."""

    def run(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
        return step(value, effort, direction)

    return DriveKernel(size=0, start=lambda value, effort: [], step=run, kind=kind, numbers=numbers)
