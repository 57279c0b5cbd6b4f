"""Several joints as one regression: rigid-body columns that all share, and each shaft's signals for the effects.

    y_j = (Y pi)_j + sum_a r_aj sum_k theta_ak phi_k(signals of shaft a)          y: drive torque [N m], (T, n)

Unlike the balance of one joint the load is not measured: the drives' torque is the target, the links' parameters pi are
unknown, and the load that an effect sees is the rigid part of the declared fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from drake_tc.diagnosis.data.resolution import Resolution, sample_noise
from drake_tc.diagnosis.data.sliding import direction_of_motion
from drake_tc.diagnosis.problem.arm.shafts import Axis
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, Signals, plain_signals
from drake_tc.errors import IdentificationError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.channels import grid_step
from drake_tc.types import BoolArray, FloatArray, IntArray

RigidColumns = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(q, v, vdot), (T, n) each, to Y (T, n, p)."""
BLOCK_SECONDS = 0.25


@dataclass(frozen=True, eq=False)
class JointLog:
    """One run of n joints: positions (T, n) [rad] and drive torques (T, n) [N m] at one period [s]."""

    name: str
    period: float
    position: FloatArray
    torque: FloatArray


@dataclass(frozen=True, eq=False)
class ArmRows:
    """Filtered logs of n joints, end to end, and the rows that take part.

    Attributes:
        axes: Shafts on which effects act.
        signals: (T,) signals of each shaft.
        torque: y (N, n) after both kernels. rigid: Y (N, n, p) after both kernels.
        segments: The runs. light: the kernel that motion and columns pass twice. reach_s: how far apart
            rows share no sample [s].
        rows: (N,) indices into T. run, block: (N,) of each row; a block never spans two runs.
    """

    axes: tuple[Axis, ...]
    signals: tuple[Signals, ...]
    torque: FloatArray
    rigid: FloatArray
    segments: tuple[slice, ...]
    light: CommonKernel
    reach_s: float
    rows: IntArray
    run: IntArray
    block: IntArray

    def of(self, axis: int, term: Term) -> FloatArray:
        """Phi (N, k) of an effect on a shaft, after both kernels."""
        parts = [term.effect.columns(self.signals[axis].take(s), term.shape) for s in self.segments]
        values = np.concatenate(parts)
        if not term.effect.linear:
            values = self._each(self.light, values)
        return self._each(self.light, values)[self.rows]

    def spread(self, axis: int, columns: FloatArray) -> FloatArray:
        """Columns (N, k) of a shaft as they load the joints (N, n, k)."""
        return np.asarray(np.array(self.axes[axis].turns)[None, :, None] * columns[:, None, :])

    def with_load(self, pi: FloatArray, raw: FloatArray) -> "ArmRows":
        """The same with tau = Y pi as the load of every shaft; `raw` (T, n, p) is Y after the light kernel alone."""
        tau = raw @ pi
        signals = []
        for axis, s in zip(self.axes, self.signals, strict=True):
            load = tau @ np.array(axis.carries)
            signals.append(replace(s, load_torque=load, expected_torque=load, slow_torque=load))
        return replace(self, signals=tuple(signals))

    def take(self, chosen: BoolArray) -> "ArmRows":
        """The same with some of the rows (N,)."""
        kept = {f.name: getattr(self, f.name)[chosen] for f in fields(self) if f.name in _BY_ROW}
        return replace(self, **kept)

    def context(self, axis: int) -> Context:
        """What the logs offer to effects on a shaft."""
        s = self.signals[axis].take(self.rows)
        span = np.percentile(s.effort, [0.05, 99.95])
        return Context(
            drive="current",
            load="torque",
            recorded=frozenset(),
            max_speed=float(np.percentile(np.abs(s.velocity), 99.5)),
            position_span=(float(s.position.min()), float(s.position.max())),
            effort_span=(float(span[0]), float(span[1])),
            period=s.period,
        )

    def _each(self, kernel: CommonKernel, values: FloatArray) -> FloatArray:
        return _filtered(kernel.smooth, values, self.segments)


_BY_ROW = ("torque", "rigid", "rows", "run", "block")


