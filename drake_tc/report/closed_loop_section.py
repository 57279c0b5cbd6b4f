"""The closed loop before and after, and the torque uncertainty: tables, plots and the words beside them."""

import math
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.result.applications import ClosedLoop, JointClosedLoop, LoopFigures
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.numbers import UNKNOWN, Scale, fold, percent, scale_for, significant
from drake_tc.report.plots.svg import AFTER, BEFORE, INK, MUTED, new_figure, page_style, to_svg
from drake_tc.types import FloatArray

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
        "rows": [_row(name, joint, scales[name]) for name, joint in closed.joints.items()],
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


def _row(name: str, joint: JointClosedLoop, scale: Scale) -> dict[str, Any]:
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
