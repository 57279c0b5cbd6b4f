"""The rows of one split: the effort that was recorded, the one that a fit needs, and what ages of channels do to it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from drake_tc.diagnosis.data.preparation import slower
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.noise import INDEPENDENT, Rows, drawn_noise, filtered, latent_shares
from drake_tc.diagnosis.priors import PASSED_ON, SLOW
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term, drives
from drake_tc.effects.base import DriveEffect, SensorEffect, Signals
from drake_tc.effects.delay import shift
from drake_tc.types import FloatArray

LATE_RECORD = {"command": -1.0, "effort": 1.0, "torque": 1.0}
"""Age of a channel for a record that is late by a second. A drive acts on a command that is older than its record, so a
record that is late makes this age smaller. What is inside a servo acts, and is not recorded. A late position makes the
records of all other channels early."""

AVERAGED = 1.0 / 24.0
"""Factor of T^2 d^2x/dt^2 by which the mean of x over a period T differs from x in its middle."""


@dataclass(frozen=True, eq=False)
class Split:
    """The rows of the training or of the held-out runs.

    Attributes:
        recorded: Columns computed from the recorded effort: the target.
        clean: Columns computed from the effort that the model needs, in which the effort's noise is not a regressor.
        needed: (T,) w, the effort that the model needs [effort]. modelled: the same before the filters of the fit that
            computed it, as it would be recorded.
        arrived: (T,) recorded effort after the drive effects without memory of that fit [effort].
        share: (m,) taps of the filter l by which the latent effort follows the recorded one (`latent.latent_shares`).
        of_load: (m,) taps of the filter m by which the load takes up the residual.
        gain: K of the fit that computed w [effort/(N m)].
        ages: By channel, the age at which what it does is linearised [s].
        fit: Terms and [1/K, theta ...] that computed w.
        measured: Whether a sensor tells the load torque.
        bent: (T,) what `bent_load` has added to the recorded load [N m].
        late: Signals with the load as it was recorded, where those of the samples are without its age.
    """

    recorded: Columns
    clean: Columns
    needed: FloatArray
    modelled: FloatArray
    arrived: FloatArray
    share: FloatArray
    of_load: FloatArray
    gain: float
    ages: Mapping[str, float] = field(default_factory=dict)
    fit: tuple[Sequence[Term], FloatArray] = ((), np.ones(1))
    measured: bool = False
    bent: FloatArray | float = 0.0
    late: Signals | None = None

    @property
    def samples(self) -> Samples:
        """Filtered signals and rows."""
        return self.recorded.samples

    @cached_property
    def latent(self) -> FloatArray:
        """(T,) x, see `latent`, before the drive effects without memory [effort]."""
        return np.asarray(self.modelled + self._error + self.samples.signals.effort - self.arrived)

    @cached_property
    def acting(self) -> FloatArray:
        """(T,) the same effort after the filters of the fit, and at its ages: the one with which the drive acts."""
        return np.asarray(self.needed + self._error)

    @cached_property
    def _error(self) -> FloatArray:
        """(T,) what the model lacks of the effort, l * (u - w), or u - w near rest, where friction leaves it open."""
        return np.asarray(self.arrived - self.modelled - self._unexplained + self._followed(self._unexplained))

    @property
    def _unexplained(self) -> FloatArray:
        """(T,) u - w in steady motion [effort]."""
        return np.where(self.samples.sliding, self.arrived - self.modelled, 0.0)

    @cached_property
    def load(self) -> FloatArray:
        """(T,) the most probable load torque of a recorded one [N m]."""
        s = self.samples.signals
        return np.asarray(s.load_torque + filtered(self.samples, self.of_load, self._unexplained) / self.gain)

    def _followed(self, values: FloatArray) -> FloatArray:
        """(T,) values through the filter l, stretch by stretch."""
        return filtered(self.samples, self.share, values)

    @cached_property
    def noisy(self) -> "tuple[Split, ...]":
        """This split with the noise of each channel drawn once more, and passed through all that it passes."""
        out, s = [], self.samples.signals
        for drawn in drawn_noise(self.samples, measured=self.measured):
            noise = s.rotor_inertia * (drawn.signals.acceleration - s.acceleration)
            if not self.samples.load_unknown:
                noise = noise + drawn.signals.load_torque - s.load_torque
            target = self.recorded.target + self.samples.reduce(noise)
            recorded = self.recorded.changed(samples=drawn, target=target)
            shares = self.share, self.of_load
            out.append(with_needed(recorded, *self.fit, measured=self.measured, ages=self.ages, shares=shares))
        return tuple(out)

    @cached_property
    def rows(self) -> Rows:
        """The rows that count."""
        return Rows(self.samples)

    def target(self, terms: Sequence[Term]) -> FloatArray:
        """(N,) the recorded effort after the drive effects without memory, less what filters add to w."""
        acting = drives(terms)
        stand = stands_for(acting)
        late = [channel for channel in self.ages if channel not in stand]
        out = self._arrived_at_ages([t for t in acting if not is_filter(t)], [c for c in late if c != "torque"])
        for term in acting:
            if is_filter(term):
                out = out - self._offset(term, stand)
        if "torque" in late:
            out = out - self.samples.reduce(_inside(self._change_at_age("torque"), self.samples))
        out = out + sum(self.ages[channel] * self.reduced_slope(channel) for channel in late)
        return out + self._of_integral(stand) if self._integrators else out

    def _arrived_at_ages(self, static: Sequence[Term], late: Sequence[str]) -> FloatArray:
        """(N,) the recorded effort after drive effects that are no filters, acting at the ages of these channels."""
        if not late:
            return self.recorded.effort(static)
        key = ("arrived", *late, *(k for t in static for k in t.cache_key))
        if key not in self._kept:
            effort = self.recorded.acting_effort(static, -sum(map(self._change_at_age, late)))
            self._kept[key] = self.samples.reduce(_inside(effort, self.samples))
        return np.asarray(self._kept[key])

    def _change_at_age(self, channel: str) -> FloatArray:
        """(T,) f(a) of a channel at the age at which it is linearised."""
        return self.channels[channel].change(self.samples, self.ages[channel])

    @property
    def channels(self) -> Mapping[str, "Aged"]:
        """What the age of each channel does, but that of the rate in a servo.

        A torque's age is sought in its slow part: a step along the slope of the fast part would go past it. At an age
        that is not linear, all of the torque is as late, and the load of these samples is without this age.
        """
        late = self.ages.get("torque", 0.0)
        torque = self.load if late else self.samples.signals.slow_torque
        return {
            "command": Aged(self.clean.samples.signals.command, -1.0),  # as in `inside`: the two differ by the motion
            "inside": Aged(self.latent, -1.0),
            "effort": Aged(-self.latent, 1.0),
            "torque": Aged(self.gain * torque, 1.0, late),
        }

    def slope_of(self, channel: str) -> FloatArray:
        """(T,) df/da at the age at which the channel is linearised, after the drive effects of the fit."""
        slope = self.channels[channel].slope(self.samples, self.ages.get(channel, 0.0))
        needed = channel == "torque"
        return self._acted(self._filtered(slope if needed else self._passed_on(slope), needed=needed))

    def _filtered(self, change: FloatArray, *, needed: bool) -> FloatArray:
        """(T,) what filters of the fit make in the balance of a small change (T,) of the acting or the needed effort.

        A filter T acts on l * u and its inverse on (1 - l) * w, see `_change`: behind a lag, an older effort differs by
        the lagged slope.
        """
        out = change
        for term in drives(self.fit[0]):
            if is_filter(term) and cast(DriveEffect, term.effect).filters:
                made = self.clean.samples.by_segment(term.effect, term.shape, change, undo=needed) - change
                out = out + (made - self._followed(made) if needed else self._followed(made))
        return out

    def _passed_on(self, change: FloatArray) -> FloatArray:
        """(T,) what the drive effects of the fit that are no filters, at its ages, pass on of a small change (T,)."""
        static = behind(self.fit[0])
        late = [channel for channel in self.ages if static and channel != "torque"]
        return passed_on(self.recorded, static, change, -sum(map(self._change_at_age, late)))

    @cached_property
    def _integrators(self) -> list[tuple[Term, FloatArray]]:
        return [(t, theta) for t, theta in coefficients_by_term(*self.fit) if t.effect.unknown_start]

    def _acted(self, change: FloatArray) -> FloatArray:
        """(T,) what a change of the acting effort (T,) does in the balance, with integrators of the fit."""
        effort = replace(self.samples, signals=replace(self.samples.signals, effort=change))
        acted = [self.gain * effort.by_segment(t.effect, t.shape) @ theta for t, theta in self._integrators]
        return np.asarray(change - sum(acted))

    def _of_integral(self, stand: frozenset[str]) -> FloatArray:
        """(N,) what integrators make of the changes of the effort at which their columns are computed.

        Those of ages are in `slope_of`, but for channels for whose ages a delay stands.
        """
        change = np.zeros(len(self.samples.signals))
        for term in drives(self.fit[0]):
            if is_filter(term):
                change = change + self._change(term, stand)
        for channel in stand & self.ages.keys():
            change = change + _inside(self.channels[channel].change(self.samples, self.ages[channel]), self.samples)
        return self.samples.reduce(self._acted(change) - change)

    def reduced_slope(self, channel: str) -> FloatArray:
        """(N,) the same on the rows; of the rate in a servo for a viscous friction of 1 N m s/rad."""
        if ("age", channel) not in self._kept:
            rate = channel == "rate"
            slope = -self.gain * self.samples.signals.acceleration if rate else self.slope_of(channel)
            self._kept["age", channel] = self.samples.reduce(_inside(slope, self.samples) if rate else slope)
        return np.asarray(self._kept["age", channel])

    def averaged(self, channel: str) -> FloatArray:
        """(N,) what a channel changes in the balance that is the mean over its period, see `AVERAGED`."""
        if ("averaged", channel) not in self._kept:
            period = self.samples.torque_period if channel == "torque" else self.samples.effort_period
            change = -AVERAGED * period**2 * rate_inside(self.slope_of(channel), self.samples)
            self._kept["averaged", channel] = self.samples.reduce(change)
        return np.asarray(self._kept["averaged", channel])

    def age_columns(self, channels: Iterable[str], viscous: float) -> FloatArray:
        """(N, a) what a second of age of each channel does, for a viscous friction [N m s/rad]."""
        own = {c: self.reduced_slope(c) * (viscous if c == "rate" else 1.0) for c in channels if c != "position"}
        older = -sum(late * own[c] for c, late in LATE_RECORD.items() if c in own)
        return np.stack([older if c == "position" else own[c] for c in channels], axis=1)

    def with_load_at(self, terms: Sequence[Term], beta: FloatArray, age: float) -> "Split":
        """The split whose recorded load is that at the position errors and at the age of the torque [s] of a fit."""
        samples, s, bent, late = self.samples, self.samples.signals, self.bent, self.late
        if self.measured:
            late = late or s
            load, slow = (moved(each, samples, age) for each in (late.load_torque, late.slow_torque))
            more = load - s.load_torque
            known = replace(s, load_torque=load, expected_torque=load, slow_torque=slow)
        else:
            bent = bent_load(samples, terms, beta)
            more = bent - self.bent
            known = replace(s, known_torque=s.known_torque + more)
        if not np.any(more):
            return self
        target = self.recorded.target + samples.reduce(more)
        recorded = self.recorded.changed(samples=replace(samples, signals=known), target=target)
        return replace(self, recorded=recorded, bent=bent, late=late)

    def of(self, term: Term) -> FloatArray:
        """(N, k) columns [N m] of a term; of ages of channels, where these are linearised."""
        if term.effect.coefficients and term.effect.ages_of:
            slopes = [share * self.reduced_slope(channel) for channel, share in term.effect.ages_of.items()]
            return np.asarray(np.sum(slopes, axis=0)[:, None] / self.gain)
        return self.clean.of(term)

    @cached_property
    def run_columns(self) -> tuple[FloatArray, ...]:
        """(N, r) direction, speed and 1, each in its run."""
        s = self.samples
        each = s.reduce(s.signals.direction, fresh=True), s.reduce(s.signals.velocity), np.ones(s.rows.size)
        inside = s.run[:, None] == np.arange(len(s.runs))
        return tuple(np.where(inside, values[:, None], 0.0) for values in each)

    @cached_property
    def near_rest(self) -> FloatArray:
        """(N, 1) direction times e^(-|v|/v_s), v_s a share of the RMS speed."""
        s = self.samples.signals
        slow = SLOW * max(rms(s.velocity[self.samples.rows]), 1e-300)
        return self.samples.reduce(s.direction * np.exp(-np.abs(s.velocity) / slow), fresh=True)[:, None]

    def curvature(self, channel: str, age: float) -> float:
        """RMS over the rows of f(a) - a df/da(0) of a channel after the drive effects [effort], of all of a torque."""
        aged, static = self.channels[channel], [] if channel == "torque" else behind(self.fit[0])
        if channel == "torque":
            aged = replace(aged, values=self.gain * self.load)
        before, after = (aged.change(self.samples, a) for a in (0.0, age))
        slope = passed_on(self.recorded, static, aged.slope(self.samples, 0.0), -before)
        off = self.recorded.acting_effort(static, -before) - self.recorded.acting_effort(static, -after) - age * slope
        return rms(self.samples.reduce(_inside(off, self.samples)))

    @cached_property
    def _kept(self) -> dict[tuple[object, ...], Any]:
        return {}

    def _offset(self, term: Term, stand: frozenset[str]) -> FloatArray:
        """(N,) what a filter T changes in the balance."""
        key = (*term.cache_key, stand)
        if key not in self._kept:
            self._kept[key] = self.samples.reduce(self._acted(self._change(term, stand)))
        return np.asarray(self._kept[key])

    def _change(self, term: Term, stand: frozenset[str]) -> FloatArray:
        """(T,) l * (u - T(u)) + (1 - l) * (T^-1(w) - w) of a filter T, u at the ages but those of channels `stand`."""
        u, w = self.arrived, self.needed
        if aged := [channel for channel in self.ages if channel not in stand | {"torque"}]:
            u = self.recorded.acting_effort(behind(self.fit[0]), -sum(map(self._change_at_age, aged)))
        act = partial(self.clean.samples.by_segment, term.effect, term.shape)
        needed, late = act(w, undo=True) - w, u - act(u)
        if cast(DriveEffect, term.effect).acts_on == "command":
            needed, late = self._passed_on(needed), self._passed_on(late)
        return np.asarray(needed + self._followed(late - needed))

    def log_jacobian(self, terms: Sequence[Term], deviation: float) -> float:
        """Sum over the rows that count of log |du*/du| of drive effects.

        At least as much as noise of this deviation tells: where the drive does not pass the effort on, u is known up to
        its own range and nothing else. A filter counts by the share of the residual's noise that it passes.
        """
        passed = 0.5 * self.rows.index.size * self.log_passed(terms)
        static = [t for t in drives(terms) if not is_filter(t)]
        if not static:
            return float(passed)
        key = ("slope", *(k for t in static for k in t.cache_key))
        if key not in self._kept:
            self._kept[key] = self._slope(static)[self.rows.index]
        slope = self._kept[key]
        span = float(np.ptp(self.samples.signals.effort[self.samples.rows]))
        least = min(deviation * np.sqrt(2.0 * np.pi) / max(span, 1e-300), 1.0)
        return float(passed + np.sum(np.log(np.clip(slope, least, 1.0))))

    def log_passed(self, terms: Sequence[Term]) -> float:
        """Logarithm of the share of the residual's noise that the filters among the terms pass."""
        filters = [t for t in drives(terms) if isinstance(t.effect, DriveEffect) and t.effect.filters]
        return float(sum(self._passed(t) for t in filters))

    def _follows(self) -> FloatArray:
        """(F,) share of the residual that the latent effort follows, at the frequencies of the rows."""
        pulse, _ = self.samples.pulse()
        frequency = np.fft.rfftfreq(2 * pulse.size)
        inside = frequency[frequency <= 0.5 * min(float(pulse @ pulse) / INDEPENDENT, 1.0)]
        waves = np.exp(-2j * np.pi * np.outer(inside, np.arange(self.share.size)))
        return np.asarray(np.abs(waves @ self.share))

    def _passed(self, term: Term) -> float:
        """Mean logarithm over the rows' frequencies of the residual's power that passes a filter T.

        With l the share of the residual that the latent effort follows, its noise is the recorded effort's to 1 - l,
        which passes 1 - l (1 - T), and the needed effort's to l, which passes 1 - (1 - l) (1 - 1/T).
        """
        key = ("passed", *term.cache_key)
        if key not in self._kept:
            pulse, piece = self.samples.pulse()
            size, effect = pulse.size, cast(DriveEffect, term.effect)
            inside = np.fft.rfftfreq(2 * size) <= 0.5 * min(float(pulse @ pulse) / INDEPENDENT, 1.0)
            noise, late, early = (
                np.fft.rfft(each, 2 * size)[inside]
                for each in (pulse, effect.transform(pulse, piece, term.shape), effect.undone(pulse, piece, term.shape))
            )
            follows = self._follows()
            of_effort = (1.0 - follows) * np.abs(1.0 - follows * (1.0 - late / noise)) ** 2
            of_need = follows * np.abs(1.0 - (1.0 - follows) * (1.0 - early / noise)) ** 2
            self._kept[key] = float(np.mean(np.log(of_effort + of_need)))
        return float(self._kept[key])

    def as_recorded(self, terms: Sequence[Term], residual: FloatArray) -> FloatArray:
        """(N,) error [recorded effort] that is an error of the effort on which the drive acts, (du*/du)^-1 of it.

        Where the drive does not pass the effort on, a dead zone or a limit, every effort within is as good, and the
        acting effort's own error is kept.
        """
        static = [t for t in drives(terms) if not is_filter(t)]
        if not static:
            return residual
        slope = self._slope(static)
        return np.asarray(residual / np.where(slope > PASSED_ON, slope, 1.0))

    def _slope(self, static: Sequence[Term]) -> FloatArray:
        """(N,) |du*/du| of drive effects without memory on all rows."""
        return np.abs(passed_on(self.recorded, static, np.ones(len(self.samples.signals)))[self.samples.rows])


