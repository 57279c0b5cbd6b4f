"""From recorded runs to the rows of a regression: common filtering, direction of motion, and which samples may be used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from drake_tc.effects.base import Context, Effect, Shape, Signals
from drake_tc.errors import IdentificationError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.common_rate import at_common_period
from drake_tc.logs.loads import GRAVITY, Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray, IntArray

BLOCK_SECONDS = 0.5
MAX_ROWS = 60_000
SLOWER = 3.0
CHUNK_SECONDS = 5.0
LEAST_TRAVEL = 1e-3
"""Travel after a reversal [rad] before the joint counts as sliding: the bristles of any gear wind up over less."""


@dataclass(frozen=True)
class Resolution:
    """What the sensors resolve, estimated from the log itself.

    Attributes:
        position_step: Smallest step between different positions [rad].
        position_noise, torque_noise: White noise of one raw sample [rad, N m].
        velocity_noise: Of the filtered velocity [rad/s].
    """

    position_step: float
    position_noise: float
    torque_noise: float
    velocity_noise: float


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
        runs: The runs' names, by index. `notes`: what was done to them.
        resolution: See `Resolution`.
        row_period: Mean time between rows inside a block [s].
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
    row_period: float
    run_of_sample: IntArray
    notes: tuple[str, ...] = field(default=())

    def reduce(self, values: FloatArray, *, fresh: bool = False) -> FloatArray:
        """Low-pass (T,) or (T, k) values and keep the rows: (N,) or (N, k).

        `fresh` values have not passed the light kernel yet (a nonlinear function of signals that have): they pass it now,
        so that every channel has seen the same filters.
        """
        if values.ndim == 2:
            kept = [self.reduce(values[:, k], fresh=fresh) for k in range(values.shape[1])]
            return np.stack(kept, axis=-1) if kept else np.zeros((self.rows.size, 0))
        if fresh:
            values = self.light.smooth(values)
        return self.kernel.smooth(values)[self.rows]

    def scout(self, most: int) -> "Samples":
        """Every k-th five-second chunk, so that at most about `most` of the T samples are left; itself when they are few."""
        every = int(np.ceil(len(self.signals) / most))
        if every <= 1:
            return self
        length = max(round(CHUNK_SECONDS / self.signals.period), 4 * self.kernel.margin)
        chunks = [
            slice(start, min(start + length, s.stop))
            for s in self.segments
            for start in range(s.start, s.stop, length * every)
        ]
        kept = np.concatenate([np.arange(c.start, c.stop) for c in chunks])
        place = np.full(len(self.signals), -1)
        place[kept] = np.arange(kept.size)
        edge = self.kernel.margin + self.light.margin
        inner = np.zeros(len(self.signals), dtype=bool)
        for c in chunks:
            inner[c.start + edge : max(c.stop - edge, c.start + edge)] = True
        use = inner[self.rows]
        ends = np.cumsum([c.stop - c.start for c in chunks])
        return replace(
            self,
            signals=self.signals.take(kept),
            segments=tuple(slice(int(e - (c.stop - c.start)), int(e)) for e, c in zip(ends, chunks, strict=True)),
            rows=place[self.rows[use]],
            run=self.run[use],
            block=np.unique(self.block[use], return_inverse=True)[1].astype(np.int64),
            moving=self.moving[kept],
            run_of_sample=self.run_of_sample[kept],
        )

    def by_segment(self, effect: Effect, shape: Shape, values: FloatArray | None = None) -> FloatArray:
        """An effect's columns, or with `values` its transform of them, stretch by stretch: memory never spans a gap."""
        parts = []
        for segment in self.segments:
            piece = self.signals.take(segment)
            if values is None:
                parts.append(effect.columns(piece, shape))
            else:
                parts.append(effect.transform(values[segment], piece, shape))  # type: ignore[attr-defined]
        width = parts[0].shape[1:]
        out = np.zeros((len(self.signals), *width))
        for segment, part in zip(self.segments, parts, strict=True):
            out[segment] = part
        return out


def light_width(position: FloatArray, segments: Sequence[slice], period: float) -> tuple[float, float, float]:
    """Width of the light kernel [s] and the position's (step, noise) [rad].

    The narrowest width whose acceleration noise is below 4 % of the acceleration's own spread, between 4 periods (at
    least 12 ms) and 60 ms: wide enough to differentiate the encoder twice, narrow enough to keep reversals sharp.
    """
    inside = np.concatenate([position[s] for s in segments])
    steps = np.abs(np.diff(inside))
    positive = steps[steps > 1e-12]
    step = float(np.min(positive)) if positive.size else 0.0
    step = (
        step
        if np.mean(np.abs(np.round(positive / step) * step - positive) < 0.02 * step) > 0.9
        else 0.0
        if step
        else 0.0
    )
    third = np.concatenate([np.diff(position[s], 3) for s in segments if s.stop - s.start > 8] or [np.zeros(1)])
    noise = max(step / np.sqrt(12.0), 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0), 1e-12)
    width = max(4.0 * period, 0.012)
    while width < 0.060:
        kernel = CommonKernel(width, period)
        longest = max(segments, key=lambda s: s.stop - s.start)
        acceleration = kernel.second_derivative(position[longest])
        gain = float(np.sqrt(np.sum(kernel._kernels[2] ** 2)))
        if noise * gain < 0.04 * float(np.std(acceleration)):
            break
        width *= 1.25
    return width, step, noise


