"""The plot in which an engineer sees an effect: the residual without it, what it adds, and the residual with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import FoundEffect, JointResult
from drake_tc.effects.base import DriveEffect
from drake_tc.report.equation import equations
from drake_tc.report.numbers import percent, scale_for
from drake_tc.report.residual_plots import Cloud, CloudLook, cloud_svg
from drake_tc.report.rows import Quantity, modulo, quantity, rows_of
from drake_tc.types import FloatArray

SIZE = (4.2, 2.7)


@dataclass(frozen=True)
class SignaturePlot:
    """An effect's own plot: title, what to look for, the share it removes, its equations and two panels of SVG."""

    title: str
    id: str
    look_for: str
    gain: str
    equations: Sequence[str]
    without: str
    with_it: str


def contribution(split: DataSplit, fitted: Fit, key: str) -> FloatArray:
    """What the effect `key` of the final model takes off the residual (N,) [effort]: residual without minus with it.

    The other effects keep their final parameters. A torque effect's share is -K phi theta, from

        r = K (z - z_hat) = K z - y* + K sum_k theta_k phi_k                      (diagnosis.design)

    and that of an effect on the drive is the difference between the efforts y* with and without it.
    """
    columns = Columns(split.samples)
    share = np.zeros(split.after.shape)
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        if term.effect.key == key:
            if theta.size:
                share = share - fitted.gain * (columns.of(term) @ theta)
            if isinstance(term.effect, DriveEffect) and (term.effect.shapes or term.effect.filters):
                rest = [t for t in fitted.terms if t is not term]
                share = share + columns.effort(fitted.terms) - columns.effort(rest)
    return np.asarray(share)


def cycles_of(fitted: Fit, key: str) -> float | None:
    """Cycles a turn of the effect `key` in the fit, or None if it has none."""
    for term in fitted.terms:
        if term.effect.key == key and term.shape.get("cycles_per_turn", 0.0) > 0.0:
            return float(term.shape["cycles_per_turn"])
    return None


def signature_quantity(split: DataSplit, joint: JointResult, found: FoundEffect) -> Quantity | None:
    """What the effect's signature is drawn against; None if that was not recorded."""
    x = next(t.effect.signature.x for t in joint.final.terms if t.effect.key == found.key)
    if x.startswith("position modulo"):
        cycles = cycles_of(joint.final, found.key)
        return modulo(split, cycles) if cycles else quantity(split, "position", joint.unit)
    return quantity(split, x, joint.unit)


def signature_plots(joint: JointResult, prefix: str, look: CloudLook) -> Sequence[SignaturePlot]:
    """One pair of panels for each effect that was found, on the held-out runs."""
    split = joint.heldout
    rows = rows_of(split)
    plots = []
    for number, found in enumerate(joint.effects):
        against = signature_quantity(split, joint, found)
        if against is None:
            continue
        share = contribution(split, joint.final, found.key)
        without = split.after + share
        scale = scale_for(float(np.max(np.abs(without))), joint.unit)
        fine = scale_for(float(np.max(np.abs(split.after))), joint.unit)
        name, floor = f"{prefix}-signature-{number}", joint.noise_floor
        bare = Cloud(
            f"{name}-without", f"without {found.title}", without, scale, floor, line=share, size=SIZE, look=look
        )
        full = Cloud(f"{name}-with", f"with {found.title}", split.after, fine, floor, size=SIZE, look=look)
        own = next(t.effect for t in joint.final.terms if t.effect.key == found.key)
        plots.append(
            SignaturePlot(
                title=found.title,
                id=found.id,
                look_for=own.signature.look_for,
                gain=percent(found.heldout_gain),
                equations=equations(own, found.parameters),
                without=cloud_svg(bare, against, rows),
                with_it=cloud_svg(full, against, rows),
            )
        )
    return plots