def behind(terms: Sequence[Term]) -> list[Term]:
    """The drive effects that are no filters; none behind an integrator, whose effort is not recorded."""
    return [] if starts_unknown(terms) else [t for t in drives(terms) if not is_filter(t)]


def passed_on(
    recorded: Columns, static: Sequence[Term], change: FloatArray, at: FloatArray | float = 0.0
) -> FloatArray:
    """(T,) what drive effects pass on of a small change (T,) of the recorded effort, at a change `at` (T,) of it."""
    size, samples = rms(change), recorded.samples
    if not static or size == 0.0:
        return change
    step = 1e-3 * max(rms(samples.signals.effort[samples.rows]), 1e-12) / size
    up, down = (recorded.acting_effort(static, at + sign * step * change) for sign in (1.0, -1.0))
    return np.asarray((up - down) / (2.0 * step))


@dataclass(frozen=True)
class Aged:
    """What the age a of a channel does to the effort: f(a) = d (x(t + d a) - x(t + d a_0)), d = 1 or -1.

    Attributes:
        values: (T,) x(t + d a_0) [effort].
        way: d, -1 where the drive acts on what is older than its record.
        at: a_0 [s], without which the effort is: 0 where it has been recorded.
    """

    values: FloatArray
    way: float
    at: float = 0.0

    def change(self, samples: Samples, age: float) -> FloatArray:
        """(T,) f(a)."""
        return np.asarray(self.way * (moved(self.values, samples, self.way * (age - self.at)) - self.values))

    def slope(self, samples: Samples, age: float) -> FloatArray:
        """(T,) df/da."""
        return rate_inside(moved(self.values, samples, self.way * (age - self.at)), samples)


