"""The parts of the gate on simulated rigs: blind and hard rigs, coverage of intervals, arms, the leg, time."""

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, Literal

from drake_tc.cli.demo import JOINT, demo_model, record_demo
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.experiments.causes import CAUSES, size_in
from drake_tc.experiments.sizes import size_name
from tests.benchmarks.arm_rigs import ArmScore, arm_benchmark, known_arm_benchmark
from tests.benchmarks.blind.outcome import Outcome
from tests.benchmarks.blind_rigs import BlindOptions, blind_benchmark
from tests.benchmarks.close_loop_speed import command_cost, write_runs
from tests.benchmarks.evidence.predicted import spec_of
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.hard.run import close_loop_on, hard_benchmark
from tests.benchmarks.hard.score import Outcome as HardOutcome
from tests.benchmarks.hard.score import rows as hard_rows
from tests.benchmarks.interval_coverage import holds
from tests.benchmarks.robot_rigs import RobotScore, robot_benchmark

Size = Literal["small", "full"]
Progress = Callable[[str, float], None]
COVERAGE = (0.92, 0.98)
"""Share of 95 % intervals that hold the truth: smallest and largest that is accepted."""
ENOUGH = 100
"""Intervals by which a share is judged; with fewer, chance alone moves the share of right ones out of these limits."""


@dataclass(frozen=True)
class GateSize:
    """How much of each benchmark is run.

    Attributes:
        blind: Scale and kinds of rigs (all where none is given). blind_seeds: How many seeds.
        hard: Number of rigs. demos: Number of seeds of the demo's bench.
        known_arms, fitted_arms, legs: Numbers of the cases.
    """

    blind: BlindOptions
    blind_seeds: int
    hard: int
    demos: int
    known_arms: tuple[int, ...]
    fitted_arms: tuple[int, ...]
    legs: tuple[int, ...]


SIZES: Mapping[Size, GateSize] = {
    "small": GateSize(
        BlindOptions(
            "smoke",
            kinds=("stribeck", "torque_ripple", "delay", "payload", "torque_ripple+asymmetric_friction",
                   "cable_spring+stribeck", "plain", "voltage_drive", "touch"),
        ),
        1, 8, 1, (0, 21), (14,), (0,),
    ),
    "full": GateSize(
        BlindOptions("full"), 2, 100, 4, tuple(range(48)), tuple(range(48)), tuple(range(65))
    ),
}  # fmt: skip


@dataclass(frozen=True)
class GateRuns:
    """Rigs, each diagnosed once however many parts read it.

    Attributes:
        size: How much is run. seed: Of all draws.
        folder: Keeps rigs and truths; reports are made anew.
        data: Folder of the public data sets.
        executor, progress: Run rigs side by side, and are told how far it is.
    """

    size: Size
    seed: int
    folder: Path
    data: Path
    executor: Executor
    progress: Progress

    @property
    def much(self) -> GateSize:
        """How much is run."""
        return SIZES[self.size]

    def fresh(self, name: str) -> Path:
        """A folder of rigs and truths without reports."""
        folder = self.folder / f"{name}_{self.size}_{self.seed}"
        shutil.rmtree(folder / "reports", ignore_errors=True)
        return folder

    @cached_property
    def blind(self) -> list[tuple[Outcome, Mapping[str, Any], Mapping[str, Any]]]:
        """Outcome, truth and report of the blind rigs."""
        found = []
        for seed in range(self.seed, self.seed + self.much.blind_seeds):
            folder = self.fresh(f"blind_{seed}")
            done = blind_benchmark(folder, self.much.blind, seed, self.executor, self.progress)
            for outcome in done.outcomes:
                paths = [folder / kind / outcome.name / f"{one}.json" for kind, one in BLIND_FILES]
                found.append((outcome, *(json.loads(path.read_text(encoding="utf-8")) for path in paths)))
        return found

    @cached_property
    def hard(self) -> list[HardOutcome]:
        """Outcomes of the hard rigs."""
        return hard_benchmark(self.fresh("hard"), self.seed, self.much.hard, self.executor, close_loop_on)


