"""`rehearse`: how often a diagnosis finds an effect that was put into the user's own runs, by size.

For each size and each repeat the twin is simulated with the effect, its training runs are diagnosed blind, and the
answer is compared with the truth. Size 0 tells how often an effect is named that is not there.

A rehearsal as JSON and as a page with its power curve.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import beta as beta_distribution
from threadpoolctl import threadpool_limits

from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.search import Progress
from drake_tc.effects.library import effect
from drake_tc.errors import DrakeTcError, IdentificationError, ParamsError
from drake_tc.experiments.causes import cause_of, cause_values
from drake_tc.experiments.check.effects import Visibility
from drake_tc.experiments.rehearsal.twin import Twin
from drake_tc.experiments.sizes import Size, size_of
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.pages import PageSection, PageTable, plain_page
from drake_tc.report.plots.svg import BACKWARD, FORWARD, new_figure, page_style, to_svg

FACTORS = (0.125, 0.25, 0.5, 1.0, 2.0)
"""Sizes that are tried, in units of the given or the typical one."""
ONLY_REVOLUTE = frozenset(("payload", "presliding_hysteresis", "position_dependent_friction", "torque_ripple"))
"""Effects that the simulator has for revolute joints only: a payload hangs from the axis, and the lengths of waves and
of presliding are those of gears in rad."""
NOTHING = "(nothing)"
REFUSED = "(refused)"
RAN_AWAY = "(ran away)"


@dataclass(frozen=True)
class Trial:
    """One simulated joint and what the diagnosis said of it.

    Attributes:
        size: Of the effect; 0 for none.
        seed: Of the noise.
        named: Effect ids, in the order of the report; `(refused)` where the runs were refused, `(ran away)` where the
            joint did.
        found: Whether the effect is among them, or among the alternatives of one of them.
        alone: Whether nothing else is named.
        verdict: Of the report.
    """

    size: float
    seed: int
    named: tuple[str, ...]
    found: bool
    alone: bool
    verdict: str


@dataclass(frozen=True)
class PowerPoint:
    """What came out at one size.

    Attributes:
        size: Of the effect; 0 for none.
        trials: Number of joints. found: of them, those whose effect was found. alone: ... and no other named.
        interval: 95 % interval of the share found (Clopper and Pearson, 1934).
        others: Other names that came first, with their counts.
    """

    size: float
    trials: int
    found: int
    alone: int
    interval: tuple[float, float]
    others: Mapping[str, int]


@dataclass(frozen=True)
class Rehearsal:
    """The power curve of one effect on one joint.

    Attributes:
        joint: Name. effect: Its id. size: What tells its strength.
        predicted: Smallest size that `check` expects to be found.
        points: By size, size 0 first.
        trials: All of them.
    """

    joint: str
    effect: str
    size: Size
    predicted: float
    points: tuple[PowerPoint, ...]
    trials: tuple[Trial, ...]


def parse_effect(text: str) -> tuple[str, float | None]:
    """(effect id, size or None) of EFFECT or EFFECT=SIZE.

    Raises:
        ParamsError: No such effect, none that can be simulated, or no positive number.
    """
    name, _, number = text.partition("=")
    known = cause_of(name.strip())
    if not number:
        return known, None
    try:
        size = float(number)
    except ValueError:
        raise ParamsError(f"--with {text}: expected EFFECT=SIZE with a number, got {number!r}") from None
    if not (np.isfinite(size) and size > 0.0):
        raise ParamsError(f"--with {text}: expected a positive size of {known}, got {number}")
    return known, size


def rehearse(
    twin: Twin,
    effect_id: str,
    size: float | None,
    held: Sequence[str],
    *,
    repeats: int = 4,
    seed: int = 0,
    factors: Sequence[float] = FACTORS,
    executor: Executor | None = None,
    progress: Progress = lambda text, share: None,
) -> Rehearsal:
    """The power curve of an effect.

    Args:
        twin: Of the joint.
        effect_id: The effect.
        size: Around which sizes are tried; None takes the typical size.
        held: Names of the runs that are held out.
        repeats: Joints at each size, with other noise and other phases.
        seed: Of all that is drawn.
        factors: Sizes in units of `size`; 0 is always tried too.
        executor: Diagnoses beside each other; None: one after the other, here.
        progress: Told how far it is.

    Raises:
        ParamsError: An effect that cannot act on this joint, or no run left to fit or to test.
    """
    forms = _forms(twin, effect(effect_id).id)
    shown = next((each for each in forms if not each.obstacle), None)  # the form that these logs can show
    member = effect(effect_id if shown is None else shown.key)
    told = size_of(member, twin.effects.fitted.numbers, twin.prepared.context)
    names = [run.name for run in twin.runs]
    if not set(held) or not set(names) - set(held):
        raise ParamsError(f"expected training runs and held-out runs; runs: {', '.join(names)}; held out: {held}")
    tried = [0.0, *(float(factor * (told.typical if size is None else size)) for factor in factors)]
    work = [(twin, member.id, each, seed + k, tuple(held)) for each in tried for k in range(repeats)]
    trials = []
    for done, trial in enumerate(_each(work, executor)):
        trials.append(trial)
        progress(f"trial {done + 1} of {len(work)}", (done + 1) / len(work))
    trials.sort(key=lambda t: (t.size, t.seed))
    points = tuple(_point([t for t in trials if t.size == each]) for each in sorted({t.size for t in trials}))
    predicted = min((each.smallest for each in forms), default=float("inf"))
    return Rehearsal(twin.simulator.joint, member.id, told, predicted, points, tuple(trials))


def _forms(twin: Twin, effect_id: str) -> list[Visibility]:
    """What the logs show of each form of an effect.

    Raises:
        ParamsError: The effect cannot act on this joint, or cannot be looked for.
    """
    joint, forms = twin.simulator.joint, [each for each in twin.effects.effects if each.id == effect_id]
    if forms and all(each.obstacle for each in forms):
        raise ParamsError(f"joint {joint}: {effect_id}: {forms[0].reason} A rehearsal would never find it")
    if twin.rig.units_of(joint).slides and effect_id in ONLY_REVOLUTE:
        raise ParamsError(
            f"joint {joint}: {effect_id}: the simulator has this effect for revolute joints only, and the "
            f"joint is prismatic; the same holds for {', '.join(sorted(ONLY_REVOLUTE - {effect_id}))}"
        )
    if effect_id in twin.rig.declared[joint]:
        raise ParamsError(f"joint {joint}: {effect_id} is declared in the rig file, and is part of every model")
    return forms


def _each(work: Sequence[tuple[Twin, str, float, int, tuple[str, ...]]], executor: Executor | None) -> Iterator[Trial]:
    if executor is None:
        yield from (trial_of(*each) for each in work)
    else:
        yield from (future.result() for future in as_completed([executor.submit(trial_of, *each) for each in work]))


def trial_of(twin: Twin, effect_id: str, size: float, seed: int, held: tuple[str, ...]) -> Trial:
    """Simulate and diagnose one joint."""
    spec, causes = twin.simulator.spec, dict[str, Mapping[str, float]]()
    if size > 0.0:
        rng = np.random.default_rng([seed, 9])
        causes[cause_of(effect_id)] = cause_values(effect_id, size, spec.joint, spec.pendulum, rng)
    try:
        runs = twin.simulator.simulated(causes, seed, twin.runs)
    except DrakeTcError:
        return Trial(size, seed, (RAN_AWAY,), found=False, alone=False, verdict="")
    train, held_out = ([run for run in runs if (run.name in held) == out] for out in (False, True))
    try:
        with threadpool_limits(1):
            report = diagnose_joint(train, held_out, twin.rig, twin.simulator.joint, DiagnosisOptions())
    except IdentificationError:
        return Trial(size, seed, (REFUSED,), found=False, alone=False, verdict="")
    named = tuple(dict.fromkeys(e.id for e in report.effects))
    alike = [pair for pair in report.indistinguishable if effect_id in pair]
    found = effect_id in named or any(set(pair) & set(named) for pair in alike)
    return Trial(size, seed, named, found=found, alone=found and len(named) == 1, verdict=report.verdict)


def _point(trials: Sequence[Trial]) -> PowerPoint:
    found = sum(t.found for t in trials)
    firsts = Counter(t.named[0] if t.named else NOTHING for t in trials if not t.found)
    return PowerPoint(
        size=trials[0].size,
        trials=len(trials),
        found=found,
        alone=sum(t.alone for t in trials),
        interval=share_interval(found, len(trials)),
        others=dict(firsts.most_common()),
    )


def share_interval(found: int, trials: int) -> tuple[float, float]:
    """95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    low = 0.0 if found == 0 else float(beta_distribution.ppf(0.025, found, trials - found + 1))
    high = 1.0 if found == trials else float(beta_distribution.ppf(0.975, found + 1, trials - found))
    return low, high


