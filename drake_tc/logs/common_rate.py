"""Runs of different sampling periods brought to one, so that one filter serves them all."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.logs.record import Run
from drake_tc.types import FloatArray

SAME = 0.01


def at_common_period(runs: Sequence[Run]) -> tuple[Run, ...]:
    """The runs at the shortest of their periods; unchanged where the periods agree within 1 %.

    Between samples the channels are interpolated linearly, segment by segment: a low-pass of a few of the longest
    periods, which every later step applies, does not see the difference.

    Args:
        runs: Uniform inside their segments.
    """
    if not runs:
        return ()
    shortest = min(run.period for run in runs)
    return tuple(run if run.period <= (1.0 + SAME) * shortest else _resampled(run, shortest) for run in runs)


def _resampled(run: Run, period: float) -> Run:
    times: list[FloatArray] = []
    values: dict[str, list[FloatArray]] = {name: [] for name in run.columns}
    segments = []
    for part in run.segments():
        old = run.time[part]
        count = int(np.floor((old[-1] - old[0]) / period * (1.0 + 1e-12))) + 1
        new = old[0] + period * np.arange(count)
        times.append(new)
        segments.append(np.full(count, run.segment[part.start], dtype=np.int64))
        for name, column in run.columns.items():
            values[name].append(np.interp(new, old, column[part]))
    if not times:
        return run
    note = f"Resampled from {1e3 * run.period:.3g} ms to {1e3 * period:.3g} ms, the shortest period among the runs."
    return replace(
        run,
        time=np.concatenate(times),
        period=period,
        columns={name: np.concatenate(parts) for name, parts in values.items()},
        segment=np.concatenate(segments),
        notes=(*run.notes, note),
        acceleration_weights=None,
    )