def moved(values: FloatArray, samples: Samples, by: float) -> FloatArray:
    """(T,) x(t + by) of values x (T,), stretch by stretch, by cubic splines; the ends of a stretch are held."""
    if by == 0.0:
        return values
    out = np.empty_like(values)
    for s in samples.segments:
        out[s] = shift(values[s], -by / samples.signals.period)
    return out


def bent_load(samples: Samples, terms: Sequence[Term], beta: FloatArray) -> FloatArray:
    """(T,) m g l (sin(q - e) - sin q + e cos q) [N m]: what a pendulum's load is beyond its tangent.

    e (T,) [rad] are the errors of the position that the terms of a fit tell. The columns of these terms hold the
    tangent alone, and at 0.3 rad it is 4 % of the weight away.
    """
    s = samples.signals
    error = np.zeros(len(s))
    if samples.load_unknown or not np.any(s.load_slope):
        return error
    for term, theta in coefficients_by_term(terms, beta):
        if isinstance(term.effect, SensorEffect) and not term.effect.ages_of:
            named = term.effect.physical(theta, term.shape, 1.0 / float(beta[0]))
            error = error + term.effect.corrupt(s, named).position - s.position
    weight = s.load_torque - s.link_inertia * s.acceleration
    return np.asarray(weight * (np.cos(error) - 1.0) - s.load_slope * (np.sin(error) - error))


