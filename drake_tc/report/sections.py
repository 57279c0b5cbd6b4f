"""Sections of the report beside those of the joints.

The model in another simulator, links whose inertial parameters were fitted, the refinement on free runs, causes that
several joints share, and the closed loop before and after with the torque uncertainty.
"""

import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.applications import ClosedLoop, ExportErrors, ExportTrial, JointClosedLoop, LoopFigures
from drake_tc.diagnosis.result.joint_result import JointResult, Refinement, RefinementStatus
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.report.numbers import UNKNOWN, Scale, fold, interval, percent, pretty_unit, scale_for, significant
from drake_tc.report.plots.svg import AFTER, BEFORE, INK, MUTED, new_figure, page_style, to_svg
from drake_tc.report.tables import Row, error_table
from drake_tc.report.words import joined, natural, title_of
from drake_tc.types import FloatArray

HOW = (
    "Each model is driven by the recorded command alone, from the first sample on, under the recorded or known load. A"
    " run that becomes unstable has no error."
)
"""What the errors of the table are."""


def headings(rows: Sequence[ExportErrors], runner: str) -> tuple[str, ...]:
    """Of the table of errors; the user's file has a column where it could be run.

    Args:
        rows: One a joint and run.
        runner: What ran the export, such as "MuJoCo".
    """
    known = ("joint", "run", "model after (Drake)", f"export ({runner})")
    return (*known, f"your file ({runner})") if _has_original(rows) else known


def cells(
    rows: Sequence[ExportErrors], units: Mapping[str, JointUnits] = MappingProxyType({})
) -> list[tuple[str, ...]]:
    """Of the table of errors, those of one unit with one prefix."""
    errors = [(row.model, row.export, row.original)[: 3 if _has_original(rows) else 2] for row in rows]
    unit_of = [units.get(row.joint, JointUnits()).position for row in rows]
    sizes: dict[str, float] = {}
    for unit, each in zip(unit_of, errors, strict=True):
        sizes[unit] = max([sizes.get(unit, 0.0), *(e for e in each if e is not None and math.isfinite(e))])
    return [
        (row.joint, row.run, *(UNKNOWN if e is None else scale_for(sizes[unit], unit).quantity(e) for e in each))
        for row, unit, each in zip(rows, unit_of, errors, strict=True)
    ]


def export_section(trial: ExportTrial | None, units: Mapping[str, JointUnits]) -> dict[str, Any] | None:
    """What the template shows; None where no export was tried."""
    if trial is None:
        return None
    return {
        "target": trial.target,
        "command": f"drake-tc export {trial.model_file} --to {trial.to}",
        "losses": trial.losses,
        "headings": headings(trial.rows, trial.runner),
        "rows": cells(trial.rows, units),
        "how": HOW,
    }


def _has_original(rows: Sequence[ExportErrors]) -> bool:
    return any(row.original is not None for row in rows)


ROUNDING = 1e-12
"""Share of the largest end of an interval below which a value of the robot file is rounding."""


def links_section(links: FittedLinks | None, *, wrong_set_up: bool = False) -> Row | None:
    """The section; None where the links were not fitted."""
    if links is None:
        return None
    by_link: dict[str, list[Row]] = {}
    for p in links.parameters:
        row = _row(p.name, _declared(p.declared, p.estimate), p.estimate, percent(p.narrowed))
        by_link.setdefault(p.link, []).append(row)
    base = [_row(p.name, _declared(p.declared, p.estimate), p.estimate) for p in links.base]
    payloads = [(run, [_row(n, "", e) for n, e in parameters.items()]) for run, parameters in links.payloads.items()]
    return {
        "summary": links_sentence(links, wrong_set_up=wrong_set_up),
        "links": list(by_link.items()),
        "base": base,
        "payloads": payloads,
    }


