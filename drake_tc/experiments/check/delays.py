"""How late the columns of a joint are against each other, as far as its logs tell.

A torque that is recorded d late has the true value tau(t + d) at t. With the effort y, which may act late too,

    tau(t + d) + J a = y/K + c_1 ydot + c_2 yddot - F_v v - F_c s

is linear but for d. Gauss and Newton's step needs the rate of the torque without the noise of its sensor: it is the
projection of the measured rate on those of effort, acceleration and velocity (two-stage least squares, Theil, 1953),

    d <- d - w'r/(w'z),    standard deviation  s sqrt(n_c) |w|/|w'z|                                    (Cramer and Rao)

r: residual; z: rate of the torque; w: its projection; all orthogonal to the columns of the equation; s: RMS of r [N m];
n_c: correlation time of r [rows]. Effort and torque that are both early are a position that is late. In a servo, the
effort holds the position, and the derivatives of the command take up a command or position that is late against each
other: a log does not tell this from viscous friction. That an effort acts late is an effect; that it is recorded late,
after what it causes, is a property of its column: c_1 K > 0.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from drake_tc.diagnosis.priors import NAMED
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.thresholds import LEAD_FLOORS
from drake_tc.experiments.check.contributions import MOST_ROWS, Contribution
from drake_tc.experiments.check.visibility import Noise
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray

ASKED = 2.0 * NAMED
"""Squared residual over that of noise by which an explanation must be better, as a diagnosis asks of effects."""
APART = 3.0
"""The same of another delay, in units of `ASKED`: far from the minimum the equation is not linear in the delay."""
CERTAIN = 4.0
"""Standard deviations from 0 from which on a delay is stated."""
STARTS = (0.0, -0.02, 0.02)
"""Delays [s] from which the search begins."""
LONGEST = 0.05
"""Longest delay [s]."""
STEPS = 20
AGES = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
"""Shifts of the effort among the signals on which residuals are compared [s]."""
ALONE = 1e-3
"""Length of a column over its own before what others explain was taken off, below which nothing is left of it."""
SAME_EFFECTS = ("delay.torque_sensor", "delay.position_sensor")
"""Effects that are the same delay by another name."""


@dataclass(frozen=True)
class ColumnDelay:
    """How late one column is against another one.

    Attributes:
        seconds: Estimate; negative where the other one is late.
        half_width: Of the 95 % interval [s].
    """

    seconds: float
    half_width: float

    @property
    def known(self) -> bool:
        """Whether it is certainly not 0."""
        return abs(self.seconds) > CERTAIN / 1.96 * self.half_width and abs(self.seconds) <= LONGEST

    @property
    def interval(self) -> tuple[float, float]:
        """95 % [s]."""
        return self.seconds - self.half_width, self.seconds + self.half_width


class _Balance:
    """The equation of this module on the rows of a joint."""

    def __init__(self, prepared: Prepared) -> None:
        self.samples = prepared.train.samples
        self.step = max(1, -(-prepared.train.target.size // MOST_ROWS))
        s, servo = self.samples.signals, prepared.context.drive == "position_servo"
        self._design = design = prepared.train.design(prepared.terms)[:: self.step]
        self._acts, self._stays = (s.command, s.effort - s.command) if servo else (s.effort, np.zeros_like(s.effort))
        orders = (1, 2, 3) if servo else (1, 2)
        rates = [self.rows(s.command if servo else s.effort, 0.0, order) for order in orders]
        self.columns, self.rates = np.column_stack([design, *rates]), len(rates)
        self.first_rate = design.shape[1]
        self.basis = orthonormal(self.columns)
        self.declared = orthonormal(design)
        told = [self.rows(s.effort, 0.0, 1), self.rows(s.acceleration, 0.0, 1), self.rows(s.acceleration, 0.0)]
        self.instruments = _new(np.column_stack(told), self.basis)
        waves = [wave(k * s.position) for wave in (np.sin, np.cos) for k in (1.0, 2.0, 3.0)]
        products = [x * wave for x in (s.velocity, s.acceleration) for wave in waves[::3]]
        more = [self.rows(x, 0.0) for x in (s.effort, s.velocity**2, s.velocity**3, *waves, *products)]
        more += [self.rows(x, 0.0, order) for x in (s.effort, s.acceleration) for order in (2, 3)]
        more += [self.rows(s.effort, age) for age in AGES]
        self.noiseless = _new(np.column_stack([*told, *more]), self.declared)

    def rows(self, values: FloatArray, earlier: float, order: int = 0) -> FloatArray:
        """(N,) rows of a derivative of light-filtered values (T,) at the times t + `earlier` [s]."""
        out = np.zeros_like(values)
        for s in self.samples.segments:
            at = np.arange(s.stop - s.start) * self.samples.signals.period
            out[s] = CubicSpline(at, values[s])(np.clip(at + earlier, at[0], at[-1]), order)
        return self.samples.reduce(out)[:: self.step]

    def without(self, values: FloatArray, *, rates: bool = True) -> FloatArray:
        """Values (N, ...) less what the columns explain, with or without those of the effort's rates."""
        basis = self.basis if rates else self.declared
        return np.asarray(values - basis @ (basis.T @ values))

    def seen(self, values: FloatArray) -> FloatArray:
        """Part (m, ...) of values (N, ...) along signals that do not contain the noise of the torque sensor.

        A column that contains this noise may lower the residual by smoothing it, so residuals are compared here.
        """
        return np.asarray(self.noiseless.T @ values)

    def torque(self, late: float, order: int = 0) -> FloatArray:
        """(N,) torque, or its rate, of a sensor that is so much late [s]; with the inertia's torque if `order` is 0."""
        s = self.samples.signals
        own = self.rows(s.load_torque, late, order)
        return own if order else own + s.rotor_inertia * self.rows(s.acceleration, 0.0)

    def together(self, late: float) -> FloatArray:
        """(N,) residual if torque and command, or effort, are both so much late [s]: a position that is early."""
        effort = self.rows(self._acts, late) + self.rows(self._stays, 0.0)
        shifted = orthonormal(np.column_stack([effort, self._design[:, 1:]]))
        torque = self.torque(late)
        return np.asarray(torque - shifted @ (shifted.T @ torque))

    def correlation(self, residual: FloatArray) -> float:
        """Correlation time [rows]."""
        lengths = [int(n) for n in np.bincount(self.samples.run[:: self.step]) if n]
        return max(correlation_time(residual - residual.mean(), lengths), 1.0)

    def price(self, coefficients: int) -> float:
        """Squared residual over that of noise that so many coefficients must save (Schwarz, 1978)."""
        independent = self._design.shape[0] / self.correlation(self.without(self.torque(0.0)))
        return coefficients * math.log(max(independent, 2.0))

    def deviation(self, residual: FloatArray) -> float:
        """S sqrt(n_c) [N m]."""
        free = max(residual.size - self.basis.shape[1] - 1, 1)
        return float(np.sqrt(residual @ residual / free * self.correlation(residual)))