def without_sensor_errors(signals: Signals, terms: Sequence[Term], beta: FloatArray) -> FloatArray:
    """(T,) the load torque [N m] without the errors of sensors that the terms of a fit tell.

    Where it changes its sign, a bias of the sensor decides on which side the teeth of a gear touch.
    """
    true = signals
    for term, theta in coefficients_by_term(terms, beta):
        if isinstance(term.effect, SensorEffect) and not term.effect.ages_of:
            named = term.effect.physical(theta, term.shape, 1.0 / float(beta[0]))
            true = term.effect.restore(true, named)
    return np.asarray(true.load_torque + signals.load_slope * (true.position - signals.position))


def stands_for(terms: Sequence[Term]) -> frozenset[str]:
    """Channels for whose ages a delay among the terms stands: those of the effort, or a single one.

    The logs tell the sum of both. A delay that an age undoes to first order alone would smooth the noise away.
    """
    stand = [t.effect.ages_of for t in terms if t in drives(terms) or len(t.effect.ages_of) == 1]
    return frozenset().union(*stand)


def starts_unknown(terms: Sequence[Term]) -> bool:
    """Whether a term begins each run in a state that no channel tells."""
    return any(t.effect.unknown_start for t in terms)


def is_filter(term: Term) -> bool:
    """Whether the term is a linear filter of the effort, or of the command within it."""
    return isinstance(term.effect, DriveEffect) and (term.effect.filters or term.effect.acts_on == "command")


