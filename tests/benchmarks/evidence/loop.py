"""The loop closed on simulated joints: first logs that leave two effects open, a designed experiment.

For each pair of effects and each of the two as the truth, a joint is drawn and simulated by the independent simulator
with short, slow first runs. A diagnosis of these is followed by one more run of 30 s within the same limits: the
designed motion, or a growing sinusoid. That run is fitted alone and a first run is held out (the README of this package
says why). Both are evaluated by the same rule: the true effect is named, the other one is not, and the report does not
list the two as indistinguishable.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.effects.library import effect
from drake_tc.errors import DrakeTcError
from drake_tc.experiments.design.criteria import Discrimination
from drake_tc.experiments.design.goal import Goal, criterion_of
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.lead import DEFAULT_HZ
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.experiments.design.run import TOLD, DesignOptions, design_joint
from drake_tc.experiments.rehearsal.twin import SimulatedJoint, TwinRun, integrated, on_clock
from drake_tc.experiments.sizes import sizes_found
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.joint_simulator.reference import LOG_PERIOD
from drake_tc.joint_simulator.spec import RigSpec
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray
from tests.benchmarks.evidence.pairs import JOINT, Pair, drawn_joint
from tests.benchmarks.figures import BenchmarkRow

Progress = Callable[[str, float], None]
Designed = TypeVar("Designed")
Answer = Literal["truth", "other", "open"]
"""Answer of a diagnosis to the question which of the two effects is the cause; "open" if it does not decide."""
LIMITS = JointLimits((-0.8, 0.8), 3.0, 25.0, torque=150.0, bandwidth_hz=4.0)
FIRST_SECONDS, LAST_SECONDS = 12.0, 30.0


@dataclass(frozen=True)
class LoopCase:
    """How one case came out.

    Attributes:
        truth, other: The effects. seed: Of the case.
        first: Answer after the first logs. designed, default: after the designed run, and after the sinusoid.
        predicted: Probability predicted by the design that its run separates the two, for the worse of the two causes.
        refusal: Why the design has no motion that separates the two; empty where it has one.
    """

    truth: str
    other: str
    seed: int
    first: Answer
    designed: Answer = "open"
    default: Answer = "open"
    predicted: float = float("nan")
    refusal: str = ""

    @property
    def promised(self) -> bool:
        """Whether the first logs leave the two open and the design predicts at least `TOLD` for its run."""
        return self.first != "truth" and not self.refusal and self.predicted >= TOLD


@dataclass(frozen=True, eq=False)
class OpenCase:
    """A case on its way: the joint, its first runs and what they told."""

    truth: str
    other: str
    seed: int
    simulated: SimulatedJoint
    spec: RigSpec
    rig: Rig
    weight: float
    first: tuple[Run, ...] = ()
    told: Answer = "open"
    later: tuple[TwinRun, ...] = ()
    predicted: float = float("nan")
    refusal: str = ""

    def key(self, *use: int) -> list[int]:
        """Seed of one generator of the case. It does not depend on which other cases are run."""
        return [self.seed, *use, *f"{self.truth},{self.other},{self.weight:g}".encode()]

    def outcome(self, designed: Answer = "open", default: Answer = "open") -> LoopCase:
        """The case with the answers after the two further runs."""
        return LoopCase(self.truth, self.other, self.seed, self.told, designed, default, self.predicted, self.refusal)


def run_cases(pairs: Sequence[Pair], seed: int, progress: Progress = lambda text, share: None) -> list[LoopCase]:
    """Every pair with each of its effects as the truth; simulations run together, in one time loop each.

    Args:
        pairs: Of effects.
        seed: Of the joints, the first motions and the noise.
        progress: Told how far it is.

    Raises:
        SimulationError: A joint ran away.
    """
    cases = designed_cases(pairs, seed, _designed, progress)
    ready = [case for case in cases if not case.refusal]
    later = [run for c in ready for run in c.later]
    records = integrated([c.spec for c in ready for _ in c.later], later) if later else []
    out = [case.outcome() for case in cases if case.refusal]
    for i, case in enumerate(ready):
        answers = []
        for k, run in enumerate(case.later):
            more = case.simulated.measured(records[2 * i + k], run, np.random.default_rng(case.key(6, k)))
            answers.append(told_by(case.rig, [more], case.first[-1:], case.truth, case.other)[0])
        out.append(case.outcome(*answers))
        progress(f"answered {case.truth} against {case.other}", 0.6 + 0.4 * (i + 1) / len(ready))
    return out


def designed_cases(
    pairs: Sequence[Pair], seed: int, design: Callable[[OpenCase], Designed], progress: Progress
) -> list[Designed]:
    """What a design makes of every case of the pairs, which takes the first 60 % of the progress."""
    out = []
    recorded = recorded_cases(pairs, seed)
    for i, case in enumerate(recorded):
        out.append(design(case))
        progress(f"designed {case.truth} against {case.other}", 0.6 * (i + 1) / len(recorded))
    return out


def recorded_cases(pairs: Sequence[Pair], seed: int) -> list[OpenCase]:
    """Every pair with each of its effects as the truth, and its first runs."""
    cases = [drawn_case(pair, swapped, seed) for pair in pairs for swapped in (False, True)]
    runs = [first_runs(np.random.default_rng(case.key(3)), case.weight) for case in cases]
    records = integrated([c.spec for c in cases for _ in range(3)], [run for each in runs for run in each])
    out = []
    for i, case in enumerate(cases):
        made = [
            case.simulated.measured(records[3 * i + k], runs[i][k], np.random.default_rng(case.key(5, k)))
            for k in range(3)
        ]
        out.append(replace(case, first=tuple(made)))
    return out


def drawn_case(pair: Pair, swapped: bool, seed: int) -> OpenCase:
    """A case of a pair: with its second effect as the cause if swapped, else with its first."""
    truth, (other, _) = (pair.second, pair.first) if swapped else (pair.first, pair.second)
    joint = drawn_joint(pair, truth, seed)
    simulated = SimulatedJoint(JOINT, joint.spec, recorded=frozenset({"temperature"}))
    spec = simulated.with_causes(joint.causes, seed)
    return OpenCase(truth[0], other, seed, simulated, spec, joint.rig, pair.weight)


def _designed(case: OpenCase) -> OpenCase:
    """What the first runs tell, and the two further runs: the designed motion and the growing sinusoid."""
    train = case.first[:-1]
    told, sizes = told_by(case.rig, train, case.first[-1:], case.truth, case.other)
    try:
        joint, _, prepared = joint_from_logs(case.rig, train, JOINT)
        goal = Goal("tell", (case.truth, case.other), sizes)
        options = DesignOptions(duration=LAST_SECONDS, seed=case.seed)
        design = design_joint(joint, LIMITS, goal, options, prepared)
    except DrakeTcError as error:
        return replace(case, told=told, refusal=str(error))
    criterion = criterion_of(goal, design.joint)
    assert isinstance(criterion, Discrimination)
    proof = next((proof for truth, _, proof in criterion.contained if effect(truth).id == case.truth), "")
    if proof:
        return replace(case, told=told, refusal=f"{case.other} contains {case.truth}: {proof}")
    time, motion = design.motion(1.0 / LOG_PERIOD)
    later = (twin_run("designed", time, motion[0], case.weight), twin_run("default", time, _default(time), case.weight))
    return replace(case, told=told, later=later, predicted=design.expected[0].after)


def first_runs(rng: np.random.Generator, weight: float) -> list[TwinRun]:
    """Two slow runs over half of the range, and one that is held out."""
    time = _clock(FIRST_SECONDS)
    limits = MotionLimits((-0.45, 0.45), 0.8, 2.5)
    out = []
    for name in ("first", "second", "held_out"):
        frequency = float(rng.uniform(0.2, 0.3))
        motion = growing_sinusoid(time, frequency, 0.1, 0.3 / FIRST_SECONDS, limits)
        out.append(twin_run(name, time, motion.position, weight))
    return out


def _default(time: FloatArray) -> FloatArray:
    """The growing sinusoid of the same length and limits."""
    limits = MotionLimits(LIMITS.position, LIMITS.velocity, LIMITS.acceleration)
    grid: FloatArray = np.asarray(time - time[0], dtype=np.float64)
    half = LIMITS.position[1]
    return growing_sinusoid(grid, DEFAULT_HZ, 0.05 * half, 0.95 * half / float(grid[-1]), limits).position


def twin_run(name: str, time: FloatArray, reference: FloatArray, weight: float) -> TwinRun:
    """A run of a reference (T,) [rad] under a constant load [N m]."""
    return TwinRun(name, on_clock(time, reference, np.full_like(reference, weight)), time)


def _clock(seconds: float) -> FloatArray:
    return np.asarray(np.arange(round(seconds / LOG_PERIOD) + 1) * LOG_PERIOD, dtype=np.float64)


def told_by(
    rig: Rig, train: Sequence[Run], held: Sequence[Run], truth: str, other: str
) -> tuple[Answer, dict[str, float]]:
    """Answer of a diagnosis, and the sizes of those of the two effects that it names, from which a design starts."""
    try:
        found = diagnose_joint(train, held, rig, JOINT, DiagnosisOptions(assess_residual=False))
    except DrakeTcError:
        return "open", {}
    parameters = {e.id: {name: each.value for name, each in e.parameters.items()} for e in found.effects}
    sizes = {key: value for key, value in sizes_found(parameters).items() if key in (truth, other)}
    return answer_of({e.id for e in found.effects}, found.indistinguishable, truth, other), sizes


def answer_of(named: Collection[str], tied: Sequence[tuple[str, str]], truth: str, other: str) -> Answer:
    """The answer of a diagnosis that names these effects and calls these pairs of effects indistinguishable."""
    if any({truth, other} == set(pair) for pair in tied) or (truth in named) == (other in named):
        return "open"
    return "truth" if truth in named else "other"


def decided_rows(cases: Sequence[LoopCase]) -> list[BenchmarkRow]:
    """Of the cases that the first logs leave open, the shares in which a run separates the two effects.

    Cases with a predicted probability below `TOLD` are counted separately: there the prediction is right if the
    designed run does not separate the two.
    """
    left_open = [c for c in cases if c.first != "truth"]
    promised = [c for c in left_open if c.promised]
    doubtful = [c for c in left_open if not c.promised and not c.refusal]
    rows = [
        BenchmarkRow("cases", len(cases), "-"),
        BenchmarkRow("open after the first logs", len(left_open), "-"),
        BenchmarkRow("open: the first logs name the other effect", sum(c.first == "other" for c in left_open), "-"),
        BenchmarkRow("open: refused by the design", sum(bool(c.refusal) for c in left_open), "-"),
        BenchmarkRow(f"open: predicted below {100.0 * TOLD:.0f} %", len(doubtful), "-"),
        BenchmarkRow.share(
            "predicted below: separated by the designed run", [c.designed == "truth" for c in doubtful], "max", 0.5
        ),
        BenchmarkRow.share(
            "predicted below: wrong answers of the designed run", [c.designed == "other" for c in doubtful], "max", 0.0
        ),
        BenchmarkRow(f"open: predicted at {100.0 * TOLD:.0f} % or more", len(promised), "-"),
        BenchmarkRow.share(
            "predicted at or above: separated by the designed run",
            [c.designed == "truth" for c in promised],
            "min",
            0.9,
        ),
        BenchmarkRow.share(
            "predicted at or above: separated by the sinusoid", [c.default == "truth" for c in promised], "max", 0.5
        ),
        BenchmarkRow.share(
            "predicted at or above: wrong answers of the designed run",
            [c.designed == "other" for c in promised],
            "max",
            0.0,
        ),
        BenchmarkRow.share(
            "predicted at or above: wrong answers of the sinusoid", [c.default == "other" for c in promised]
        ),
    ]
    return with_cases(rows)


def with_cases(rows: Sequence[BenchmarkRow]) -> list[BenchmarkRow]:
    """The rows that have a value: a share of no case is no figure."""
    return [row for row in rows if not np.isnan(row.value)]
