"""The report's tables as rows of text: effects, errors of free runs by run and model, and each parameter by run.

Each run's own estimate of a parameter is a small plot beside that of all runs.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.problem.parameters import Estimate, PlausibleRange
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.errors import MODELS, position_errors
from drake_tc.diagnosis.result.joint_result import DidNotHold, JointResult, RejectedEffect, Rejection
from drake_tc.report.numbers import (
    NOT_IDENTIFIED,
    UNKNOWN,
    Scale,
    fold,
    interval,
    percent,
    pretty_unit,
    scale_for,
    significant,
)
from drake_tc.report.words import REASONS, natural, title_of, why_rejected

Row = Mapping[str, Any]
"""What a template shows of one row, or of one table, by name: texts, marks, and lengths of bars [%]."""


def error_table(joint: JointResult) -> Row:
    """RMS of the model equation on training and held-out runs and of the free run's position, before and after.

    Effort becomes torque by the final drive gain, on both sides, so that ratios agree.
    """
    gain = joint.final.gain
    errors = (joint.before.train, joint.before.heldout, joint.after.heldout)
    free = (joint.before.free_run_heldout, joint.after.free_run_heldout)
    largest = max((v for v in errors if np.isfinite(v)), default=0.0)
    of_free = max((v for v in free if v is not None and np.isfinite(v)), default=0.0)
    scale = scale_for(largest, joint.unit)
    torque = scale_for(largest / gain, joint.units.torque)
    pairs = (
        ("training runs", joint.before.train, joint.after.train),
        ("held-out runs", joint.before.heldout, joint.after.heldout),
    )
    rows = [_error_row(pair, scale, torque, gain, largest) for pair in pairs]
    if any(v is not None for v in free):
        b, a = (float("nan") if v is None else v for v in free)
        position = scale_for(of_free, joint.units.position)
        rows.append(_error_row(("free run, held-out", b, a), position, None, gain, of_free))
    explainable = joint.unexplained.explainable_rms
    return {
        "rows": rows,
        "floor": scale.quantity(joint.noise_floor),
        "floor_torque": torque.quantity(joint.noise_floor / gain),
        "explainable": scale.quantity(explainable),
        "explainable_torque": torque.quantity(explainable / gain),
        "gain": f"{significant(gain, 4)} {joint.units.text(f'{pretty_unit(joint.unit)}/(N·m)')}",
        "load": "force" if joint.units.slides else "torque",
    }


def _error_row(
    errors: tuple[str, float, float], scale: Scale, torque: Scale | None, gain: float, largest: float
) -> Row:
    """Name, error before and error after."""
    name, before, after = errors

    def bar(value: float) -> float:
        return 100.0 * min(value / largest, 1.0) if largest > 0.0 and np.isfinite(value) else 0.0

    return {
        "name": name,
        "before": scale.quantity(before),
        "after": scale.quantity(after),
        "torque_before": torque.quantity(before / gain) if torque else UNKNOWN,
        "torque_after": torque.quantity(after / gain) if torque else UNKNOWN,
        "fold": fold(before, after),
        "bar_before": round(bar(before), 2),
        "bar_after": round(bar(after), 2),
    }


def run_error_rows(joint: JointResult) -> Sequence[Row]:
    """One row a run, training runs first, each group in the order of the names (run2 before run10)."""
    scale = scale_for(max((r.before for r in joint.runs), default=0.0), joint.unit)
    return [
        {
            "run": r.run,
            "role": "held-out" if r.heldout else "training",
            "before": scale.quantity(r.before),
            "after": scale.quantity(r.after),
            "absolute_before": scale.quantity(r.mean_absolute_before),
            "absolute_after": scale.quantity(r.mean_absolute_after),
            "floors": significant(r.after / joint.noise_floor, 2) if joint.noise_floor > 0.0 else UNKNOWN,
        }
        for r in sorted(joint.runs, key=lambda r: (r.heldout, natural(r.run)))
    ]


def parameter_rows(joint: JointResult) -> Sequence[Row]:
    """Parameters of both models, the drive's first, then the declared effects, then those that were added."""
    before, after = joint.baseline_parameters, joint.final_parameters
    rows = []
    for key in [*before, *(k for k in after if k not in before)]:
        old, new = before.get(key, {}), after.get(key, {})
        for name in [*old, *(n for n in new if n not in old)]:
            known = [e for e in (old.get(name), new.get(name)) if e is not None]
            limits = joint.plausible.get(key, {}).get(name)
            rows.append(
                {
                    "key": key,
                    "effect": "drive" if key == "drive" else title_of(key),
                    "name": name.replace("_", " "),
                    "unit": pretty_unit(known[0].unit),
                    "before": _estimate(old.get(name)),
                    "after": _estimate(new.get(name)),
                    "added": key not in before,
                    "at_bound": any(e.at_bound for e in known),
                    "possible": "" if limits is None else _range(limits),
                    "source": "" if limits is None else limits.source,
                    "outside": limits is not None and name in new and not limits.holds(new[name].value),
                }
            )
    return rows


def _range(limits: PlausibleRange) -> str:
    """A range as text; an end that nothing limits is left out."""
    low, high = (significant(x) if np.isfinite(x) else "" for x in (limits.lower, limits.upper))
    if low and high:
        return f"{low} to {high}"
    return f"{low} or more" if low else f"{high} or less" if high else "any"


