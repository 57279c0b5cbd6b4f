"""`bench design-arm`: intervals that close-loop states after a designed motion of an arm, and after growing sinusoids.

For a parameter with the 95 % intervals [l_d, u_d] after the designed motion and [l_s, u_s] after the sinusoids,

    ratio = (u_d - l_d) / (u_s - l_s)

A base parameter is compared if both fits have it: the fits choose their combinations of link parameters each from
its own data. A rotor inertia is compared if the design counts it as a parameter, that is, if the links do not imitate
it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from drake_tc.errors import DrakeTcError
from tests.benchmarks.blind_arm.arms import Arm
from tests.benchmarks.evidence.arm_runs import MOTIONS, ArmRuns, Progress, arm_runs
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.interval_coverage import FRICTION, holds
from tests.benchmarks.robot_rigs import diagnose_rig

Kind = Literal["base parameters", "friction", "rotor inertias"]
KINDS: tuple[Kind, ...] = ("base parameters", "friction", "rotor inertias")
ROTOR = "rotor_inertia"
RATIO = 0.6
"""Goal of the median ratio, at most."""
FACTOR = 1.5
"""Goal of the factor between the widths that the design states and those of the report, median, at most."""
DESIGN_SECONDS = 300.0
"""Goal of the processor time of a design, at most [s]."""


@dataclass(frozen=True)
class Interval:
    """One interval of a report.

    Attributes:
        kind, name: Of the parameter.
        low, high: Ends of the 95 % interval, NaN for a missing one [SI].
        holds: Whether it holds the truth.
    """

    kind: Kind
    name: str
    low: float
    high: float
    holds: bool

    @property
    def width(self) -> float:
        """Difference of the two ends [SI]."""
        return self.high - self.low


@dataclass(frozen=True)
class ArmComparison:
    """What the two motions of one arm gave.

    Attributes:
        arm: Its name.
        intervals: Motion to the intervals of its report.
        named: Motion to the effects that its report names, `effect@where`, although nothing is missing.
        predicted: Parameter to the predicted widths, as in `ArmRuns`.
        seconds: Processor time of the design [s].
    """

    arm: str
    intervals: Mapping[str, tuple[Interval, ...]]
    named: Mapping[str, tuple[str, ...]]
    predicted: Mapping[str, tuple[float, float]]
    seconds: float

    @property
    def all_ratios(self) -> list[float]:
        """Of all parameters that are compared."""
        return [ratio for kind in KINDS for ratio in self.ratios(kind).values()]

    @property
    def all_predicted_ratios(self) -> list[float]:
        """Of all parameters that the design counts."""
        return [ratio for kind in KINDS for ratio in self.predicted_ratios(kind)]

    def ratios(self, kind: Kind) -> dict[str, float]:
        """Parameter to the ratio of its intervals, of the parameters of a kind that are compared."""
        designed, sinusoids = (
            {each.name: each for each in self.intervals[name] if each.kind == kind} for name in MOTIONS
        )
        both = {name: each.width / sinusoids[name].width for name, each in designed.items() if name in sinusoids}
        if kind == "rotor inertias":
            both = {name: ratio for name, ratio in both.items() if name in self.predicted}
        return {name: ratio for name, ratio in both.items() if math.isfinite(ratio)}

    def predicted_ratios(self, kind: Kind) -> list[float]:
        """Of all parameters of a kind that the design counts. Its base parameters are not all those of the fits."""
        return [designed / other for name, (designed, other) in self.predicted.items() if kind_of(name) == kind]

    def assumed_over_stated(self, kind: Kind) -> list[float]:
        """Predicted widths after the designed motion over those of its report."""
        stated = {each.name: each.width for each in self.intervals[MOTIONS[0]] if each.kind == kind}
        return [self.predicted[name][0] / width for name, width in stated.items() if name in self.predicted]


def kind_of(name: str) -> Kind:
    """Kind of a parameter `<joint or link>/<parameter>`."""
    last = name.rpartition("/")[2]
    return "friction" if last in FRICTION else "rotor inertias" if last == ROTOR else "base parameters"


def arm_comparison(arm: Arm, seed: int, folder: Path, progress: Progress) -> ArmComparison:
    """Design, record and fit both motions of an arm.

    Args:
        arm: Which.
        seed: Of all draws.
        folder: Gets the logs.
        progress: Told how far it is.

    Raises:
        DrakeTcError: As `arm_runs`; logs that close-loop refuses.
    """
    runs = arm_runs(arm, seed, folder, lambda text, share: progress(f"design, {text}", 0.3 * share))
    reports = {}
    for number, name in enumerate(MOTIONS):
        progress(f"close-loop on the {name} runs", 0.3 + 0.35 * number)
        reports[name] = diagnose_rig(runs.folders[name])
        if "error" in reports[name]:
            raise DrakeTcError(f"{arm.name}, {name} runs: close-loop {reports[name]['error']}")
    progress("done", 1.0)
    return compared(arm.name, runs, reports)


def compared(arm: str, runs: ArmRuns, reports: Mapping[str, Mapping[str, Any]]) -> ArmComparison:
    """The comparison of two reports, by motion."""
    intervals = {name: intervals_of(report, runs.truth) for name, report in reports.items()}
    named = {name: named_in(report) for name, report in reports.items()}
    return ArmComparison(arm, intervals, named, runs.predicted, runs.seconds)


def intervals_of(report: Mapping[str, Any], truth: Mapping[str, Any]) -> tuple[Interval, ...]:
    """Base parameters, friction and rotor inertias of a report, held against the truth.

    Args:
        report: From `diagnose_rig`.
        truth: From `true_values`.
    """
    out = []
    for entry in (report.get("links") or {}).get("base", []):
        true = sum(factor * truth["links"][member] for member, factor in entry["weights"].items())
        out.append(_interval("base parameters", entry["name"], entry["ci95"], true))
    for joint, groups in report.get("final_parameters", {}).items():
        expected = {**truth["friction"][joint], ROTOR: truth["rotor"][joint]}
        for key, true in expected.items():
            if key in groups:
                name = f"{joint}/{key}"
                out.append(_interval(kind_of(name), name, groups[key][key]["ci95"], true))
    return tuple(out)


def _interval(kind: Kind, name: str, ci95: Sequence[float | None], true: float) -> Interval:
    low, high = (float("nan") if end is None else float(end) for end in ci95)
    return Interval(kind, name, low, high, holds([low, high], true))


def named_in(report: Mapping[str, Any]) -> tuple[str, ...]:
    """`effect@where` of all effects that a report names."""
    own = [f"{e['id']}@{joint}" for joint, entry in report["joints"].items() for e in entry["effects"]]
    return (*own, *(f"{each['id']}@{each['where']}" for each in report.get("shared", [])))


def comparison_rows(made: ArmComparison) -> list[BenchmarkRow]:
    """Rows of figures: medians of the ratios by kind and of all parameters, the share of parameters whose interval is
    wider after the designed motion, shares of intervals that hold the truth by motion, and times.

    "Design over report" is the width that the design states over the one that close-loop states. The shares have no
    goal, because one arm has few intervals of a kind; `bench arms` judges them on many arms. Nothing is missing in the
    arm, so an effect that is named is wrong.
    """
    rows = []
    for kind in KINDS:
        ratios = BenchmarkRow.of_values(f"{kind}: ratio", "-", list(made.ratios(kind).values()))
        rows.append(replace(ratios, expected=RATIO, how="max", note=_note(made, kind)))
        rows.append(BenchmarkRow.of_values(f"{kind}: predicted ratio", "-", made.predicted_ratios(kind)))
        if kind != "base parameters":  # which are combinations in the report, and single link parameters in the design
            assumed = made.assumed_over_stated(kind)
            rows.append(BenchmarkRow.of_values(f"{kind}: design over report", "-", assumed))
            factors = BenchmarkRow.of_values(f"{kind}: factor between both", "-", [max(x, 1.0 / x) for x in assumed])
            rows.append(replace(factors, expected=FACTOR, how="max"))
    every, predicted = made.all_ratios, made.all_predicted_ratios
    rows.append(replace(BenchmarkRow.of_values("all parameters: ratio", "-", every), expected=RATIO, how="max"))
    rows.append(BenchmarkRow.share("all parameters: wider intervals", [ratio > 1.0 for ratio in every]))
    rows.append(BenchmarkRow.of_values("all parameters: predicted ratio", "-", predicted))
    rows.append(BenchmarkRow.share("all parameters: predicted wider intervals", [ratio > 1.0 for ratio in predicted]))
    for name in MOTIONS:
        for kind in KINDS:
            hits = [each.holds for each in made.intervals[name] if each.kind == kind]
            rows.append(BenchmarkRow.share(f"{name}: hold the truth, {kind}", hits))
        effects = len(made.named[name])
        rows.append(BenchmarkRow(f"{name}: effects named", effects, "-", 0.0, "max", note="nothing is missing"))
    rows.append(BenchmarkRow("design, processor time", made.seconds, "s", DESIGN_SECONDS, "max"))
    return [row for row in rows if row.n]


def _note(made: ArmComparison, kind: Kind) -> str:
    """How many parameters of a kind the two reports have."""
    counts = [sum(each.kind == kind for each in made.intervals[name]) for name in MOTIONS]
    return f"of {counts[0]} and {counts[1]}"