def build_samples(runs: Sequence[Run], rig: Rig, joint: str, width_s: float | None = None) -> Samples:
    """Filter the runs' channels with common kernels and choose the rows.

    Args:
        runs: Runs on uniform clocks. rig: says drive and load. joint: which joint.
        width_s: Width of the light kernel [s]; None lets the data choose.

    Raises:
        IdentificationError: the joint never resolvably moves.
    """
    runs = at_common_period(runs)
    period = float(np.median([r.period for r in runs]))
    pieces = [(i, run, s) for i, run in enumerate(runs) for s in run.segments() if s.stop - s.start > 40]
    if not pieces:
        raise IdentificationError(
            f"joint {joint}: no stretch of more than 40 usable samples in {[r.name for r in runs]}"
        )

    def gather(column: str) -> FloatArray:
        parts = [
            np.asarray(run.columns[column][s], float) if column in run.columns else np.full(s.stop - s.start, np.nan)
            for _, run, s in pieces
        ]
        return np.concatenate(parts)

    lengths = [s.stop - s.start for _, _, s in pieces]
    ends = np.cumsum(lengths)
    segments = tuple(slice(int(e - n), int(e)) for e, n in zip(ends, lengths, strict=True))
    run_of = np.repeat([i for i, _, _ in pieces], lengths)
    raw_q = gather(f"{joint}/position")
    width, step, noise = light_width(raw_q, segments, period)
    light = CommonKernel(width if width_s is None else width_s, period)
    final = CommonKernel(light.actual_width_s, period)

    def smooth(column: str) -> FloatArray:
        values = gather(column)
        return light.smooth(values) if np.isfinite(values).any() else values

    # one pass over all stretches end to end: what leaks across a joint stays inside the margins that no row uses
    q, v, a = light.smooth(raw_q), light.derivative(raw_q), light.second_derivative(raw_q)
    drive = rig.drive[joint]
    name = {"position_servo": "position_command", "current": "current", "voltage": "voltage"}[drive]
    command = smooth(f"{joint}/{name}")
    motor_position = smooth(f"{joint}/motor_position")
    effort = command - q if drive == "position_servo" else command
    load = rig.load[joint]
    slope = np.zeros_like(q)
    raw_torque = gather(f"{joint}/torque")
    if isinstance(load, Pendulum):
        moment = load.mass * GRAVITY * load.length
        torque = light.smooth(moment * np.sin(raw_q - load.zero)) + load.inertia * a
        slow = CommonKernel(SLOWER * light.actual_width_s, period)
        slow_torque = slow.smooth(moment * np.sin(raw_q - load.zero)) + load.inertia * slow.second_derivative(raw_q)
        slope = moment * np.cos(q - load.zero)
    else:
        torque = smooth(f"{joint}/torque")
        slow_torque = CommonKernel(SLOWER * light.actual_width_s, period).smooth(raw_torque)
    torque_noise = _white_noise(raw_torque, segments) if not isinstance(load, Pendulum) else 0.0
    velocity_noise = noise * float(np.sqrt(np.sum(light._kernels[1] ** 2)))
    resolution = Resolution(step, noise, torque_noise, velocity_noise)
    inner = [slice(s.start + light.margin, max(s.stop - light.margin, s.start + light.margin)) for s in segments]
    direction, travel, moving = _direction(q, v, inner, resolution)
    time = np.concatenate([run.time[s] - run.time[0] for _, run, s in pieces])
    declared = rig.declared[joint]
    signals = Signals(
        time=time,
        position=q,
        velocity=v,
        acceleration=a,
        load_torque=torque,
        expected_torque=torque,
        slow_torque=slow_torque,
        effort=effort,
        command=command,
        direction=direction,
        travel=travel,
        load_slope=slope,
        temperature=smooth(f"{joint}/temperature"),
        motor_position=motor_position,
        known_torque=np.zeros_like(q),
        link_inertia=load.inertia if isinstance(load, Pendulum) else 0.0,
        rotor_inertia=float(declared.get("rotor_inertia") or 0.0),
        period=period,
    )
    rows, block = _choose_rows(moving, segments, final, light, period)
    if rows.size < 50:
        raise IdentificationError(
            f"joint {joint}: it resolvably moves in {rows.size} samples only (speed above {5 * velocity_noise:.2g} rad/s); "
            "record runs in which the joint moves"
        )
    per_block = float(np.median(np.diff(rows))) * period
    return Samples(
        signals=signals,
        segments=segments,
        light=light,
        kernel=final,
        rows=rows,
        run=run_of[rows],
        block=block,
        moving=moving,
        runs=tuple(r.name for r in runs),
        resolution=resolution,
        row_period=per_block,
        run_of_sample=run_of,
        notes=tuple(note for r in runs for note in r.notes),
    )