def links_sentence(links: FittedLinks, *, wrong_set_up: bool = False) -> str:
    """What was fitted, in one sentence."""
    if wrong_set_up:
        return (
            "The links' inertial parameters were fitted with the wrong set-up; their values do not describe the robot."
        )
    apart = sum(not p.estimate.ci95[0] <= p.declared <= p.estimate.ci95[1] for p in links.base)
    return (
        f"The inertial parameters of {len({p.link for p in links.parameters})} links were fitted: "
        f"{len(links.base)} base parameters. "
        f"Base parameters whose value in the robot file lies outside the 95 % interval: {apart}."
    )


def payload_sentences(links: FittedLinks) -> Iterable[str]:
    """For each log with an unknown payload, its mass."""
    for run, parameters in links.payloads.items():
        mass = parameters["m"]
        value, spread = interval(mass.value, *mass.ci95)
        yield f"Payload in {run}: {value} kg, 95 % interval {spread} kg."


def _row(name: str, declared: str, estimate: Estimate, left: str = "") -> Row:
    """One parameter; `left` is the share of the declared tolerance that is left."""
    value, spread = interval(estimate.value, *estimate.ci95)
    texts = (combination(name), declared, value, spread, pretty_unit(estimate.unit), left)
    return dict(zip(("name", "declared", "value", "interval", "unit", "left"), texts, strict=True))


def combination(name: str) -> str:
    """A combination of parameters as an equation has it: equal coefficients are factored out, in the links' order.

    `a/mx +0.2 c/m +0.2 b/m -1 d/mz` becomes `a mx + 0.2 (b m + c m) − d mz`.
    """
    first, *rest = re.split(r" (?=[+-]\d)", name)
    by_factor: dict[str, list[str]] = {}
    for term in rest:
        factor, _, member = term.partition(" ")
        by_factor.setdefault(factor, []).append(member.replace("/", " "))
    shown = first.replace("/", " ")
    for factor, members in by_factor.items():
        sign, size = "−" if factor[0] == "-" else "+", factor[1:]
        joined = " + ".join(sorted(members, key=natural))
        if len(members) > 1 and (size != "1" or sign == "−"):
            joined = f"({joined})"
        shown += f" {sign} {joined}" if size == "1" else f" {sign} {size} {joined}"
    return shown


def _declared(value: float, estimate: Estimate) -> str:
    """The robot file's value; what is left of it by rounding counts as zero."""
    reach = max(abs(end) for end in (estimate.value, *estimate.ci95))
    return "0" if abs(value) < ROUNDING * reach else significant(value)


WHY_NOT: dict[RefinementStatus, str] = {
    "accepted": "",
    "no_gain": "a fit to the recorded positions lowers their mean absolute error by less than 5 %",
    "worse_held_out": "a fit to the recorded positions follows the held-out runs less closely",
    "implausible": "the refined values are not physically possible",
    "resolved": "the free runs already follow the position as closely as the encoder resolves it",
    "nothing_to_simulate": "the joint cannot be simulated from these logs",
    "nothing_to_refine": "no parameter of the model was estimated",
}


def refinement_sentence(refinement: Refinement, units: JointUnits = TURNING) -> str:
    """What came of it, in one to three sentences; errors of whole runs and of stretches of them are never compared."""
    train, left_out = (_change(pair, units) for pair in (refinement.train, refinement.cross_validated))
    if refinement.accepted:
        text = f"{MODEL_FILE} follows the recorded position more closely. On the training runs, its mean absolute error"
        text = f"{text} is {train}."
        return text + (f" In cross-validation, on stretches of these runs, it is {left_out}." if left_out else "")
    why = f" ({refinement.why.rstrip('.')})" if refinement.why else ""
    if refinement.status == "no_gain" and (left_out or train):
        where = "in cross-validation on stretches of the training runs" if left_out else "on the training runs"
        why = f" ({where}, it is {left_out or train})"
    return f"No refined model was written: {WHY_NOT[refinement.status]}{why}."


def _change(pair: tuple[float, float] | None, units: JointUnits) -> str:
    """`5 mrad instead of 20 mrad`: refined, and with the model after."""
    if pair is None:
        return ""
    scale = scale_for(max(pair), units.position)
    after, refined = (scale.quantity(value) for value in pair)
    return f"{refined} instead of {after}"