def _estimate(value: Estimate | None) -> tuple[str, str]:
    if value is None:
        return UNKNOWN, ""
    shown, spread = interval(value.value, *value.ci95)
    return shown, spread if value.is_identified else NOT_IDENTIFIED


def data_rows(split: DataSplit, role: str) -> Sequence[Row]:
    """One row a run in the order of the names: duration, rows, share of samples in resolved motion, spans."""
    samples = split.samples
    signals = samples.signals
    rows_of = [samples.rows[samples.run == k] for k in range(len(samples.runs))]
    speeds, loads = (
        [float(np.max(np.abs(values[rows]), initial=0.0)) for rows in rows_of]
        for values in (signals.velocity, signals.load_torque)
    )
    of_speed = scale_for(max(speeds, default=0.0), samples.units.text("rad/s"))
    of_load = scale_for(max(loads, default=0.0), samples.units.torque)
    out = []
    for k in sorted(range(len(samples.runs)), key=lambda k: natural(samples.runs[k])):
        mine, rows = samples.run_of_sample == k, rows_of[k]
        out.append(
            {
                "run": samples.runs[k],
                "role": role,
                "duration": f"{significant(float(mine.sum()) * signals.period)} s",
                "rows": f"{rows.size}",
                "moving": percent(float(np.mean(samples.moving[mine])) if mine.any() else None),
                "speed": of_speed.quantity(speeds[k]),
                "load": of_load.quantity(loads[k]),
            }
        )
    return out


def _motion_facts(resolution: Resolution, units: JointUnits) -> Sequence[tuple[str, str]]:
    """Step and noise of the encoder, or of the velocity where that was recorded alone."""
    sensor, name, unit = "encoder", "position", "rad"
    step, noise = resolution.position_step, resolution.position_noise
    if resolution.raw_velocity_noise > 0.0:
        sensor, name, unit = "velocity", "velocity", "rad/s"
        step, noise = resolution.velocity_step, resolution.raw_velocity_noise
    unit = units.text(unit)
    shown = scale_for(step, unit).quantity(step) if step > 0.0 else "finer than its noise"
    return ((f"{sensor} step", shown), (f"{name} noise", scale_for(noise, unit).quantity(noise)))


def data_facts(joint: JointResult) -> Sequence[tuple[str, str]]:
    """Filters and resolution: (what, how much)."""
    samples = joint.train.samples
    resolution, units = samples.resolution, samples.units
    facts = [
        ("sampling period", scale_for(samples.signals.period, "s").quantity(samples.signals.period)),
        ("filter width", scale_for(samples.light.actual_width_s, "s").quantity(samples.light.actual_width_s)),
        ("spacing of the rows", scale_for(samples.row_period, "s").quantity(samples.row_period)),
        *_motion_facts(resolution, units),
        (
            "velocity noise after filtering",
            scale_for(resolution.velocity_noise, units.text("rad/s")).quantity(resolution.velocity_noise),
        ),
        ("torque noise", scale_for(resolution.torque_noise, units.torque).quantity(resolution.torque_noise)),
    ]
    inertia = samples.signals.rotor_inertia
    return (
        [*facts, ("declared rotor inertia", f"{significant(inertia, 4)} {units.text('kg·m²')}")]
        if inertia > 0.0
        else facts
    )


TRIED: tuple[Rejection, ...] = ("too_little_evidence", "not_possible")
"""Why effects that were tried are not in a model."""


def rejected_rows(rejected: Sequence[RejectedEffect]) -> tuple[Sequence[Row], Sequence[Row]]:
    """(tried and not added, could not be looked for in these logs)."""
    tried: list[Row] = []
    barred: list[Row] = []
    for r in rejected:
        row = {"title": title_of(r.key), "id": r.id, "heldout": percent(r.heldout_gain), "why": why_rejected(r)}
        (tried if r.reason in TRIED else barred).append(row)
    return tried, barred


def did_not_hold_rows(effects: Sequence[DidNotHold]) -> Sequence[Row]:
    """One row an effect, with the reason in a few words and in a sentence."""
    said = ((e, *REASONS[e.reason]) for e in effects)
    return [{"title": e.title, "id": e.id, "reason": reason, "why": why} for e, reason, why in said]


def free_run_table(joint: JointResult) -> Row:
    """RMS and mean absolute position errors of each run by model; no rows where no free run was made."""
    traces = joint.free_run
    models = tuple(name for name in MODELS if any(name in trace for trace in traces.values()))
    held = set(joint.heldout.samples.runs)
    runs = sorted(traces, key=lambda run: (run in held, natural(run)))
    errors = {run: [position_errors(traces[run], name) for name in models] for run in runs}
    sizes = [value for found in errors.values() for pair in found if pair is not None for value in pair]
    scale = scale_for(max((value for value in sizes if math.isfinite(value)), default=0.0), joint.units.position)
    rows = []
    for run in runs:
        rms, absolute = (tuple("–" if e is None else scale.quantity(e[which]) for e in errors[run]) for which in (0, 1))
        rows.append((run, "held-out" if run in held else "training", rms, absolute))
    return {"models": models, "rows": rows}