def _filtered(
    filter_: Callable[[FloatArray, Sequence[slice]], FloatArray], values: FloatArray, segments: Sequence[slice]
) -> FloatArray:
    flat = values.reshape(values.shape[0], -1)
    if flat.shape[1] == 0:
        return values
    return np.stack([filter_(flat[:, i], segments) for i in range(flat.shape[1])], axis=-1).reshape(values.shape)


def _signals(axis: Axis, q: FloatArray, light: CommonKernel, segments: Sequence[slice], y: FloatArray) -> Signals:
    turned = q @ np.array(axis.turns)
    period = light.period
    position, velocity = light.smooth(turned, segments), light.derivative(turned, segments)
    step = grid_step(turned)
    noise = max(sample_noise(turned, step, segments), 1e-12)
    resolution = Resolution(step, noise, 0.0, noise * float(np.sqrt(np.sum(light.kernels[1] ** 2))))
    direction, travel, _ = direction_of_motion(position, velocity, segments, resolution)
    known = {
        "time": np.concatenate([np.arange(s.stop - s.start) * period for s in segments]),
        "position": position,
        "velocity": velocity,
        "acceleration": light.second_derivative(turned, segments),
        "effort": y @ np.array(axis.carries),
        "direction": direction,
        "travel": travel,
        "temperature": np.full(turned.size, np.nan),
        "motor_position": np.full(turned.size, np.nan),
        "supply_voltage": np.full(turned.size, np.nan),
    }
    return replace(plain_signals(turned.size, known), period=period)


def arm_rows(
    logs: Sequence[JointLog],
    axes: Sequence[Axis],
    rigid: RigidColumns,
    widths_s: tuple[float, float],
    slowest: float,
) -> tuple[ArmRows, FloatArray]:
    """Filter the logs of n joints and choose the rows.

    Args:
        logs: Runs at one period.
        axes: Shafts.
        rigid: The links' columns; computed from lightly filtered motion and then filtered like the torque.
        widths_s: Of the kernel that the torque passes twice, and of the one that the motion and all columns pass twice
            [s]. The second is wider where the motion tells less of the link than the torque does (play, encoder
            error): what the columns then lack of the torque counts as error.
        slowest: A sample takes part where the fastest shaft turns faster than this [rad/s].

    Returns:
        The rows, and the rigid columns (T, n, p) before the final kernel.

    Raises:
        IdentificationError: fewer than 100 rows.
    """
    period = logs[0].period
    narrow, light = (CommonKernel(width, period) for width in widths_s)
    ends = np.cumsum([log.position.shape[0] for log in logs])
    segments = tuple(slice(int(e - log.position.shape[0]), int(e)) for e, log in zip(ends, logs, strict=True))
    q, y = (np.concatenate([getattr(log, name) for log in logs]) for name in ("position", "torque"))
    smooth = _filtered(narrow.smooth, y, segments)
    signals = tuple(_signals(axis, q, light, segments, smooth) for axis in axes)
    motion = [_filtered(f, q, segments) for f in (light.smooth, light.derivative, light.second_derivative)]
    raw = rigid(*motion)
    edge = 2 * max(light.margin, narrow.margin)
    usable = np.zeros(q.shape[0], dtype=bool)
    for s in segments:
        usable[s.start + edge : max(s.stop - edge, s.start + edge)] = True
    usable &= np.max([np.abs(s.velocity) for s in signals], axis=0) > slowest
    stride = max(1, narrow.box)
    usable[np.arange(usable.size) % stride != 0] = False
    rows = np.flatnonzero(usable)
    if rows.size < 100:
        raise IdentificationError(f"the joints move faster than {slowest:g} rad/s in {rows.size} rows only; wanted 100")
    run = np.searchsorted(ends, rows, side="right")
    starts = np.array([s.start for s in segments])[run]
    label = run * 10**6 + ((rows - starts) * period / BLOCK_SECONDS).astype(np.int64)
    out = ArmRows(
        axes=tuple(axes),
        signals=signals,
        torque=_filtered(narrow.smooth, smooth, segments)[rows],
        rigid=_filtered(light.smooth, raw, segments)[rows],
        segments=segments,
        light=light,
        reach_s=2 * edge * period,
        rows=rows,
        run=run.astype(np.int64),
        block=np.unique(label, return_inverse=True)[1].astype(np.int64),
    )
    return out, raw