def orthonormal(columns: FloatArray) -> FloatArray:
    """(N, r) orthonormal columns that span columns (N, k)."""
    norms = np.linalg.norm(columns, axis=0)
    live = norms > 1e-12 * norms.max()
    u, s, _ = np.linalg.svd(columns[:, live] / norms[live], full_matrices=False)
    return np.asarray(u[:, s > 1e-6 * s[0]])


def _new(columns: FloatArray, known: FloatArray) -> FloatArray:
    """(N, r) orthonormal columns of what columns (N, k) add to an orthonormal basis."""
    left = columns - known @ (known.T @ columns)
    live = np.linalg.norm(left, axis=0) > ALONE * np.linalg.norm(columns, axis=0)
    return orthonormal(left[:, live]) if live.any() else np.zeros((len(left), 0))


def torque_delay(
    prepared: Prepared, noise: Noise, made: Mapping[str, Sequence[Contribution]]
) -> tuple[ColumnDelay | None, ColumnDelay | None]:
    """(delay of the torque against the position, time by which the effort is recorded late at least).

    None where the load is not a measured torque, where the effort holds the position (the second one), and where the
    logs do not tell: more than noise is left, another delay leaves as little, or an effect explains as much.

    Args:
        prepared: One joint.
        noise: Of its balance.
        made: Contributions of the effects that a diagnosis looks for, by key.
    """
    if prepared.context.load != "torque":
        return None, None
    balance = _Balance(prepared)
    if not balance.instruments.shape[1]:
        return None, None
    tried = sorted((_from(balance, start) for start in STARTS), key=lambda each: each[0])
    deviation = balance.deviation(balance.without(balance.torque(tried[0][1])))
    judged = sorted((_Judged.of(balance, *each, deviation) for each in tried), key=lambda each: each.price)
    best, late, half = judged[0], judged[0].late, judged[0].half
    residual = balance.without(balance.torque(late))
    if np.sqrt(np.mean(residual**2)) > LEAD_FLOORS * noise.floor:
        return None, None
    if any(
        abs(each.late - late) > max(half, each.half) and each.price < best.price + APART * ASKED for each in judged[1:]
    ):
        return None, None
    found = ColumnDelay(late, half)
    if found.known and _an_effect_explains(balance, made, best, deviation):
        return None, None
    return found, _effort_late(prepared, balance, late, residual)


