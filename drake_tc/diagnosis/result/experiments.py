"""The next experiment: what to record so that two effects, or an unknown one, can be told apart.

`drake_tc.report.sentences.experiments` makes the sentences.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.residual.unexplained import BeyondTraining, Unexplained


@dataclass(frozen=True)
class TellApart:
    """Show each of two effects alone, by id: these logs cannot tell them apart."""

    first: str
    second: str


@dataclass(frozen=True)
class RepeatRun:
    """Repeat a run: between `start` and `end` [s] something acted that the log does not show."""

    run: str
    start: float
    end: float


@dataclass(frozen=True)
class CoverRange:
    """Record a training run that covers the whole range of a signal: outside the trained range, effects extrapolate."""

    beyond: BeyondTraining


@dataclass(frozen=True)
class FindPeriodicSource:
    """Look for what acts on the joint at this frequency.

    Attributes:
        frequency_hz: Of the line. among_joints: whether the robot has other joints, which may move at this frequency.
    """

    frequency_hz: float
    among_joints: bool = False


@dataclass(frozen=True)
class VarySignals:
    """Vary the signals, by name, on which what is left depends: each alone, the others unchanged."""

    signals: tuple[str, ...]


@dataclass(frozen=True)
class RepeatUnchanged:
    """Repeat one run unchanged: what is left has structure that depends on no recorded signal."""


NextExperiment = TellApart | CoverRange | RepeatRun | FindPeriodicSource | VarySignals | RepeatUnchanged

EXPLAINED = 0.5
"""Share of the residual from which on a line of its spectrum is attributed to the signals that explain it."""


def next_experiment(
    alternatives: Sequence[tuple[str, str]],
    unexplained: Unexplained,
    *,
    among_joints: bool = False,
) -> NextExperiment | None:
    """What to do first; None when nothing is open.

    Args:
        alternatives: Pairs of effects, by id, that the logs cannot tell apart.
        unexplained: What the final model leaves.
        among_joints: Whether the robot has other joints.
    """
    if alternatives:
        return TellApart(*alternatives[0])
    if unexplained.beyond is not None:
        return CoverRange(unexplained.beyond)
    if unexplained.confined_to:
        stretch = unexplained.confined_to[0]
        return RepeatRun(stretch.run, stretch.start, stretch.end)
    signals = tuple(name for name in unexplained.depends_on if name != "time")
    if unexplained.period_hz is not None and not (signals and unexplained.fraction >= EXPLAINED):
        return FindPeriodicSource(unexplained.period_hz, among_joints)
    if unexplained.structured:
        return VarySignals(signals) if signals else RepeatUnchanged()
    return None
