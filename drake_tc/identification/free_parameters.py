"""Which numbers of a model a refinement may change, on which scale, and how far each may lie from where it starts.

Results that no joint has: what they say is that the columns or their signs are not what the rig file says.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray

LEAST_SPREAD, MOST_SPREAD = 0.3, 1.0
"""Standard deviation of the prior of a positive number, as the logarithm of a factor: an interval of the equation error
does not hold its bias, and a number that it leaves open is still known to a factor of some three."""
STEP = 0.03
"""Step of the finite differences, as a share of a positive number, and of the prior's deviation of another one."""
Ranges = Mapping[tuple[str, str], tuple[float, float]]
DRIVE = "drive"


@dataclass(frozen=True)
class FreeParameter:
    """One number: a positive one is sought by its logarithm, one that starts at 0 or may be negative by itself.

    Attributes:
        key: Key of the effect, or "drive". name: of the parameter.
        lower, upper: Bounds of the search, in the parameter's unit.
        start: Estimate of the equation error, in the parameter's unit.
        deviation: Its standard deviation in the coordinate of the search.
        logarithmic: Whether that coordinate is the logarithm.
    """

    key: str
    name: str
    lower: float
    upper: float
    start: float
    deviation: float
    logarithmic: bool

    def coordinate(self, value: float) -> float:
        """Of a value within the bounds."""
        return math.log(value) if self.logarithmic else value

    @property
    def bounds(self) -> tuple[float, float]:
        """In the coordinate of the search."""
        if not self.logarithmic:
            return self.lower, self.upper
        low = math.log(self.lower) if self.lower > 0.0 else -math.inf
        return low, math.log(self.upper)

    @property
    def step(self) -> float:
        """Of finite differences, in the coordinate of the search."""
        return STEP if self.logarithmic else STEP * max(self.deviation, 1e-12)


@dataclass(frozen=True)
class FreeParameters:
    """All free numbers of one model, as a vector x (k,)."""

    model: ActuatorModel
    entries: tuple[FreeParameter, ...]

    @property
    def start(self) -> FloatArray:
        """X of the model itself."""
        return np.array([e.coordinate(e.start) for e in self.entries])

    @property
    def deviation(self) -> FloatArray:
        """Of the prior, (k,)."""
        return np.array([e.deviation for e in self.entries])

    @property
    def steps(self) -> FloatArray:
        """Of finite differences, (k,)."""
        return np.array([e.step for e in self.entries])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(lower, upper), (k,) each."""
        low, high = zip(*(e.bounds for e in self.entries), strict=True)
        return np.array(low), np.array(high)

    def write(self, x: FloatArray) -> ActuatorModel:
        """The model with the numbers x (k,), without intervals: those were of the equation error."""
        drive, effects = self.model.drive, {v.key: dict(v.parameters) for v in self.model.effects}
        for entry, value in zip(self.entries, x.tolist(), strict=True):
            number = math.exp(value) if entry.logarithmic else value
            number = min(max(number, entry.lower), entry.upper)
            if entry.key == DRIVE:
                drive = Drive(drive.kind, number)
            else:
                effects[entry.key][entry.name] = number
        values = tuple(
            replace(v, parameters=effects[v.key], ci95={}, at_bound=_resting(self.entries, v.key, effects[v.key]))
            for v in self.model.effects
        )
        return replace(self.model, drive=drive, effects=values)


def _resting(entries: Sequence[FreeParameter], key: str, values: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the effect's numbers that rest on a bound."""
    mine = [e for e in entries if e.key == key]
    near = [e.name for e in mine if any(math.isclose(values[e.name], b, rel_tol=1e-6) for b in (e.lower, e.upper))]
    return tuple(near)