def half_power(points: Sequence[PowerPoint]) -> float:
    """Smallest size from which on at least half of the joints are found; infinite where there is none."""
    smallest = float("inf")
    for point in sorted(points, key=lambda p: -p.size):
        if point.size > 0.0 and point.found < 0.5 * point.trials:
            break
        smallest = point.size or smallest
    return smallest


FILES = ("rehearsal.html", "rehearsal.json")


def rehearsal_json(found: Rehearsal) -> dict[str, Any]:
    """The whole rehearsal as plain data."""
    document = {"name": "rehearse", "schema": 1, **asdict(found), "found_from": half_power(found.points)}
    document["predicted_smallest"] = document.pop("predicted")
    out: dict[str, Any] = json_value(document)
    return out


def summary(found: Rehearsal) -> str:
    """One sentence: from which size on the effect is found."""
    size, unit = half_power(found.points), pretty_unit(found.size.unit)
    if not np.isfinite(size):
        return f"{found.joint}: none of the tried sizes of {found.effect} is found in half of the trials."
    return f"{found.joint}: {found.effect} is found in half of the trials or more from {significant(size)} {unit} on."


def rehearsal_page(found: Rehearsal) -> str:
    """The page."""
    section = PageSection(found.effect, (_how(found),), plots=(_plot(found),), tables=(power_table(found),))
    return plain_page("Would it have been found?", f"rehearse · joint {found.joint}", (summary(found),), (section,))