def refinement_section(joint: JointResult) -> Row | None:
    """The section of one joint; None where no free run was requested."""
    found = joint.refinement
    if found is None:
        return None
    parameters = tuple(
        (
            title_of(p.key),
            p.name.replace("_", " "),
            significant(p.equation_error, 4),
            significant(p.output_error, 4),
            pretty_unit(p.unit),
            p.at_bound,
        )
        for p in found.parameters
    )
    return {
        "sentence": refinement_sentence(found, joint.units),
        "parameters": parameters,
        "balance": _balance(joint, found),
    }


def _balance(joint: JointResult, found: Refinement) -> str:
    if found.error_heldout is None:
        return ""
    after, refined = joint.after.heldout, found.error_heldout
    scale = scale_for(after, joint.unit)
    return (
        f"Held-out error of the effort: {scale.quantity(after)} with the model after, {scale.quantity(refined)} with "
        "the refined numbers. The verdict, the effects and their intervals are those of the model after."
    )


MEANING = {
    "link_mass": "the difference between the mass of the link and that in the robot's model",
    "link_com": "the offset of its centre of mass from that of the model, in the link's axes",
    "encoder_offset": "the constant error of the encoder's reading: the zero of the joint is wrong",
    "payload": "what the link carries beyond the robot's file, such as a tool: mass, and centre in the link's frame",
    "ft_bias": "the constant offset of the sensor, in its own axes",
    "ft_gain": "the relative error of the sensor's scale",
    "imu_bias": "the constant offset of the IMU, in its own axes",
    "delay": "the common delay from the command to the torque of every drive; it is part of each joint's model",
}
LATE_ENCODER = "the delay of the encoder's readings; the diagnosis compensates it"
LEAST_GAIN = 0.01


def shared_section(result: CloseLoopResult) -> Sequence[Row]:
    """A card for each shared cause; none when there is none."""
    return [_card(cause, result) for cause in result.shared]


def _card(cause: SharedEffect, result: CloseLoopResult) -> Row:
    """Texts, and the width of each joint's bar [%]."""
    parameters = []
    for name, value in cause.parameters.items():
        shown, spread = interval(value.value, *value.ci95)
        parameters.append((name.replace("_", " "), shown, spread, pretty_unit(value.unit)))
    joints = [
        (name, percent(gain) if gain > LEAST_GAIN else significant(0.0), 100.0 * max(gain, 0.0), error_table(joint))
        for name, gain, joint in ((j.joint, cause.joints.get(j.joint, 0.0), j) for j in result.joints.values())
    ]
    return {
        "id": cause.id,
        "title": cause.title,
        "where": cause.where,
        "meaning": LATE_ENCODER if cause.id == "delay" and cause.where in result.joints else MEANING[cause.id],
        "gain": percent(cause.heldout_gain),
        "stability": percent(cause.stability),
        "parameters": parameters,
        "joints": joints,
        "indistinguishable": joined([f"{title_of(name)} ({where})" for name, where in cause.indistinguishable]),
    }


SIZE = (4.4, 2.5)
MOST_MARGIN = 1000.0
"""A gain margin beyond it is none."""


def closed_loop_section(result: CloseLoopResult) -> dict[str, Any] | None:
    """What the template shows; None where neither was made."""
    if result.closed_loop is None and result.uncertainty is None:
        return None
    units: Mapping[str, JointUnits] = defaultdict(lambda: TURNING, {n: j.units for n, j in result.joints.items()})
    return {"loop": _loop(result.closed_loop, units), "spread": _spread(result.uncertainty, units)}


