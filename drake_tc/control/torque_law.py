"""The law of `TorqueControl` on arrays: one tick as a plain function of state and inputs.

`CompensationSpec`: the signals from which a torque controller computes friction and rotor inertia.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from drake_tc.actuation.compensator import Compensator
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import SOLVE, Kernel, KernelCall
from drake_tc.kernels.torque_equations import LIMIT, REFERENCE_CELSIUS, SERVO, JointState
from drake_tc.types import FloatArray

Source = Literal["estimate", "reference"]
AccelerationSource = Literal["none", "estimate", "reference"]


@dataclass(frozen=True)
class CompensationSpec:
    """Which motion the actuators' effects are compensated for.

    Estimates are delayed, and compensating friction with them feeds back; references are neither.

    Attributes:
        velocity: Velocity for viscous friction and similar effects; Del Prete et al. (2016) use the estimate.
        direction: Direction for dry friction and for drives whose gain depends on the direction,
            tanh(v/direction_speed).
        acceleration: Acceleration for the rotor inertia; `none`: not compensated.
        direction_speed: Speed v_s > 0 [rad/s] at which 76 % of the dry friction are compensated.
        smoothing: Smoothing of the inverse of dead zones and play, one number or one per joint [effort]
            (`Compensator`).

    Raises:
        ParamsError: an unknown key or a number that is not possible.

    Example:
        >>> CompensationSpec(velocity="reference").needs_reference
        True
    """

    velocity: Source = "estimate"
    direction: Source = "reference"
    acceleration: AccelerationSource = "reference"
    direction_speed: float = 0.01
    smoothing: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        for key, possible in (
            ("velocity", get_args(Source)),
            ("direction", get_args(Source)),
            ("acceleration", get_args(AccelerationSource)),
        ):
            if getattr(self, key) not in possible:
                raise ParamsError(
                    f"compensation.{key}: expected one of {', '.join(possible)}, got {getattr(self, key)!r}"
                )
        if not (math.isfinite(self.direction_speed) and self.direction_speed > 0.0):
            raise ParamsError(
                f"compensation.direction_speed: expected a positive speed [rad/s], got {self.direction_speed!r}"
            )

    @property
    def needs_reference(self) -> bool:
        """Whether the `reference` port is needed."""
        return "reference" in (self.velocity, self.direction, self.acceleration)


_SOLVE = Kernel("torque_control", "solve")
SOLUTION = ("command", "asked", "torque", "effort", "integral", "commanded_torque")
"""Rows of `solution`: what goes out [effort]; u, tau* - d [N m]; y [effort]; Ki s and tau* [N m]."""


class TorqueLaw:
    """y[n] and s[n+1] of `drake_tc.control.torque_control.TorqueControl`; holds no changing data."""

    def __init__(self, compensator: Compensator, spec: CompensationSpec, limit: FloatArray, dt: float) -> None:
        """Build the tables.

        Args:
            compensator: The drives' models.
            spec: Which motion they are fed with.
            limit: (n,) tau_max [N m].
            dt: Period of the integral [s].
        """
        self._compensator, self._limit, self._dt = compensator, limit, dt
        rows, inverses, terms, values = compensator.tables
        rows[:, LIMIT] = limit
        choices = ("estimate", "reference", "none")
        sources = np.array([choices.index(each) for each in (spec.velocity, spec.direction, spec.acceleration)])
        self._constants = sources, 1.0 / spec.direction_speed
        self._tables = rows, inverses, terms, values

    def solve(self, out: FloatArray, given: tuple[FloatArray, ...]) -> None:
        """One tick.

        Args:
            out: (6n,) written, the rows of SOLUTION.
            given: Desired and estimated torque (n,), position (n,), estimate (3n,), reference (3n,) or (0,),
                disturbance (n,) or (0,), [Kp; Ki] and s[n] (n,).
        """
        _SOLVE(tuple(given), *self._constants, self._tables, out)
        if self._compensator.interpreted and math.isfinite(out[0]):
            self._interpret(out.reshape(len(SOLUTION), -1), given[2], given[3], given[4])

    def bind(self, out: FloatArray, given: tuple[FloatArray, ...]) -> Callable[[float], object]:
        """`solve` on arrays that stay the same objects, as a function of the time [s]; arguments as there."""

        def outputs(time: float) -> None:
            self.solve(out, given)

        if self._compensator.interpreted:
            return outputs
        return KernelCall(SOLVE, outputs, *given, *self._constants, *self._tables, out)

    def _interpret(self, rows: FloatArray, position: FloatArray, estimate: FloatArray, reference: FloatArray) -> None:
        """Command and effort of the joints that have an effect without compiled equation."""
        n, (sources, per_speed), joints = self._limit.size, self._constants, self._tables[0]
        motion = np.zeros((3, 3 * n))
        motion[0], motion[1] = estimate, reference if reference.size else 0.0
        velocity, turning = motion[sources[0], n : 2 * n], motion[sources[1], n : 2 * n]
        acceleration = motion[sources[2], 2 * n :]
        for j in self._compensator.interpreted:
            direction = math.tanh(turning[j] * per_speed)
            q, v, tau = float(position[j]), float(velocity[j]), float(rows[5, j])
            now = JointState(q, v, direction, tau, REFERENCE_CELSIUS, direction)
            effort = self._compensator.effort_of(j, now, float(acceleration[j]))
            rows[0, j], rows[3, j] = joints[j, SERVO] * position[j] + effort, effort

    def next_sum(self, before: FloatArray, error: FloatArray, gains: FloatArray, solution: FloatArray) -> FloatArray:
        """(n,) s[n+1].

        Args:
            before: (n,) s[n].
            error: (n,) tau_d - tau_hat.
            gains: (2n,) [Kp; Ki].
            solution: (6, n) the rows of SOLUTION.
        """
        n, (_, asked, torque, *_) = self._limit.size, solution
        if not np.isfinite(asked[0]):
            return before
        moves = ~((asked != torque) & (asked * error > 0.0)) & (gains[n:] > 0.0)
        after = before + self._dt * np.where(moves, error, 0.0)
        bound = np.divide(self._limit, gains[n:], out=np.full(n, np.inf), where=gains[n:] > 0.0)
        return np.asarray(np.minimum(np.maximum(after, -bound), bound))