def power_table(found: Rehearsal) -> PageTable:
    """What was found at each size, for page and console."""
    rows = [
        (
            significant(p.size) if p.size else "0 (nothing missing)",
            f"{p.found} of {p.trials}",
            f"{percent(p.interval[0])} to {percent(p.interval[1])}",
            str(p.alone),
            ", ".join(f"{name} ({count})" for name, count in p.others.items()) or "–",
        )
        for p in found.points
    ]
    unit = pretty_unit(found.size.unit) or "-"
    headings = (f"{found.size.name} [{unit}]", "found", "95 % interval", "alone", "named instead")
    return PageTable(headings, rows, headings[:-1])


def _how(found: Rehearsal) -> str:
    """How the trials were made, and what the check predicts."""
    predicted = significant(found.predicted) if np.isfinite(found.predicted) else "none"
    return (
        "Each trial simulates the joint with the runs’ own motions, loads, sensors and noise by a simulator that "
        "shares no formula with the diagnosis, and diagnoses the simulated runs without knowing what was put in. "
        f"The check of these logs predicts a smallest size of {predicted} {pretty_unit(found.size.unit)}."
    )


def _plot(found: Rehearsal) -> str:
    """Share found over the size."""
    points = [p for p in found.points if p.size > 0.0]
    size = np.array([p.size for p in points])
    share = np.array([p.found / p.trials for p in points])
    low, high = np.array([p.interval for p in points]).T
    with page_style("power"):
        figure = new_figure(6.0, 3.0)
        axes = figure.add_subplot(1, 1, 1)
        axes.errorbar(size, share, yerr=[share - low, high - share], color=FORWARD, marker="o", markersize=3.5)
        if np.isfinite(found.predicted) and found.predicted > 0.0:
            axes.axvline(found.predicted, color=BACKWARD, linestyle="--", linewidth=0.9)
        axes.set_xscale("log")
        axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel(f"{found.size.name} [{found.size.unit}]; dashed: predicted by the check")
        axes.set_ylabel("share found")
        return to_svg(figure, f"share of trials in which {found.effect} is found, over its size")
