"""The recorded channels of one joint: the usable stretches of all runs, end to end at one period."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.notes import LogRemark, RunNote
from drake_tc.errors import IdentificationError
from drake_tc.logs.channels import at_common_period, grid_step
from drake_tc.logs.record import Run, concerns
from drake_tc.types import FloatArray, IntArray

SHORTEST = 40
"""A usable stretch has more samples than this."""


@dataclass(frozen=True)
class Channels:
    """The usable stretches of all runs, end to end.

    One filter pass goes over all of them: what leaks across a joint stays inside the margins that no row uses.
    """

    joint: str
    pieces: tuple[tuple[int, Run, slice], ...]
    period: float

    @property
    def segments(self) -> tuple[slice, ...]:
        """Where each stretch lies in the joined arrays."""
        lengths = [s.stop - s.start for _, _, s in self.pieces]
        return tuple(slice(int(e - n), int(e)) for e, n in zip(np.cumsum(lengths), lengths, strict=True))

    @property
    def run_of_sample(self) -> IntArray:
        """(T,) index of the run."""
        return np.repeat([i for i, _, _ in self.pieces], [s.stop - s.start for _, _, s in self.pieces])

    @property
    def time(self) -> FloatArray:
        """(T,) since the start of each run [s]."""
        return np.concatenate([run.time[s] - run.time[0] for _, run, s in self.pieces])

    @property
    def speed_only(self) -> bool:
        """Whether the position is the integral of the recorded velocity."""
        return any(self.joint in run.speed_only for _, run, _ in self.pieces)

    def step(self, name: str) -> float:
        """Step of the recorded values of `<joint>/name`, the median of the runs'; 0 where they lie on no grid."""
        column = f"{self.joint}/{name}"
        runs = {id(run): run for _, run, _ in self.pieces if column in run.columns}
        found = [
            grid_step(run.columns[column]) if run.source is None else run.steps.get(column, 0.0)
            for run in runs.values()
        ]
        return float(np.median(found)) if found else 0.0

    def slowest(self, names: Sequence[str]) -> float:
        """Longest period [s] at which one of the columns was sampled; at least that of the log."""
        sampled = [run.slower.get(name, self.period) for _, run, _ in self.pieces for name in names]
        return max(self.period, *sampled)

    def ratios(self, name: str) -> list[float]:
        """Of each stretch, the period at which `<joint>/name` was sampled over that of the log, at least 1."""
        column = f"{self.joint}/{name}"
        return [max(run.slower.get(column, self.period) / self.period, 1.0) for _, run, _ in self.pieces]

    def notes(self, runs: Sequence[Run]) -> tuple[LogRemark, ...]:
        """What was done to the runs as they came and at the common period."""
        both = (LogRemark(run.name, note) for run in (*runs, *(run for _, run, _ in self.pieces)) for note in run.notes)
        return tuple(dict.fromkeys(both))

    def by_piece(self, values: Sequence[float]) -> FloatArray:
        """(T,) of one value for each stretch."""
        return np.repeat(np.asarray(values, float), [s.stop - s.start for _, _, s in self.pieces])

    def raw(self, name: str) -> FloatArray:
        """(T,) of `<joint>/name`, NaN in runs that did not record it."""
        column = f"{self.joint}/{name}"
        return np.concatenate(
            [
                np.asarray(run.columns[column][s], float)
                if column in run.columns
                else np.full(s.stop - s.start, np.nan)
                for _, run, s in self.pieces
            ]
        )


def channels_of(runs: Sequence[Run], joint: str) -> Channels:
    """The runs' usable stretches at one period.

    Raises:
        IdentificationError: there is none.
    """
    even = at_common_period(runs)
    pieces = tuple((i, run, s) for i, run in enumerate(even) for s in run.segments() if s.stop - s.start > SHORTEST)
    if not pieces:
        names = ", ".join(r.name for r in runs)
        raise IdentificationError(f"joint {joint}: no stretch of more than {SHORTEST} usable samples in {names}")
    return Channels(joint, pieces, float(np.median([r.period for r in even])))


def notes_of_joint(notes: Sequence[RunNote], joint: str, joints: Sequence[str]) -> tuple[RunNote, ...]:
    """The notes without the remarks of a log's reader that concern other joints alone."""
    return tuple(n for n in notes if not isinstance(n, LogRemark) or concerns(n.statement, joint, joints))
