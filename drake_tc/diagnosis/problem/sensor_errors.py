"""Errors of a joint's own sensors within tolerance: their prior, their uncertainty, and runs without them.

The errors theta ~ N(0, diag(t_i^2)), cut off at 3 t_i, are part of the model before and of the model after
(`effects.within_tolerance`). Least squares with this prior counts N rows that are correlated in time as their n
effective samples, as the regression of a whole robot does (`problem.shared.stacked`). With that regression's
covariance S of theta, and G = (X' X)^-1 X' C for the model's other columns X and the errors' columns C, the fit's
coefficients have, beyond their own intervals, the covariance

    [ G S G'  -G S ]
    [ -S G'      S ]                                                                          (others, theta)
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.data.sensor_prior import SensorPrior
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term, prior_coefficients
from drake_tc.diagnosis.problem.estimates import Estimate, estimates
from drake_tc.diagnosis.problem.regression import Fit, bounds_of
from drake_tc.diagnosis.problem.shared.covariance import covariance, own_response
from drake_tc.diagnosis.problem.shared.rows import JointRows, fold_grams
from drake_tc.diagnosis.problem.shared.stacked import StackedFit
from drake_tc.diagnosis.selection.comparison import effective_samples
from drake_tc.diagnosis.thresholds import BEYOND_TOLERANCE
from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.library import effect
from drake_tc.effects.within_tolerance import WithinTolerance, within_tolerance
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig
from drake_tc.types import FloatArray, IntArray


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
    """The columns with the errors' prior weighed by what a fit to the training rows `rows` leaves."""
    residual = rows.target - rows.design(fitted.terms) @ fitted.beta
    share = effective_samples(residual, rows.samples) / residual.size
    prior = SensorPrior(variance=float(np.mean(residual**2)), share=share)
    samples = replace(columns.samples, sensor_prior=prior)
    return columns.changed(samples=samples)


def spread_of_errors(columns: Columns, fitted: Fit) -> FloatArray:
    """(1 + k, 1 + k) covariance of beta that follows from what is not known of the sensors' errors; see the module.

    Args:
        columns: Training rows.
        fitted: To these rows.
    """
    out = np.zeros((fitted.beta.size, fitted.beta.size))
    low, high = bounds_of(fitted.terms, columns.declared_gain)
    errors, held = errors_in(fitted.terms), prior_coefficients(fitted.terms, WithinTolerance)
    if errors is None or not (held & (low < high)).any():
        return out
    free = np.flatnonzero(held & (low < high))
    drive_held = bool(low[0] == high[0])
    own = np.flatnonzero(~held)[1 if drive_held else 0 :]
    rows, beta = _as_rows(columns, fitted, own, free, drive_held=drive_held)
    share = effective_samples(fitted.residual, columns.samples) / np.array([columns.target.size])
    stacked = StackedFit(
        columns=np.arange(free.size),
        tolerance=np.array(errors.tolerances)[(low < high)[held]],
        delta=fitted.beta[free],
        beta=(beta,),
        sigma=np.array([float(np.std(rows.target - rows.own @ beta - rows.shared @ fitted.beta[free]))]),
        effective=share,
        share=share,
        cv_rms=np.array([fitted.cv_rms]),
    )
    spread = covariance([rows], stacked)[0]
    response = own_response(rows, stacked)[1 if drive_held else 0 :]
    out[np.ix_(own, own)] = response @ spread @ response.T
    out[np.ix_(own, free)] = -response @ spread
    out[np.ix_(free, own)] = -spread @ response.T
    out[np.ix_(free, free)] = spread
    return out


def _as_rows(
    columns: Columns, fitted: Fit, own: IntArray, free: IntArray, *, drive_held: bool
) -> tuple[JointRows, FloatArray]:
    """One joint's rows as those of a whole robot, the errors' columns in place of shared causes', and its beta (k,).

    Links' parameters among the own ones count from the mean of their prior; what is not known of them is told
    elsewhere (`drake_tc.diagnosis.result.shared_uncertainty`).
    """
    design, block, links = columns.design(fitted.terms), columns.samples.block, columns.prior(fitted.terms)
    target = columns.target - (fitted.beta[0] * design[:, 0] if drive_held else 0.0) - design[:, own] @ links.mean[own]
    none = np.zeros(free.size, dtype=np.bool_)  # these columns do not hold the noise of the torque
    rows = JointRows(
        joint="",
        samples=columns.samples,
        own=design[:, own],
        shared=design[:, free],
        target=target,
        block=block,
        grams=fold_grams(design[:, own], design[:, free], target, block, links.precision[own]),
        scaling=none,
        held=float(fitted.beta[0]) if drive_held else None,
        opposite=none,
        precision=links.precision[own],
    )
    return rows, fitted.beta[own] - links.mean[own]


def errors_in(terms: Sequence[Term]) -> WithinTolerance | None:
    """The errors within tolerance among the terms of a model, or None."""
    return next((t.effect for t in terms if isinstance(t.effect, WithinTolerance)), None)


def expected_errors(columns: Columns, fitted: Fit, known: frozenset[str], context: Context) -> list[Term]:
    """Effects of a fit that are errors which a sensor of the declared tolerance t may have.

    |theta| <= 3 sqrt(t^2 + s^2) with the standard deviation s of the estimate.

    Args:
        columns: Training rows.
        fitted: To these rows.
        known: Keys of the declared effects, which are not questioned.
        context: What the logs offer, the tolerances among it.
    """
    asked = [t for t in fitted.terms if t.effect.id in context.tolerances and t.effect.key not in known]
    if not asked or not np.isfinite(fitted.cv_rms):
        return []
    found = estimates(columns, fitted, context.drive)
    return [t for t in asked if _is_expected(context.tolerances[t.effect.id], *found[t.effect.key].values())]


def _is_expected(tolerance: float, found: Estimate) -> bool:
    deviation = (found.ci95[1] - found.ci95[0]) / (2.0 * float(norm.ppf(0.975)))
    return abs(found.value) <= BEYOND_TOLERANCE * math.hypot(tolerance, deviation)


def without_errors(runs: Sequence[Run], rig: Rig, joint: str, fitted: Fit) -> list[Run]:
    """The runs as the joint's sensors would have recorded them without the errors within tolerance.

    Args:
        runs: As recorded.
        rig: Says which column the effort is.
        joint: Whose columns are changed.
        fitted: Its model; the runs themselves where it has no such errors.
    """
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
