"""The next experiment: what to record so that two effects, or an unknown one, can be told apart.

`drake_tc.report.sentences.experiments` makes the sentences.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.residual.unexplained import BeyondTraining, Unexplained
from drake_tc.diagnosis.selection.withdrawal import Withdrawal


@dataclass(frozen=True)
class TellApart:
    """Show each of two effects alone, by id: these logs cannot tell them apart."""

    first: str
    second: str


@dataclass(frozen=True)
class CheckScale:
    """Measure known loads with the torque sensor: no motion tells its gain from a wrong declared rotor inertia."""


@dataclass(frozen=True)
class CheckLoad:
    """Check the known load and the drive gain: their error would look like the effect that did not hold.

    Attributes:
        measured: Whether a torque sensor measures the load, which the rig file declares otherwise.
    """

    measured: bool


@dataclass(frozen=True)
class SeparateLoads:
    """Fit runs with different loads separately: the fitted parameters of the unknown load differ from run to run."""


@dataclass(frozen=True)
class RecordTemperature:
    """Record the temperature: friction differs from run to run, and without a temperature no effect explains why."""


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


NextExperiment = (
    TellApart
    | CheckScale
    | CheckLoad
    | SeparateLoads
    | RecordTemperature
    | CoverRange
    | RepeatRun
    | FindPeriodicSource
    | VarySignals
    | RepeatUnchanged
)

SAME_SCALE = ("torque_sensor_gain", "rotor_inertia")
"""They leave the same balance where no drive gain is declared (`drive_notes.scale_alternatives`)."""

EXPLAINED = 0.5
"""Share of the residual from which on a line of its spectrum is attributed to the signals that explain it."""


def next_experiment(
    alternatives: Sequence[tuple[str, str]],
    unexplained: Unexplained,
    reasons: Collection[Withdrawal] = (),
    *,
    loads_differ: bool = False,
    load_measured: bool = False,
    friction_differs: bool = False,
    among_joints: bool = False,
) -> NextExperiment | None:
    """What to do first; None when nothing is open.

    Args:
        alternatives: Pairs of effects, by id, that the logs cannot tell apart.
        unexplained: What the final model leaves.
        reasons: Why effects did not hold.
        load_measured: Whether a torque sensor measures the load.
        loads_differ: Whether the parameters of an unknown load differ from run to run.
        friction_differs: Whether viscous or Coulomb friction does, and no temperature was recorded.
        among_joints: Whether the robot has other joints.
    """
    if alternatives:
        first = alternatives[0]
        return CheckScale() if first == SAME_SCALE else TellApart(*first)
    if "looks_like_known_load" in reasons:
        return CheckLoad(load_measured)
    if unexplained.beyond is not None:
        return CoverRange(unexplained.beyond)
    if loads_differ:
        return SeparateLoads()
    if friction_differs and (unexplained.structured or unexplained.excess):
        return RecordTemperature()
    if unexplained.confined_to:
        stretch = unexplained.confined_to[0]
        return RepeatRun(stretch.run, stretch.start, stretch.end)
    signals = tuple(name for name in unexplained.depends_on if name != "time")
    if unexplained.period_hz is not None and not (signals and unexplained.fraction >= EXPLAINED):
        return FindPeriodicSource(unexplained.period_hz, among_joints)
    if unexplained.structured:
        return VarySignals(signals) if signals else RepeatUnchanged()
    return None