TIMED = ((30.0, 1, 5.0), (20.0, 6, 15.0))
"""Length of each of three runs at 1 kHz [s], number of joints, and the wall time to be reached [s]."""
BLIND_FILES = (("truth", "truth"), ("reports", "report"))


def blind_rows(runs: GateRuns) -> list[BenchmarkRow]:
    """Exact sets of single effects and pairs, false alarms on nulls, outside causes with the right verdict."""
    outcomes = [outcome for outcome, _, _ in runs.blind]
    asked = [o for o in outcomes if o.group in ("single", "pair") and o.acts]
    nulls, outside = ([o for o in outcomes if o.group == group] for group in ("null", "outside"))
    return [
        BenchmarkRow.share("exact sets, singles and pairs", [o.exact for o in asked], "min", 0.98),
        BenchmarkRow.share("nulls with a false alarm", [o.false_alarm for o in nulls], "max", 0.01),
        BenchmarkRow.share("outside causes with the right verdict", [o.flagged_rightly for o in outside], "min", 0.95),
        BenchmarkRow.share("rigs without a report", [not o.answered for o in outcomes], "max", 0.0),
    ]


def hard_rows_of(runs: GateRuns) -> list[BenchmarkRow]:
    """False names on nulls, and effects that are found where the oracle says that they can be."""
    reach: Mapping[str, tuple[Literal["min", "max"], float]] = {
        "nulls with a false name": ("max", 0.02),
        "causes found": ("min", 0.90),
    }
    out = []
    for row in hard_rows(runs.hard):
        if row.group == "all" and row.of:
            how, expected = reach.get(row.name, ("min", None))
            out.append(BenchmarkRow(row.name, row.hits / row.of, "share", expected, how, n=row.of))
    return out


def coverage_rows(runs: GateRuns) -> list[BenchmarkRow]:
    """Share of the 95 % intervals that hold the known truth, by source and by kind of parameter."""
    hits: dict[str, list[bool]] = {}
    for outcome, truth, report in runs.blind:
        if outcome.answered and outcome.group != "outside" and (outcome.exact or not outcome.truth):
            for kind, hit in blind_intervals(truth, report):
                hits.setdefault(f"blind rigs, {kind}", []).append(hit)
    for drawn in runs.hard:
        for kind, hit in drawn.covered:
            hits.setdefault(f"hard rigs, {kind}", []).append(hit)
    for seed in range(runs.much.demos):
        runs.progress(f"demo, seed {seed}", seed / runs.much.demos)
        for kind, hit in demo_intervals(seed):
            hits.setdefault(f"demo, {kind}", []).append(hit)
    return [interval_row(name, hits[name]) for name in sorted(hits)] + [
        interval_row("all", list(chain(*hits.values())))
    ]


def interval_row(name: str, hits: Sequence[bool]) -> BenchmarkRow:
    """Share of 95 % intervals that hold the truth; it is judged where there are enough of them."""
    middle, half = sum(COVERAGE) / 2.0, (COVERAGE[1] - COVERAGE[0]) / 2.0
    judged = middle if len(hits) >= ENOUGH else None
    return BenchmarkRow.share(f"95 % intervals that hold: {name}", hits, "within", judged, half)


def blind_intervals(truth: Mapping[str, Any], report: Mapping[str, Any]) -> list[tuple[str, bool]]:
    """Kind of parameter, and whether its interval holds the truth, of one blind rig whose answer is exact.

    The effects' own parameters are judged by the one that tells the size; its sign is left out.
    """
    (final,) = report["final_parameters"].values()
    spec = spec_of(dict(truth))
    known = {
        ("drive", "gain"): spec.joint.gain,
        ("viscous", "viscous"): spec.joint.damping,
        ("coulomb", "coulomb"): spec.joint.coulomb,
    }
    out = [
        (f"declared {name}", holds(final[key][name]["ci95"], value))
        for (key, name), value in known.items()
        if name in final.get(key, {})
    ]
    (joint,) = report["joints"].values()
    for named in joint["effects"]:
        if named["id"] in truth["effects"] and named["id"] in CAUSES:
            size, parameter = size_in(spec, named["id"]), size_name(effect(named["id"]))[0]
            if parameter in named["parameters"]:
                interval = named["parameters"][parameter]["ci95"]
                out.append(("effects", holds(interval, size) or holds(interval, -size)))
    return out