def _from(balance: _Balance, late: float) -> tuple[float, float, float]:
    """(squared residual, delay, half width of its interval) of the search that begins at a delay."""
    w = z = np.zeros(0)
    for _ in range(STEPS):
        residual, z = balance.without(balance.torque(late)), balance.without(balance.torque(late, 1))
        w = balance.instruments @ (balance.instruments.T @ z)
        change = float(w @ residual / (w @ z))
        late = float(np.clip(late - change, -2.0 * LONGEST, 2.0 * LONGEST))
        if abs(change) < 1e-6:
            break
    residual = balance.without(balance.torque(late))
    half = 1.96 * balance.deviation(residual) / max(float(np.linalg.norm(w)), 1e-300)  # w'z = |w|^2
    return _squares(balance.seen(residual)), late, half


def _squares(values: FloatArray) -> float:
    return float(np.sum(values**2))


@dataclass(frozen=True)
class _Judged:
    """A delay, and what it leaves along signals without the sensor's noise, over that of noise.

    Attributes:
        late: Delay [s]. half: half width of its interval [s].
        one_cause: What a delay near it leaves alone: of the torque, or of the position, with which torque and effort
            are early by the same time.
        with_rates: What the rates of the effort leave beside it, and their price.
    """

    late: float
    half: float
    one_cause: float
    with_rates: float

    @property
    def price(self) -> float:
        """The smaller one."""
        return min(self.one_cause, self.with_rates)

    @classmethod
    def of(cls, balance: _Balance, left: float, late: float, half: float, deviation: float) -> "_Judged":
        """Of what the search from one start gives."""
        ends = (late - 2.0 * half - 1e-4, late + 2.0 * half + 1e-4)

        def alone(d: float) -> float:
            return _squares(balance.seen(balance.without(balance.torque(d), rates=False)))

        def together(d: float) -> float:
            return _squares(balance.seen(balance.together(d)))

        least = min(minimize_scalar(each, bounds=ends, options={"xatol": 1e-6}).fun for each in (alone, together))
        return cls(late, half, least / deviation**2, left / deviation**2 + balance.price(balance.rates))


def _an_effect_explains(
    balance: _Balance, made: Mapping[str, Sequence[Contribution]], best: _Judged, deviation: float
) -> bool:
    """Whether one effect and a torque that is not late explain the rows nearly as well, each coefficient at its price.

    The rates of the effort take part if the delay needs them too: one cause is compared with one.
    """
    rates = best.one_cause > best.with_rates
    paid = balance.price(balance.rates) if rates else 0.0
    target = balance.seen(balance.without(balance.torque(0.0), rates=rates))
    for key, shapes in made.items():
        for each in () if key in SAME_EFFECTS else shapes:
            span = balance.seen(balance.without(each.span, rates=rates))
            blocks = [span] if each.linear else [span[:, k : k + 1] for k in range(span.shape[1])]
            for block in blocks:
                if np.linalg.norm(block) > ALONE * np.linalg.norm(each.change):
                    told = orthonormal(block).T @ target
                    left = (_squares(target) - _squares(told)) / deviation**2 + balance.price(told.size - 1) + paid
                    if left < best.price + ASKED:
                        return True
    return False


def _effort_late(prepared: Prepared, balance: _Balance, late: float, residual: FloatArray) -> ColumnDelay | None:
    """c_1 K beside a torque whose delay is free; None for a servo, whose effort holds the position."""
    if prepared.context.drive == "position_servo" or prepared.train.effort_is_target:
        return None
    z = balance.without(balance.torque(late, 1))
    columns = np.column_stack([balance.columns, balance.instruments @ (balance.instruments.T @ z)])
    scale = np.linalg.norm(columns, axis=0)
    u, s, vt = np.linalg.svd(columns / scale, full_matrices=False)
    if s[-1] < 1e-6 * s[0]:
        return None
    beta = vt.T @ ((u.T @ balance.torque(late)) / s) / scale
    spread = balance.deviation(residual) * float(np.linalg.norm(vt[:, balance.first_rate] / s))
    gain = float(beta[0])
    at = balance.first_rate
    return ColumnDelay(float(beta[at]) / gain, 1.96 * spread / scale[at] / abs(gain))