def _loop(closed: ClosedLoop | None, units: Mapping[str, JointUnits]) -> dict[str, Any] | None:
    if closed is None:
        return None
    scales = _scales(closed, units)
    simulated = closed.time is not None
    return {
        "made": bool(closed.joints),
        "simulated": simulated,
        "changed": closed.changed,
        "headline": _headline(closed),
        "plant": closed.plant,
        "controller": closed.controller,
        "reference": f"{closed.run}, {closed.start:.1f} to {closed.end:.1f} s",
        "rows": [_loop_row(name, joint, scales[name]) for name, joint in closed.joints.items()],
        "plots": [_plot(f"loop-{i}", name, units[name], closed) for i, name in enumerate(closed.joints)]
        if simulated
        else [],
        "notes": closed.notes,
    }


def _scales(closed: ClosedLoop, units: Mapping[str, JointUnits]) -> dict[str, Scale]:
    """By joint: one prefix for the errors of all joints that turn, one for those of all that slide."""
    largest: dict[str, float] = {}
    for name, joint in closed.joints.items():
        unit = units[name].position
        figures = [f.largest_error for f in (joint.before, joint.after) if math.isfinite(f.largest_error)]
        largest[unit] = max([largest.get(unit, 0.0), *figures])
    return {name: scale_for(largest[units[name].position], units[name].position) for name in closed.joints}


def _headline(closed: ClosedLoop) -> str:
    """What the better model does to the loop, in one sentence."""
    if not closed.joints:
        return ""
    if not closed.changed:
        return "The model was not changed, so the loop is the same before and after: there is one row for each joint."
    changed = {name: joint for name, joint in closed.joints.items() if joint.changed}
    ratios = {n: j.before.rms_error / j.after.rms_error for n, j in changed.items() if j.after.rms_error > 0.0}
    known = {name: ratio for name, ratio in ratios.items() if math.isfinite(ratio)}
    parts = []
    if known:
        better, worse = (sum(test) for test in ([r > 1.02 for r in known.values()], [r < 0.98 for r in known.values()]))
        middle = float(np.exp(np.mean(np.log(list(known.values())))))
        if len(known) == 1:
            parts.append(f"the simulated tracking error {_turned(middle)}")
        else:
            parts.append(
                f"of the {len(known)} joints whose model changed, {better} track better in simulation and {worse} worse"
                f"; in the mean their tracking error {_turned(middle)}"
            )
    mended = [n for n, j in changed.items() if j.before.spectral_radius >= 1.0 > j.after.spectral_radius]
    if mended:
        parts.append(
            f"the linear loop of {', '.join(mended)} is unstable with the model before and stable with the model after"
        )
    text = "; ".join(parts) or "the models differ, but there is no tracking error of both"
    return f"{text[:1].upper()}{text[1:]}."


def _turned(ratio: float) -> str:
    if 0.98 <= ratio <= 1.02:
        return "stays what it was"
    word = "smaller" if ratio > 1.0 else "larger"
    return f"is {significant(max(ratio, 1.0 / ratio), 2)} times {word}"


def _loop_row(name: str, joint: JointClosedLoop, scale: Scale) -> dict[str, Any]:
    largest = max((e for e in (joint.before.rms_error, joint.after.rms_error) if math.isfinite(e)), default=0.0)

    def bar(value: float) -> float:
        return round(100.0 * value / largest, 2) if largest > 0.0 and math.isfinite(value) else 0.0

    gains = joint.gains
    return {
        "name": name,
        "changed": joint.changed,
        "gains": f"{gains.get('k6', math.nan):g} · {gains.get('kp', math.nan):g}",
        "fold": fold(joint.before.rms_error, joint.after.rms_error),
        "bar_before": bar(joint.before.rms_error),
        "bar_after": bar(joint.after.rms_error),
        "before": _figures(joint.before, scale),
        "after": _figures(joint.after, scale),
    }


def _figures(figures: LoopFigures, scale: Scale) -> dict[str, Any]:
    margin = figures.gain_margin
    return {
        "rms": scale.quantity(figures.rms_error),
        "largest": scale.quantity(figures.largest_error),
        "radius": f"{figures.spectral_radius:.4f}",
        "gain": "none" if margin > MOST_MARGIN else significant(margin),
        "phase": UNKNOWN if not math.isfinite(figures.phase_margin) else f"{math.degrees(figures.phase_margin):.0f}°",
        "delay": "none" if math.isinf(figures.delay_margin) else scale_for(1e-3, "s").quantity(figures.delay_margin),
        "peak": significant(figures.sensitivity_peak),
        "unstable": figures.spectral_radius >= 1.0,
    }