def demo_intervals(seed: int) -> list[tuple[str, bool]]:
    """The same of the demo's bench, where the missing effects are named and no other."""
    with tempfile.TemporaryDirectory() as folder:
        rig, logs, holdout = record_demo(Path(folder), seed, jobs=1)
        joint = close_loop(rig, logs, holdout, DiagnosisOptions(assess_residual=False)).joints[JOINT]
    model = demo_model(seed)
    truth = {("drive", "gain"): model.drive.gain} | {
        (value.key, name): number for value in model.effects for name, number in value.parameters.items()
    }
    found = joint.final_parameters
    return [
        (
            "declared" if key in ("drive", "viscous", "coulomb") else "effects",
            holds(list(found[key][name].ci95), value),
        )
        for (key, name), value in truth.items()
        if name in found.get(key, {})
    ]


def arm_rows(runs: GateRuns) -> list[BenchmarkRow]:
    """Arms whose links are known, and arms whose links are fitted."""
    out = []
    for name, benchmark, cases in (
        ("known links", known_arm_benchmark, runs.much.known_arms),
        ("fitted links", arm_benchmark, runs.much.fitted_arms),
    ):
        folder = runs.fresh(name.replace(" ", "_"))
        scores: list[ArmScore] = benchmark(folder, cases, runs.seed, runs.executor, runs.progress)
        out += _robot_rows(f"{name}: ", [score.robot for score in scores])
        base = [hit for score in scores for hit in score.base]
        if base:
            out.append(interval_row(f"{name}: base parameters", base))
    return out


def leg_rows(runs: GateRuns) -> list[BenchmarkRow]:
    """The simulated leg with F/T sensor and IMU."""
    scores = robot_benchmark(runs.fresh("leg"), runs.much.legs, runs.seed, runs.executor, runs.progress)
    return _robot_rows("", scores)


def _robot_rows(name: str, scores: Sequence[RobotScore]) -> list[BenchmarkRow]:
    wrong = [score for score in scores if score.id]
    rows = [
        BenchmarkRow.share(f"{name}right place and effect first", [s.first for s in wrong], "min", 0.95),
        BenchmarkRow.share(f"{name}that and no other", [s.exact for s in wrong], "min", 0.90),
        BenchmarkRow.share(f"{name}nulls quiet", [s.first for s in scores if not s.id], "min", 0.97),
        interval_row(f"{name}effects", [hit for s in wrong for hit in s.own_intervals]),
        interval_row(f"{name}friction", [hit for s in scores for hit in s.friction_intervals]),
        BenchmarkRow.share(f"{name}cases without a report", [bool(s.failure) for s in scores], "max", 0.0),
    ]
    return [row for row in rows if row.n]


def time_rows(runs: GateRuns) -> list[BenchmarkRow]:
    """Wall and CPU time of `drake-tc close-loop`, report and free runs included, on two quiet cores."""
    out = []
    for seconds, joints, most in TIMED[: 1 if runs.size == "small" else None]:
        with tempfile.TemporaryDirectory() as folder:
            case = write_runs(Path(folder), seconds, joints=joints)
            runs.progress(case.name, 0.0 if joints == 1 else 0.3)
            cost = command_cost(case)
        busy = f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} CPUs"
        out.append(BenchmarkRow(f"{case.name}: wall time", cost.wall, "s", most, "max", note=busy))
        out.append(BenchmarkRow(f"{case.name}: CPU time", cost.cpu, "s"))
    return out
