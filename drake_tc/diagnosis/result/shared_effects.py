"""What is told of shared causes: parameters with intervals, held-out gains, and joints before them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.drive_gain import with_drive_gain
from drake_tc.diagnosis.problem.estimates import Estimate, estimates
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.problem.shared.causes import AXES, TITLES, Cause, CauseColumns
from drake_tc.diagnosis.problem.shared.covariance import covariance
from drake_tc.diagnosis.problem.shared.rows import JointRows, stack
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, fit_stacked
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import Errors, JointResult
from drake_tc.diagnosis.result.rig_result import SharedEffect
from drake_tc.diagnosis.result.run_errors import run_errors
from drake_tc.diagnosis.result.widening import Parameters, spanned
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.selection.shared import active, substituted
from drake_tc.types import FloatArray

RESAMPLES = 400


def original_baseline(result: JointResult, prepared: Prepared) -> JointResult:
    """The joint's result with the declared model, and its errors, of loads without any effect that was found."""
    declared = refine(prepared.train, fit(prepared.train, prepared.terms))
    declared = with_drive_gain(prepared.train, declared, result.final)
    residuals = [
        (columns.target - columns.design(declared.terms) @ declared.beta) * result.final.gain
        for columns in (prepared.train, prepared.held)
    ]
    train, held = (
        _with_before(split, residual) for split, residual in zip((result.train, result.heldout), residuals, strict=True)
    )
    rms = [float(np.sqrt(np.mean(residual**2))) for residual in residuals]
    return replace(
        result,
        baseline=declared,
        baseline_parameters=estimates(prepared.train, declared, result.drive),
        before=Errors(rms[0], rms[1], result.before.free_run_heldout),
        train=train,
        heldout=held,
        runs=tuple(run_errors((train, held))),
    )


def _with_before(split: DataSplit, residual: FloatArray) -> DataSplit:
    """A soft gear may have changed the rows; its residual before then stays."""
    return replace(split, before=residual) if residual.size == split.before.size else split


def shared_effects(
    train: Sequence[JointRows],
    held: Sequence[JointRows],
    causes: CauseColumns,
    chosen: Sequence[Cause],
    alternatives: Sequence[Sequence[Cause]],
) -> tuple[SharedEffect, ...]:
    """The causes found, with all effects of the joints beside them.

    Args:
        train: Training rows, with each joint's final model.
        held: Held-out rows, the same.
        causes: Columns.
        chosen: Causes found.
        alternatives: By chosen cause, those that do as well in its place.
    """
    if not chosen:
        return ()
    fitted = fit_stacked(train, *active(causes.causes, chosen))
    models = [_parameters(train, chosen, fitted)]
    models += [
        _parameters(train, a, fit_stacked(train, *active(causes.causes, a))) for a in substituted(chosen, alternatives)
    ]
    out = []
    for number, cause in enumerate(chosen):
        others = [c for c in chosen if c is not cause]
        own = [{cause.key: model[cause.key]} for model in models if cause.key in model]
        without = fit_stacked(train, *active(causes.causes, others))
        gain, stability, by_joint = on_held_out((held, fitted), (held, without))
        out.append(
            SharedEffect(
                id=cause.id,
                where=cause.where,
                title=TITLES[cause.id],
                parameters=spanned(own)[cause.key],
                heldout_gain=gain,
                stability=stability,
                joints={r.joint: each for r, each in zip(held, by_joint, strict=True)},
                indistinguishable=tuple((c.id, c.where) for c in alternatives[number]),
            )
        )
    return tuple(sorted(out, key=lambda e: -e.heldout_gain))


def both_sides(
    prepared: Mapping[str, Prepared], terms: Mapping[str, Sequence[Term]], causes: CauseColumns
) -> tuple[tuple[JointRows, ...], tuple[JointRows, ...]]:
    """Training and held-out rows of all joints with these models."""
    train = stack({joint: p.train for joint, p in prepared.items()}, terms, causes)
    return train, stack({joint: p.held for joint, p in prepared.items()}, terms, causes)


def _parameters(rows: Sequence[JointRows], causes: Sequence[Cause], fitted: StackedFit) -> Parameters:
    """The causes' parameters by key, with 95 % intervals; the fit's first columns are those of the causes."""
    spread, freedom = covariance(rows, fitted)
    quantile, out, at = float(student.ppf(0.975, freedom)), {}, 0
    for cause in causes:
        part = slice(at, at + cause.size)
        at += cause.size
        delta, own = fitted.delta[part], spread[part, part]
        if cause.id == "payload":
            out[cause.key] = body_parameters(-delta, own, quantile)
            continue
        width = quantile * np.sqrt(np.maximum(np.diag(own), 0.0))
        value = cause.physical(delta)
        ends = np.sort(np.stack([cause.physical(delta - width), cause.physical(delta + width)]), axis=0)
        out[cause.key] = {
            name: Estimate(float(value[i]), unit, (float(ends[0, i]), float(ends[1, i])), False)
            for i, (name, unit) in enumerate(zip(cause.parameters, cause.units, strict=True))
        }
    return out


def body_parameters(inertial: FloatArray, spread: FloatArray, quantile: float) -> dict[str, Estimate]:
    """Mass m and centre c = h/m of what a link carries, with 95 % intervals to first order.

        var c_i = (var h_i - 2 c_i cov(h_i, m) + c_i^2 var m)/m^2

    Its inertia is estimated along with them, and not reported: rotors and friction of the last joints hide it.

    Args:
        inertial: (10,) `LINK_PARAMETERS`.
        spread: (10, 10) their covariance.
        quantile: Half width of an interval over the standard deviation.
    """
    mass, centre = float(inertial[0]), inertial[1:4] / inertial[0]
    gradient = np.zeros((4, inertial.size))
    gradient[0, 0] = 1.0
    gradient[1:, 0], gradient[1:, 1:4] = -centre / mass, np.eye(3) / mass
    width = quantile * np.sqrt(np.maximum(np.diag(gradient @ spread @ gradient.T), 0.0))
    names = (("mass", "kg"), *((f"com_{axis}", "m") for axis in AXES))
    return {
        name: Estimate(value, unit, (value - half, value + half), False)
        for (name, unit), value, half in zip(names, [mass, *centre.tolist()], width.tolist(), strict=True)
    }


def on_held_out(
    larger: tuple[Sequence[JointRows], StackedFit], smaller: tuple[Sequence[JointRows], StackedFit]
) -> tuple[float, float, list[float]]:
    """Gain of all joints together, share of resamples in which it helps, gain by joint.

    Args:
        larger: Held-out rows with a cause, and the fit with it to the training rows.
        smaller: The same without it.
    """
    count = max(int(r.block.max()) for r in larger[0]) + 1
    blocks = np.zeros((2, count))
    by_joint = []
    for j, (rows, others) in enumerate(zip(larger[0], smaller[0], strict=True)):
        squares = [larger[1].residual(rows, j) ** 2, smaller[1].residual(others, j) ** 2]
        by_joint.append(1.0 - float(np.sqrt(squares[0].mean() / max(squares[1].mean(), 1e-300))))
        for side, square in zip(blocks, squares, strict=True):
            side += np.bincount(rows.block, square, count) / larger[1].sigma[j] ** 2
    total = blocks.sum(axis=1)
    draws = np.random.default_rng(0).integers(0, count, (RESAMPLES, count))
    better = (blocks[1] - blocks[0])[draws].sum(axis=1) > 0.0
    return 1.0 - float(np.sqrt(total[0] / max(total[1], 1e-300))), float(better.mean()), by_joint