def context_of(samples: Samples, rig: Rig, joint: str) -> Context:
    """What the logs offer to the effects."""
    s = samples.signals
    rows = samples.rows
    recorded = frozenset(n for n in ("temperature", "motor_position") if s.has(n))
    declared: Mapping[str, float] = {k: float(v) for k, v in rig.declared[joint].items() if v is not None}
    low, high = np.percentile(s.effort[rows], [0.05, 99.95])
    load = rig.load[joint]
    return Context(
        drive=rig.drive[joint],
        load="pendulum" if isinstance(load, Pendulum) else "torque",
        link_inertia=load.inertia if isinstance(load, Pendulum) else 0.0,
        recorded=recorded,
        declared=declared,
        max_speed=float(np.percentile(np.abs(s.velocity[rows]), 99.5)),
        position_span=(float(s.position[rows].min()), float(s.position[rows].max())),
        effort_span=(float(low), float(high)),
        period=s.period,
    )


def _white_noise(values: FloatArray, segments: Sequence[slice]) -> float:
    third = np.concatenate([np.diff(values[s], 3) for s in segments])
    third = third[np.isfinite(third)]
    return 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0) if third.size else 0.0


def _direction(
    q: FloatArray, v: FloatArray, segments: Sequence[slice], resolution: Resolution
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Direction of the last resolved motion, travel since it turned, and where both are certain."""
    threshold = 5.0 * resolution.velocity_noise
    least_travel = max(8.0 * resolution.position_noise, LEAST_TRAVEL)
    direction, travel = np.zeros_like(q), np.zeros_like(q)
    for s in segments:
        sign = np.where(np.abs(v[s]) > threshold, np.sign(v[s]), 0.0)
        known = np.flatnonzero(sign)
        if known.size == 0:
            continue
        last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(sign.size), -1))
        held = np.where(last >= 0, sign[np.maximum(last, 0)], 0.0)
        # between two resolved signs the true crossing is where the velocity itself crosses
        held = np.where((sign == 0.0) & (np.sign(v[s]) != 0.0), np.sign(v[s]), held)
        turned = np.concatenate([[0], np.flatnonzero(np.diff(held)) + 1])
        start = turned[np.searchsorted(turned, np.arange(sign.size), side="right") - 1]
        direction[s] = held
        travel[s] = np.abs(q[s] - q[s][start])
    moving = np.zeros(q.size, dtype=bool)
    for s in segments:
        if s.stop > s.start:
            # how far the bristles were wound when the stretch began is unknown: wait for five times the travel
            settled = np.maximum.accumulate(travel[s]) > 5.0 * least_travel
            moving[s] = settled & (np.abs(v[s]) > threshold) & (travel[s] > least_travel)
    return direction, travel, moving


def _choose_rows(
    moving: BoolArray, segments: Sequence[slice], final: CommonKernel, light: CommonKernel, period: float
) -> tuple[IntArray, IntArray]:
    """Rows whose neighbourhood in the final kernel moves throughout, thinned to the kernel's resolution."""
    reach = max(1, int(0.6 * final.margin))
    usable = np.zeros(moving.size, dtype=bool)
    edge = final.margin + light.margin
    for s in segments:
        inner = minimum_filter1d(moving[s].astype(np.uint8), 2 * reach + 1, mode="nearest").astype(bool)
        inner[:edge] = False
        inner[max(0, inner.size - edge) :] = False
        usable[s] = inner
    stride = max(1, final.box // 2)
    stride = max(stride, int(np.ceil(usable.sum() / MAX_ROWS)))
    rows = np.concatenate([np.arange(s.start, s.stop, stride) for s in segments])
    rows = rows[usable[rows]]
    length = max(1, round(BLOCK_SECONDS / period))
    segment_of = np.searchsorted([s.stop for s in segments], rows, side="right")
    starts = np.array([s.start for s in segments])
    raw = segment_of * 10**7 + (rows - starts[segment_of]) // length
    block = np.unique(raw, return_inverse=True)[1]
    return rows.astype(np.int64), block.astype(np.int64)
