"""The loop closed with known loads: pairs that the first logs leave open, decided by motions under hung masses.

As in `loop`, but the joint is designed for twice: without loads, and with `LOADS`. A hung mass m at an arm r is m r^2
more inertia and m g r more gravity of the simulated joint. The logs of all loads are fitted together, with the lines
that the design gives for the rig file, and a first run is held out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.errors import DrakeTcError
from drake_tc.experiments.design.goal import Goal
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.load_design import LoadDesign, design_with_loads
from drake_tc.experiments.design.load_output import rig_entry
from drake_tc.experiments.design.loads import KnownLoad
from drake_tc.experiments.design.run import TOLD, DesignOptions, JointDesign
from drake_tc.experiments.rehearsal.twin import TwinRun, integrated
from drake_tc.joint_simulator.reference import LOG_PERIOD
from drake_tc.joint_simulator.spec import RigSpec
from drake_tc.logs.rig import Rig, parse_rig, rig_document
from drake_tc.types import GRAVITY
from tests.benchmarks.evidence.loop import (
    LAST_SECONDS,
    LIMITS,
    Answer,
    OpenCase,
    Progress,
    designed_cases,
    told_by,
    twin_run,
    with_cases,
)
from tests.benchmarks.evidence.pairs import JOINT, Pair
from tests.benchmarks.figures import BenchmarkRow

LOADS = (KnownLoad(0.0), KnownLoad(5.0, 0.4))
"""Loads that the user of the benchmark has: none, and 20 N m."""


@dataclass(frozen=True)
class LoadCase:
    """How one case came out.

    Attributes:
        truth: The effect that the joint has. other: The other one. seed: Of the case.
        first: Answer after the first logs.
        unloaded: Answer after the designed run without loads; None where there is no such run.
        loaded: Answer after the designed runs with loads; None where the design does not propose any.
        predicted_unloaded: Probability predicted for the run without loads. predicted: for the runs with loads.
        refusal: Why there is no design without loads. loads_refusal: why there is none with loads.
    """

    truth: str
    other: str
    seed: int
    first: Answer
    unloaded: Answer | None = None
    loaded: Answer | None = None
    predicted_unloaded: float = float("nan")
    predicted: float = float("nan")
    refusal: str = ""
    loads_refusal: str = ""

    @property
    def promised(self) -> bool:
        """Whether the first logs leave the two open, and the design predicts at least `TOLD` with loads."""
        return self.first != "truth" and self.predicted >= TOLD


@dataclass(frozen=True, eq=False)
class _Designed:
    case: OpenCase
    outcome: LoadCase
    runs: tuple[TwinRun, ...] = ()
    specs: tuple[RigSpec, ...] = ()
    rig: Rig | None = None
    has_unloaded: bool = False


def run_load_cases(pairs: Sequence[Pair], seed: int, progress: Progress = lambda text, share: None) -> list[LoadCase]:
    """Every pair with each of its effects as the truth.

    Args:
        pairs: Of effects.
        seed: Of the joints, the first motions and the noise.
        progress: Told how far it is.

    Raises:
        SimulationError: A joint ran away.
    """
    designed = designed_cases(pairs, seed, _designed, progress)
    runs = [run for each in designed for run in each.runs]
    records = iter(integrated([spec for each in designed for spec in each.specs], runs) if runs else [])
    out = []
    for i, each in enumerate(designed):
        case = each.case
        logs = [
            case.simulated.measured(next(records), run, np.random.default_rng(case.key(7, k)))
            for k, run in enumerate(each.runs)
        ]
        outcome, held = each.outcome, case.first[-1:]
        if each.has_unloaded:
            outcome = replace(outcome, unloaded=told_by(case.rig, logs[:1], held, case.truth, case.other)[0])
            logs = logs[1:]
        if logs and each.rig is not None:
            outcome = replace(outcome, loaded=told_by(each.rig, logs, held, case.truth, case.other)[0])
        out.append(outcome)
        progress(f"answered {case.truth} against {case.other}", 0.6 + 0.4 * (i + 1) / len(designed))
    return out


def _designed(case: OpenCase) -> _Designed:
    """What the first runs tell, and the further runs: without loads and with them."""
    train = case.first[:-1]
    told, sizes = told_by(case.rig, train, case.first[-1:], case.truth, case.other)
    outcome = LoadCase(case.truth, case.other, case.seed, told)
    try:
        joint, _, prepared = joint_from_logs(case.rig, train, JOINT)
        goal = Goal("tell", (case.truth, case.other), sizes)
        options = DesignOptions(duration=LAST_SECONDS, seed=case.seed)
        design = design_with_loads(joint, LIMITS, goal, options, LOADS, prepared)
    except DrakeTcError as error:
        return _Designed(case, replace(outcome, refusal=str(error), loads_refusal=str(error)))
    unloaded = design.unloaded if isinstance(design, LoadDesign) else design
    runs, specs = [], []
    if unloaded is not None:
        outcome = replace(outcome, predicted_unloaded=unloaded.expected[0].after)
        runs.append(_twin("designed", unloaded))
        specs.append(case.spec)
    if not isinstance(design, LoadDesign):
        outcome = replace(outcome, loads_refusal=design.sentences[0])
        return _Designed(case, outcome, tuple(runs), tuple(specs), None, has_unloaded=True)
    outcome = replace(outcome, predicted=design.expected[0].after, refusal=design.refusal)
    runs += [_twin(f"trajectory_{k + 1}", run.design) for k, run in enumerate(design.runs)]
    specs += [hung(case.spec, run.load) for run in design.runs]
    entry = rig_entry(design)
    rig = case.rig if entry is None else parse_rig(rig_document(case.rig) | {"load": entry})
    return _Designed(case, outcome, tuple(runs), tuple(specs), rig, has_unloaded=unloaded is not None)


def _twin(name: str, design: JointDesign) -> TwinRun:
    time, motion = design.motion(1.0 / LOG_PERIOD)
    return twin_run(name, time, motion[0], 0.0)


def hung(spec: RigSpec, load: KnownLoad) -> RigSpec:
    """The simulated joint with a mass hung on it."""
    joint = spec.joint
    inertia, weight = load.mass * load.arm**2, load.mass * GRAVITY * load.arm
    heavier = replace(joint, link_inertia=joint.link_inertia + inertia, gravity=joint.gravity + weight)
    return replace(spec, joint=heavier)


def load_rows(cases: Sequence[LoadCase]) -> list[BenchmarkRow]:
    """Of the cases that the first logs leave open, the shares that are separated without and with known loads."""
    left_open = [c for c in cases if c.first != "truth"]
    promised = [c for c in left_open if c.promised]
    doubtful = [c for c in left_open if c.loaded is not None and not c.promised]
    rows = [
        BenchmarkRow("cases", len(cases), "-"),
        BenchmarkRow("open after the first logs", len(left_open), "-"),
        BenchmarkRow("open: refused without loads", sum(bool(c.refusal) for c in left_open), "-"),
        BenchmarkRow("open: no design with loads", sum(c.loaded is None for c in left_open), "-"),
        BenchmarkRow(f"open: predicted at {100.0 * TOLD:.0f} % or more with loads", len(promised), "-"),
        BenchmarkRow.share(
            "predicted at or above: separated with loads", [c.loaded == "truth" for c in promised], "min", 0.9
        ),
        BenchmarkRow.share(
            "predicted at or above: separated by the designed run without loads",
            [c.unloaded == "truth" for c in promised],
        ),
        BenchmarkRow.share(
            "predicted at or above: wrong answers with loads", [c.loaded == "other" for c in promised], "max", 0.0
        ),
        BenchmarkRow(f"open: predicted below {100.0 * TOLD:.0f} % with loads", len(doubtful), "-"),
        BenchmarkRow.share(
            "predicted below: separated with loads", [c.loaded == "truth" for c in doubtful], "max", 0.5
        ),
    ]
    return with_cases(rows)