def rate_inside(values: FloatArray, samples: Samples) -> FloatArray:
    """Time derivative (T,) of values (T,) without the jumps between stretches."""
    return _inside(np.gradient(values, samples.signals.period), samples)


def _inside(values: FloatArray, samples: Samples) -> FloatArray:
    """Values (T,) without the jumps that a difference quotient leaves where two stretches meet."""
    out = values.copy()
    for s in samples.segments:
        out[s.start : s.start + 2] = out[min(s.start + 2, s.stop - 1)]
        out[max(s.stop - 2, s.start) : s.stop] = out[max(s.stop - 3, s.start)]
    return out


def with_needed(
    recorded: Columns,
    terms: Sequence[Term],
    beta: FloatArray,
    *,
    measured: bool,
    ages: Mapping[str, float] = MappingProxyType({}),
    shares: tuple[FloatArray, FloatArray] | None = None,
) -> Split:
    """A split whose needed effort is w = (tau + J qddot + known + sum_k theta_k phi_k)/beta_0 of a fit, at ages [s].

    `shares`: taps of the filters l and m; None computes them.
    """
    samples = recorded.samples
    s = samples.signals
    torque = s.rotor_inertia * s.acceleration + s.known_torque
    if not samples.load_unknown:  # else the load is among the terms
        torque = torque + s.load_torque
    late, static = ages.get("inside", 0.0) - ages.get("effort", 0.0), behind(terms)
    of_command = Aged(s.command, -1.0).change(samples, ages.get("command", 0.0))
    acting = moved(s.effort - of_command, samples, -late)
    for term in drives(terms):
        if is_filter(term):
            acting = samples.by_segment(term.effect, term.shape, acting)
    there = replace(samples, signals=replace(s, effort=acting))
    for term, theta in coefficients_by_term(terms, beta):
        if theta.size and not term.effect.ages_of.keys() & ages.keys():
            own = there if term.effect.unknown_start else samples
            torque = torque + own.by_segment(term.effect, term.shape) @ theta
    torque = np.concatenate([samples.settled(torque, each) for each in samples.segments])
    gain = 1.0 / float(beta[0])
    modelled = gain * torque
    for term in reversed(drives(terms)):
        if is_filter(term):
            modelled = samples.by_segment(term.effect, term.shape, modelled, undo=True)
    arrived = recorded.acting_effort(static)
    modelled = moved(modelled, samples, late) + arrived - recorded.acting_effort(static, -of_command)
    shares = shares or latent_shares(samples, arrived - modelled, gain)
    fit = (tuple(terms), beta)
    return with_clean(Split(recorded, recorded, gain * torque, modelled, arrived, *shares, gain, ages, fit, measured))


def with_clean(first: Split) -> Split:
    """The split with its columns computed from the most probable effort and, if it is `measured`, load (`latent`)."""
    samples = first.samples
    s = samples.signals
    command = first.latent + s.position if samples.floor.servo else first.latent
    load = first.load if first.measured else s.load_torque
    slow = s.slow_torque
    if first.measured:
        slow = slower(samples.light).smooth(load)
    stiffness = 1.0 / first.gain if s.stiffness > 0.0 else 0.0
    acting = replace(s, effort=first.acting, command=command, stiffness=stiffness)
    expected = without_sensor_errors(replace(acting, load_torque=load), *first.fit)
    signals = replace(acting, load_torque=load, expected_torque=expected, slow_torque=slow)
    return replace(first, clean=first.recorded.changed(samples=replace(samples, signals=signals)))