def free_parameters(model: ActuatorModel, ranges: Ranges | None = None) -> FreeParameters:
    """What the logs may say of a model: its numbers that were estimated, and the gain of the drive unless it is held.

    Args:
        model: With 95 % intervals, as the equation error gives it; a number without an interval was not estimated. An
            interval that is a point belongs to a number that rests on its bound, or whose effect does: the equation
            error has left that effect out, which is no reason for the free runs to do the same.
        ranges: (effect key, parameter) to the range in which it is physically possible, and ("drive", "gain") to its
            95 % interval; a point where the gain is held. A range is widened to hold the estimate.
    """
    ranges = ranges or {}
    gain = model.drive.gain
    low, high = ranges.get((DRIVE, "gain"), (gain, gain))
    entries = [_entry(DRIVE, "gain", gain, max(high - gain, gain - low), (0.0, math.inf))] if high > low else []
    for value in model.effects:
        given = {p.name for p in value.effect.given_shapes}
        bounds = {p.name: (p.lower, p.upper) for p in (*value.effect.coefficients, *value.effect.parameters)}
        for name, (low, high) in value.ci95.items():
            number = value.parameters[name]
            if name in given or not math.isfinite(number):
                continue
            least, most = ranges.get((value.key, name), (-math.inf, math.inf))
            limits = (min(max(bounds[name][0], least), number), max(min(bounds[name][1], most), number))
            entries.append(_entry(value.key, name, number, max(high - number, number - low), limits))
    return FreeParameters(model, tuple(e for e in entries if e is not None))


def _entry(key: str, name: str, value: float, half: float, limits: tuple[float, float]) -> FreeParameter | None:
    """None for a number of which nothing says how large it could be."""
    deviation, (low, high) = half / 1.96, limits
    if low >= 0.0 and value > 0.0:
        relative = min(max(deviation / value, LEAST_SPREAD), MOST_SPREAD) if deviation > 0.0 else MOST_SPREAD
        return FreeParameter(key, name, low, high, value, relative, logarithmic=True)
    possible = min(high, -low) if low < 0.0 else high
    if deviation <= 0.0 and math.isfinite(possible):
        deviation = LEAST_SPREAD * possible
    deviation = max(deviation, LEAST_SPREAD * abs(value))
    if not (math.isfinite(deviation) and deviation > 0.0):
        return None
    return FreeParameter(key, name, low, high, value, deviation, logarithmic=False)


Interval = tuple[float, float]


def require_physical(
    joint: str,
    parameters: Mapping[str, float],
    intervals: Mapping[str, Interval],
    velocity: FloatArray,
    direction: FloatArray,
) -> None:
    """Refuse a drive gain below zero, and friction that drives the joint.

    With the effort  K_tau tau + K_v v + K_c s  friction takes the power  mean(K_v v^2 + K_c v s) > 0. Either is
    refused only where the upper ends of the intervals are on the wrong side, too.

    Args:
        joint: For the message.
        parameters: K_tau, K_v, K_c, if the method has them.
        intervals: 95 % intervals of the same names.
        velocity: v (T,) [rad/s].
        direction: s (T,), the smoothed sign of v.

    Raises:
        IdentificationError: names the parameter, its interval, and what to look at.
    """
    if not {"K_tau", "K_v", "K_c"} <= set(intervals):
        return
    low, high = intervals["K_tau"]
    if high < 0.0:
        raise IdentificationError(
            f"{joint}: K_tau is {parameters['K_tau']:.4g} [{low:.4g}, {high:.4g}], and expected above 0: a load torque"
            " would pull the joint against itself; check the signs and the order of the columns"
        )
    powers = [np.mean(velocity**2), np.mean(velocity * direction)]
    friction = sum(float(power) * intervals[name][1] for name, power in zip(("K_v", "K_c"), powers, strict=True))
    if friction < 0.0:
        raise IdentificationError(
            f"{joint}: friction would drive the joint (K_v at most {intervals['K_v'][1]:.4g}, K_c at most"
            f" {intervals['K_c'][1]:.4g}); check the signs, the clocks and the order of the columns"
        )
