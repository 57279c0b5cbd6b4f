"""Errors of a joint's own sensors within tolerance: their prior, and runs without them.

The errors theta ~ N(0, diag(t_i^2)), cut off at 3 t_i, are part of the model before and of the model after
(`effects.within_tolerance`). Least squares with this prior counts N rows that are correlated in time as their n
effective samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.samples import SensorPrior
from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.library import effect
from drake_tc.effects.within_tolerance import WithinTolerance, within_tolerance
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig


def errors_of(context: Context) -> WithinTolerance | None:
    """The errors that are part of a joint's model, or None where no tolerance is declared that concerns it.

    A torque sensor's scale counts without a declared inertia too: the balance does not tell it, but the scale of drive
    gain and friction is no surer than the sensor's. With a robot's model the encoders' zeros are not fitted.
    """
    found = []
    for name, size in context.tolerances.items():
        if name.startswith("torque_sensor"):
            acts = context.load == "torque"
        else:
            of_model = name == "encoder_offset" and context.load in ("robot", "links")
            acts = not of_model and not effect(name).unavailable(context)
        if acts:
            found.append((name, size))
    return within_tolerance(tuple(found)) if found else None


def weighed(columns: Columns, rows: Columns, fitted: Fit) -> Columns:
    """The columns with the errors' prior weighed by what a fit to the training rows `rows` leaves.

    Effective samples are N over the integrated autocorrelation time, no lag counted across runs; at least 3.
    """
    residual = rows.target - rows.design(fitted.terms) @ fitted.beta
    lengths = [int(n) for n in np.bincount(rows.samples.run) if n]
    effective = max(residual.size / correlation_time(residual - residual.mean(), lengths), 3.0)
    prior = SensorPrior(variance=float(np.mean(residual**2)), share=effective / residual.size)
    return columns.changed(samples=replace(columns.samples, sensor_prior=prior))


def without_errors(runs: Sequence[Run], rig: Rig, joint: str, fitted: Fit) -> list[Run]:
    """The runs as the joint's sensors would have recorded them without the errors within tolerance."""
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        if isinstance(term.effect, WithinTolerance):
            values = term.effect.physical(theta, {}, fitted.gain)
            effort = f"{joint}/{COMMAND_COLUMN[rig.drive[joint]]}"
            bias = fitted.gain * values.get("bias_torque", 0.0)
            return [_restored(run, joint, term.effect, values, {effort: bias}) for run in runs]
    return list(runs)


def _restored(
    run: Run, joint: str, errors: WithinTolerance, values: Mapping[str, float], bias: Mapping[str, float]
) -> Run:
    """The run without the errors, and without the constant errors `bias` of the efforts among its columns."""
    names = {"load_torque": f"{joint}/torque", "position": f"{joint}/position"}
    known = {signal: run.columns[name] for signal, name in names.items() if name in run.columns}
    restored = errors.restore(plain_signals(run.time.size, known), values)
    changed = {names[signal]: getattr(restored, signal) for signal in known}
    changed |= {name: run.columns[name] - by for name, by in bias.items() if name in run.columns}
    return replace(run, columns=dict(run.columns) | changed)
