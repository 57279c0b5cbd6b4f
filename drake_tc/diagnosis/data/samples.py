"""The rows of a regression: one joint's filtered signals, and which of them take part."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np
from scipy.ndimage import minimum_filter1d

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.data.resolution import NoiseFloor, Resolution
from drake_tc.diagnosis.notes import RunNote
from drake_tc.effects.base import Effect, Shape, Signals
from drake_tc.filtering.common_kernel import BlockConvolution, CommonKernel
from drake_tc.types import BoolArray, FloatArray, IntArray

LONGEST_MEMORY = 0.5
"""Of a filter of the effort [s]."""
FILTERED = (
    "position",
    "velocity",
    "acceleration",
    "load_torque",
    "expected_torque",
    "slow_torque",
    "effort",
    "command",
)
"""Signals that the light kernel has passed."""


@dataclass(frozen=True)
class SensorPrior:
    """Weight of the tolerances in a joint's regression: see `effects.within_tolerance`.

    A parameter of tolerance t has the precision (sigma^2/share)/t^2, in units in which a row's squared residual counts
    1.

    Attributes:
        variance: sigma^2 of the residual [N^2 m^2]; each fit then takes its own.
        share: n/N of N rows that are correlated in time and say as much as n independent ones.
    """

    variance: float
    share: float


@dataclass(frozen=True)
class Samples:
    """One joint's runs, filtered, end to end, and the rows that take part in the regression.

    Attributes:
        signals: (T,) filtered by the light kernel, at the log's rate, all runs one after the other.
        segments: Contiguous uniform stretches of `signals`.
        light: The kernel that smoothed and differentiated the signals.
        kernel: The final low-pass that every column and the target pass.
        rows: (N,) indices into T: where the joint resolvably moves and the filters owe nothing to an end.
        run: (N,) index of the run; `block`: (N,) consecutive half-second blocks, never across a gap.
        moving: (T,) whether the direction of motion is resolved.
        runs: The runs' names, by index. `notes`: what was done to them, or seen in them.
        resolution: See `Resolution`.
        floor: What noise alone leaves in the rows.
        row_period: Mean time between rows inside a block [s].
        load_unknown: Whether nothing is known of the load torque: the signals' load is 0 until a fit tells it.
        units: Of the joint's quantities; torques are told as effort where nothing fixes their scale (`load_scale`).
        effort_age: By how many sampling periods the command or effort that acts is older than the recorded one.
        sensor_prior: Of the joint's own sensor errors; None where no tolerance is declared.
        timing: (N, 3, 3) `timing_moments` of the rows; None where the sampling instants do not scatter.
        between: (N,) `between_samples` of the rows [N m]^2; None where the torque has the clock of the log.
        effort_period, torque_period: At which the effort and a measured torque were sampled [s].
    """

    signals: Signals
    segments: tuple[slice, ...]
    light: CommonKernel
    kernel: CommonKernel
    rows: IntArray
    run: IntArray
    block: IntArray
    moving: BoolArray
    runs: tuple[str, ...]
    resolution: Resolution
    floor: NoiseFloor
    row_period: float
    run_of_sample: IntArray
    notes: tuple[RunNote, ...] = field(default=())
    load_unknown: bool = False
    effort_age: float = 0.0
    units: JointUnits = TURNING
    sensor_prior: SensorPrior | None = None
    timing: FloatArray | None = None
    between: FloatArray | None = None
    effort_period: float = 0.0
    torque_period: float = 0.0

    def __getstate__(self) -> dict[str, object]:
        """The fields alone, without what has been computed from them."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def reduce(self, values: FloatArray, *, fresh: bool = False) -> FloatArray:
        """Low-pass (T,) or (T, k) values and keep the rows: (N,) or (N, k).

        `fresh` values have not passed the light kernel yet (a nonlinear function of signals that have): they pass it
        now, so that every channel has seen the same filters.
        """
        if values.ndim == 2:
            kept = [self.reduce(values[:, k], fresh=fresh) for k in range(values.shape[1])]
            return np.stack(kept, axis=-1) if kept else np.zeros((self.rows.size, 0))
        low_pass, places = self._both if fresh else self._final
        return low_pass.at(values, places)

    def rate(self, values: FloatArray) -> FloatArray:
        """Time derivative of values (N,) of the rows from neighbouring rows; 0 of a row that has none [1/s]."""
        apart = np.diff(self.rows)
        near = apart == np.median(apart)
        slope = np.where(near, np.diff(values) / (apart * self.signals.period), 0.0)
        total, count = np.zeros(values.size), np.zeros(values.size)
        for side in (slice(None, -1), slice(1, None)):
            total[side] += slope
            count[side] += near
        return np.asarray(total / np.maximum(count, 1.0))

    def settled(self, values: FloatArray, segment: slice) -> FloatArray:
        """A stretch of values (T,), in which the filter's margins repeat the first and the last sample inside them.

        The margins hold the other stretches' signals: the derivative of the jump between two runs would stay in the
        memory of a lag beyond the margin.
        """
        out = values[segment].copy()
        edge = min(self.light.margin, (out.size - 1) // 2)
        out[:edge], out[out.size - edge :] = out[edge], out[out.size - 1 - edge]
        return out

    def with_settled_margins(self) -> Self:
        """These samples, the margins of every filtered signal as in `settled`."""

        def everywhere(values: FloatArray) -> FloatArray:
            return np.concatenate([self.settled(values, segment) for segment in self.segments])

        changed: dict[str, Any] = {name: everywhere(getattr(self.signals, name)) for name in FILTERED}
        return replace(self, signals=replace(self.signals, **changed))

    @cached_property
    def sliding(self) -> BoolArray:
        """(T,) where the direction of motion stays resolved for as long as the light kernel sees.

        Closer to a reversal the kernel mixes friction of both directions.
        """
        out = np.zeros(self.moving.size, dtype=bool)
        for s in self.segments:
            out[s] = minimum_filter1d(self.moving[s].astype(np.uint8), 2 * self.light.margin + 1, mode="nearest")
        return out

    @cached_property
    def _final(self) -> tuple[BlockConvolution, IntArray]:
        return self._on_rows(BlockConvolution(self.kernel.kernels[0]))

    @cached_property
    def _both(self) -> tuple[BlockConvolution, IntArray]:
        """Both kernels in one: rows lie inside the margins of the two, where one pass gives what two passes give."""
        return self._on_rows(BlockConvolution(np.convolve(self.light.kernels[0], self.kernel.kernels[0])))

    def _on_rows(self, low_pass: BlockConvolution) -> tuple[BlockConvolution, IntArray]:
        """A low-pass and where it finds the rows."""
        return low_pass, low_pass.places(self.rows - low_pass.margin)

    def pulse(self) -> tuple[FloatArray, Signals]:
        """(M,) one sample through both kernels, followed for `LONGEST_MEMORY`, and signals of that length.

        It begins with a zero: filters take the first value for that before the log.
        """
        kernel = np.convolve(self.light.kernels[0], self.kernel.kernels[0])
        size = 1 + kernel.size + round(LONGEST_MEMORY / self.light.period)
        out = np.zeros(size)
        out[1 : 1 + kernel.size] = kernel
        return out, self.signals.take(np.minimum(np.arange(size), len(self.signals) - 1))

    def by_segment(
        self, effect: Effect, shape: Shape, values: FloatArray | None = None, *, undo: bool = False
    ) -> FloatArray:
        """An effect's columns, or with `values` its transform of them, stretch by stretch: memory never spans a gap.

        `undo`: the inverse of the transform.
        """
        parts = []
        for segment in self.segments:
            piece = self.signals.lazily(partial(self.settled, segment=segment))
            if values is None:
                parts.append(effect.columns(piece, shape))
            else:
                act = effect.undone if undo else effect.transform  # type: ignore[attr-defined]
                parts.append(act(self.settled(values, segment), piece, shape))
        width = parts[0].shape[1:]
        out = np.zeros((len(self.signals), *width))
        for segment, part in zip(self.segments, parts, strict=True):
            out[segment] = part
        return out


def one_clock(samples: Sequence[Samples]) -> bool:
    """Whether all sides count the same samples."""
    return all(s.segments == samples[0].segments and s.signals.period == samples[0].signals.period for s in samples)


def rms(values: FloatArray) -> float:
    """Root mean square of values (N,); 0 of none."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