def _plot(prefix: str, name: str, units: JointUnits, closed: ClosedLoop) -> dict[str, str]:
    joint = closed.joints[name]
    time = np.zeros(0) if closed.time is None else closed.time
    errors = {"before": joint.error_before, "after": joint.error_after} if joint.changed else {"": joint.error_after}
    largest = max((_largest(error) for error in errors.values()), default=0.0)
    scale = scale_for(largest, units.position)
    looks = {"before": (BEFORE, (0, (4, 2))), "after": (AFTER, "solid"), "": (AFTER, "solid")}
    with page_style(prefix):
        figure = new_figure(*SIZE)
        grid = figure.add_gridspec(2, 1, height_ratios=(1.0, 1.3))
        top: Any = figure.add_subplot(grid[0])
        bottom: Any = figure.add_subplot(grid[1], sharex=top)
        top.plot(time, joint.reference, color=INK, linewidth=1.2)
        for key, error in errors.items():
            colour, dash = looks[key]
            label = f"model {key} compensated" if key else "tracking error"
            bottom.plot(time, error * scale.factor, color=colour, linestyle=dash, linewidth=1.1, label=label)
        bottom.axhline(0.0, color=MUTED, linewidth=0.6)
        top.tick_params(labelbottom=False)
        top.set_ylabel(f"reference [{units.position}]")
        top.set_title(name)
        top.margins(x=0.0)
        bottom.set_ylabel(f"error [{scale.unit}]")
        bottom.set_xlabel("time [s]")
        bottom.margins(x=0.0, y=0.25)
        bottom.legend(loc="upper right", ncols=2, handlelength=1.8, borderaxespad=0.1)
        return {"name": name, "svg": to_svg(figure, f"closed loop of {name}: reference and simulated tracking errors")}


def _largest(error: FloatArray) -> float:
    return float(np.nanmax(np.abs(error))) if np.isfinite(error).any() else 0.0


def _spread(uncertainty: TorqueUncertainty | None, units: Mapping[str, JointUnits]) -> dict[str, Any] | None:
    if uncertainty is None:
        return None
    sigma, n = uncertainty.sigma, len(uncertainty.joints)
    rows = []
    for i, joint in enumerate(uncertainty.joints):
        scale = scale_for(float(sigma[i]), units[joint].text(TORQUE))
        low, high = (scale.text(float(bound)) for bound in uncertainty.ci95[i])
        time = float(uncertainty.correlation_time[i])
        rows.append(
            {
                "name": joint,
                "sigma": scale.quantity(float(sigma[i])),
                "ci": f"[{low}, {high}]",
                "mean": scale.quantity(float(uncertainty.mean[i])),
                "time": scale_for(time, "s").quantity(time),
                "samples": f"{uncertainty.effective_samples[i]:.0f} of {uncertainty.samples[i]:.0f}",
            }
        )
    return {"rows": rows, "correlation": _correlation(uncertainty) if n > 1 else ""}


def _correlation(uncertainty: TorqueUncertainty) -> str:
    """One sentence about the elements beside the diagonal."""
    if uncertainty.common_effective_samples <= 0.0:
        return "The joints hardly move at the same time in these runs: only the diagonal was estimated."
    size = np.abs(uncertainty.correlation - np.eye(len(uncertainty.joints)))
    i, j = sorted(int(k) for k in np.unravel_index(int(np.argmax(size)), size.shape))
    value = float(uncertainty.correlation[i, j])
    return (
        f"Strongest correlation between two joints: {significant(value, 2)} ({uncertainty.joints[i]} and"
        f" {uncertainty.joints[j]}); all are shrunk towards 0 by {percent(uncertainty.shrinkage)}, because there are"
        f" only {uncertainty.common_effective_samples:.0f} effective samples."
    )
