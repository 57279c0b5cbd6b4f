"""One joint's log as a probabilistic model: the effort that motion and load need, recorded by imperfect channels.

    u = K (tau + J qddot) + sum_k b_k phi_k + sum_i f_i(a_i) + (what differs from run to run) + n + d

u is the effort on which the drive acted, b_k = K theta_k, w the effort that the model needs, and f_i what the age a_i
of channel i does (`Aged`). The effort is the target: what is scored is the density of what was recorded, given motion
and load. A drive effect without memory maps the recorded effort to u, and its Jacobian is part of the density; a filter
of the effort (delay, lag) enters by its inverse, computed on w, which has no noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.linear import Prior
from drake_tc.diagnosis.priors import (
    AGE_PERIODS,
    AGE_REACH,
    CONTRIBUTION,
    DECLARED_CONTRIBUTION,
    DRIVE_LAG_S,
    FRICTION_FORM,
    HELD_GAIN,
    LEAST_GAIN,
    SERVO_LAG_S,
    UNIFORM,
)
from drake_tc.diagnosis.problem.columns import CACHE_BYTES, Term, drives
from drake_tc.diagnosis.split import AVERAGED, LATE_RECORD, Split, stands_for, starts_unknown, with_clean, with_needed
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.check import plausible_range
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.torque_sensor_gain import TorqueSensorGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Block:
    """Columns (N, k) in units of the effort for coefficients with a prior.

    Attributes:
        of_log: Whether they are of the log. Reported errors are without what the log does, and with what the joint does
            that no model file has.
    """

    values: FloatArray
    prior: Prior
    of_log: bool = True


@dataclass(frozen=True)
class RunSpread:
    """Standard deviations from run to run: of each friction over its mean, of the effort's zero over its RMS.

    Attributes:
        known: Whether they are known, and not estimated from the runs at hand.
    """

    friction: float = 0.0
    zero: float = 0.0
    known: bool = False

    def of(self, terms: Sequence[Term]) -> "RunSpread":
        """With terms that begin each run in an unknown state: the zero of a run is then any."""
        return replace(self, zero=CONTRIBUTION) if starts_unknown(terms) else self


@dataclass(frozen=True, eq=False)
class SharedColumns:
    """Columns (N, r) [N m] of what a joint shares with others, by which its load errs, in the rows of both splits.

    Attributes:
        train, held: Columns.
        prior: Of their coefficients: what the other joints know of them.
    """

    train: FloatArray
    held: FloatArray
    prior: Prior


@dataclass(frozen=True, eq=False)
class JointModel:
    """One joint: what is declared, what is asked, and the nuisances.

    Attributes:
        train, held: Splits.
        declared: Terms of the declared model.
        context: What the training logs offer to the effects.
        held_gain: K at which the drive is held [effort/(N m)]; None where it is fitted.
        gain, friction, viscous: K [effort/(N m)], Coulomb [N m] and viscous friction [N m s/rad] of the declared fit.
        common_zero: Whether a constant that all runs share is a nuisance.
        shared: What it shares with other joints; None for a joint of its own.
    """

    train: Split
    held: Split
    declared: tuple[Term, ...]
    context: Context
    held_gain: float | None
    gain: float
    friction: float
    viscous: float
    common_zero: bool = False
    shared: SharedColumns | None = None

    @cached_property
    def scale(self) -> float:
        """RMS of the recorded effort of the training rows."""
        return max(rms(self.train.recorded.effort(())), 1e-300)

    @property
    def least_gain(self) -> float:
        """K below which a set needs no effort at all [effort/(N m)]."""
        return LEAST_GAIN * self.gain

    @cached_property
    def of_load(self) -> float:
        """Share of the sensors' noise in what a set leaves that is the noise of a measured load."""
        if self.context.load != "torque":
            return 0.0
        samples, own, sizes = self.train.samples, self.train.samples.signals, []
        for drawn in (noisy.samples.signals for noisy in self.train.noisy):
            torque = self.gain * (drawn.load_torque - own.load_torque)
            motion = self.gain * own.rotor_inertia * (drawn.acceleration - own.acceleration)
            sizes.append([rms(samples.reduce(each)) ** 2 for each in (torque, motion, drawn.effort - own.effort)])
        by_channel = np.sum(sizes, axis=0)
        return float(by_channel[0] / max(np.sum(by_channel), 1e-300))

    def blocks(self, split: Split, terms: Sequence[Term]) -> list[Block]:
        """Columns of the drive gain and of the terms, in their order."""
        return [self._gain(split, terms), *(self.block(split, t) for t in terms if t.effect.coefficients)]

    def _gain(self, split: Split, terms: Sequence[Term]) -> Block:
        values = split.recorded.target[:, None]
        one, yes = np.ones(1), np.ones(1, dtype=bool)
        free = self.held_gain is None or any(isinstance(t.effect, ServoGain) for t in terms)
        if not free and self.held_gain is not None:
            known = max(HELD_GAIN, self.context.tolerances.get(TorqueSensorGain.id, 0.0))  # a sensor scales both
            return Block(values, Prior(self.held_gain * one, known * self.held_gain * one, yes))
        size = max(rms(self.train.recorded.target), 1e-300)
        return Block(values, Prior(0.0 * one, DECLARED_CONTRIBUTION * self.scale / size * one, yes))

    @cached_property
    def _blocks(self) -> dict[tuple[object, ...], Block]:
        return {}

    def block(self, split: Split, term: Term) -> Block:
        """Columns of a term."""
        key = (split is self.train, *term.cache_key)
        if key not in self._blocks:
            if sum(each.values.nbytes for each in self._blocks.values()) > CACHE_BYTES:
                self._blocks.clear()
            self._blocks[key] = self._made(split, term)
        return self._blocks[key]

    def _made(self, split: Split, term: Term) -> Block:
        values, effect = split.of(term), term.effect
        train = values if split is self.train else self.train.of(term)
        size = np.sqrt(np.mean(train**2, axis=0))
        wide = DECLARED_CONTRIBUTION if self.is_declared(effect) else CONTRIBUTION
        largest = float(size.max(initial=0.0)) or 1.0  # a column of zeros tells nothing
        most = self.train.gain * np.array([p.upper for p in effect.coefficients])
        deviation = np.minimum(wide * self.scale / np.maximum(size, 1e-9 * largest), most)
        if isinstance(effect, WithinTolerance):
            deviation = self.train.gain * np.asarray(effect.tolerances, float)
        positive = np.array([p.lower >= 0.0 for p in effect.coefficients])
        return Block(values, Prior(np.zeros(size.size), deviation, positive))

    def is_declared(self, effect: Effect) -> bool:
        """Whether the effect is part of the declared model."""
        return any(t.effect.key == effect.key for t in self.declared)

    @cached_property
    def ages(self) -> Mapping[str, tuple[float, float]]:
        """By channel, mean and standard deviation of its age against the position's clock [s]."""
        samples, drive = self.train.samples, self.context.drive
        mean, spread = (x * samples.effort_period for x in AGE_PERIODS)
        if samples.effort_age > 0.0 and drive == "position_servo":
            mean, spread = 0.0, UNIFORM * samples.effort_period  # the mean over the hold is taken already
        lag, unknown = SERVO_LAG_S if drive == "position_servo" else DRIVE_LAG_S
        if drive == "position_servo":
            half = 0.5 * self._averaged
            out = {
                "command": (mean, spread),
                "inside": (lag, unknown),
                "rate": (lag + half, float(np.hypot(unknown, half))),
            }
        else:
            out = {"effort": (mean + lag, float(np.hypot(spread, unknown)))}
        if self.context.load == "torque":
            out["torque"] = (0.0, UNIFORM * samples.torque_period)
        out["position"] = (0.0, UNIFORM * samples.signals.period)
        return out

    @property
    def _averaged(self) -> float:
        """Lag of a servo's damping [s] that looks like a position averaged over its period, see `AVERAGED`."""
        damping = self.gain * self.viscous
        return AVERAGED * self.train.samples.signals.period**2 / damping if damping > 0.0 else 0.0

    @property
    def averages(self) -> list[str]:
        """Channels that may be averages over their periods; that of a servo's position is in the age of the rate."""
        return [channel for channel in ("effort", "torque") if channel in self.ages]

    def against_position(self, channel: str) -> FloatArray:
        """(a,) weights of the ages in the age of a channel against the position."""
        position = -LATE_RECORD.get(channel, 0.0)
        return np.array([{channel: 1.0, "position": position}.get(name, 0.0) for name in self.ages])

    def held_ages(self, terms: Sequence[Term]) -> frozenset[int]:
        """Numbers of the ages that are held at 0, see `stands_for`."""
        held = stands_for(terms)
        held = held | {"position"} if held else held
        return frozenset(number for number, channel in enumerate(self.ages) if channel in held)

    def nuisances(self, split: Split) -> list[Block]:
        """Columns of ages and averages of channels, of friction near rest off its law, and of what joints share."""
        out, columns = [], split.age_columns(self.ages, self.viscous)
        for number, (channel, (mean, deviation)) in enumerate(self.ages.items()):
            reach = np.inf if channel == "rate" else AGE_REACH  # no delay is one of a servo's damping alone
            prior = Prior(np.array([mean]), np.array([deviation]), np.zeros(1, dtype=bool), reach)
            out.append(Block(columns[:, [number]], prior))
        out += [self._averaged_channel(split, each) for each in self.averages]
        out.append(self._friction_form(split))
        if self.common_zero:
            one = np.ones((split.samples.rows.size, 1))
            out.append(Block(one, Prior(np.zeros(1), np.array([CONTRIBUTION * self.scale]), np.zeros(1, dtype=bool))))
        if self.shared is not None:
            columns = self.shared.train if split is self.train else self.shared.held
            out.append(Block(-split.gain * columns, self.shared.prior))
        return out

    @staticmethod
    def _averaged_channel(split: Split, channel: str) -> Block:
        """Column of a channel that is an average over its period where the position is an instant, or the reverse."""
        deviation = np.array([np.sqrt(2.0) * UNIFORM])
        return Block(split.averaged(channel)[:, None], Prior(np.zeros(1), deviation, np.zeros(1, dtype=bool)))

    def _friction_form(self, split: Split) -> Block:
        """Column by which friction near rest may differ from Coulomb and viscous friction."""
        deviation = max(FRICTION_FORM * split.gain * self.friction, HELD_GAIN * self.scale)
        prior = Prior(np.zeros(1), np.array([deviation]), np.zeros(1, dtype=bool))
        return Block(split.near_rest, prior, of_log=False)

    def noise_of_ages(self, number: int) -> FloatArray:
        """(N, a) noise of a channel in the columns of ages and averages."""
        noisy, own = (
            np.column_stack([split.age_columns(self.ages, self.viscous), *map(split.averaged, self.averages)])
            for split in (self.train.noisy[number], self.train)
        )
        return np.asarray(noisy - own)

    def of_runs(self, split: Split, spread: "RunSpread") -> list[Block]:
        """Columns of what differs from run to run: Coulomb and viscous friction, and the zero of the effort."""
        out, friction = [], spread.friction * split.gain
        sizes = (friction * self.friction, friction * self.viscous, spread.zero * self.scale)
        for columns, deviation in zip(split.run_columns, sizes, strict=True):
            if deviation > 0.0:
                size = columns.shape[1]
                out.append(Block(columns, Prior(np.zeros(size), np.full(size, deviation), np.zeros(size, dtype=bool))))
        return out

    def shape_prior(self, terms: Sequence[Term]) -> Prior:
        """Of all shape parameters (s,), about where they are, as dense as a uniform prior over their range."""
        ranges = [self._shape_range(t.effect, p.name) for t in terms for p in t.effect.shapes]
        size = len(ranges)
        return Prior(np.zeros(size), np.array(ranges) / np.sqrt(2.0 * np.pi), np.zeros(size, dtype=bool))

    def _shape_range(self, effect: Effect, name: str) -> float:
        """A shape parameter's plausible range on this rig, or that of the starting points."""
        parameter = next(p for p in effect.shapes if p.name == name)
        low, high = plausible_range(parameter, self.context)
        low, high = max(low, parameter.lower), min(high, parameter.upper)
        if np.isfinite(high - low):
            return float(high - low)
        grid = [shape[name] for shape in effect.shape_grid(self.context)]
        return float(max(max(grid) - min(grid), abs(max(grid)), 1e-12))

    def relinearised(
        self, terms: Sequence[Term], theta: FloatArray, gain: float, ages: Mapping[str, float]
    ) -> "JointModel":
        """The model linearised at a fit: `theta` (k,) of the terms, K, and the ages of the channels [s]."""
        beta, measured = np.concatenate([[1.0 / gain], theta]), self.context.load == "torque"
        own = {channel: age for channel, age in ages.items() if channel not in stands_for(drives(terms))}
        there = [split.with_load_at(terms, beta, own.get("torque", 0.0)) for split in (self.train, self.held)]
        train, held = (
            replace(
                with_needed(split.recorded, terms, beta, measured=measured, ages=own), bent=split.bent, late=split.late
            )
            for split in there
        )
        return replace(self, train=train, held=held)

    def with_share(self, share: float) -> "JointModel":
        """The model whose latent effort follows the recorded one by another share: all of its noise, or none."""
        taps = np.array([share])
        train, held = (with_clean(replace(s, share=taps, of_load=taps)) for s in (self.train, self.held))
        return replace(self, train=train, held=held)
