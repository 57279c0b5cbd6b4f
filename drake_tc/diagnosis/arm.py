"""A robot's joints on held-out rows: the declared model, and what the search added on the other rows alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.problem.arm.fit import ArmFit, ShaftEffect, design_of, fit_arm, reweighted
from drake_tc.diagnosis.problem.arm.rows import ArmRows
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.selection.arm import search_arm
from drake_tc.diagnosis.thresholds import ARM, SearchThresholds
from drake_tc.effects.base import Effect
from drake_tc.effects.library import effect
from drake_tc.identification.base_parameters import independent_columns
from drake_tc.types import BoolArray, FloatArray

SIGMA_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class ArmHeldOut:
    """Errors on rows that took no part.

    Attributes:
        torque: (N, n) of the held-out rows [N m].
        before, after: (N, n) what the declared and the found model leave of it [N m].
        baseline, chosen: The fits.
    """

    torque: FloatArray
    before: FloatArray
    after: FloatArray
    baseline: ArmFit
    chosen: ArmFit

    @property
    def found(self) -> tuple[ShaftEffect, ...]:
        """Effects that were added, in order."""
        return self.chosen.shaft_effects[len(self.baseline.shaft_effects) :]


def declare(
    rows: ArmRows, raw: FloatArray, declared: Sequence[ShaftEffect]
) -> tuple[ArmRows, FloatArray, tuple[ShaftEffect, ...]]:
    """Keep the base parameters: a largest independent set of rigid and declared columns.

    Returns:
        The rows and the unfiltered rigid columns with the columns kept, and the declared effects kept.
    """
    rigid = rows.rigid.shape[2]
    design = design_of(rows, tuple(declared))
    weights = 1.0 / np.sqrt(np.mean(rows.torque**2, axis=0))
    kept = independent_columns((design * weights[None, :, None]).reshape(-1, design.shape[2]))
    mine = kept[kept < rigid]
    widths = np.cumsum([rigid, *(len(p.term.effect.coefficients) for p in declared)])
    spans = zip(declared, widths[:-1], widths[1:], strict=True)
    shaft_effects = tuple(p for p, start, stop in spans if np.isin(np.arange(start, stop), kept).all())
    return replace(rows, rigid=rows.rigid[:, :, mine]), raw[:, :, mine], shaft_effects


def declared_friction(axes: int, joints: int, *, inertia: bool) -> tuple[ShaftEffect, ...]:
    """Viscous and Coulomb friction (and a rotor) on every shaft, and a constant torque on each of the first shafts."""
    names = ("viscous", "coulomb", "rotor_inertia") if inertia else ("viscous", "coulomb")
    on_shafts = [ShaftEffect(a, Term(effect(name))) for a in range(axes) for name in names]
    return (*on_shafts, *(ShaftEffect(j, Term(effect("torque_sensor_bias"))) for j in range(joints)))


def hold_out_arm(
    rows: ArmRows,
    raw: FloatArray,
    declared: Sequence[ShaftEffect],
    test: BoolArray,
    effects: Sequence[Effect],
    thresholds: SearchThresholds = ARM,
    progress: Callable[[str, float], None] = lambda text, share: None,
) -> ArmHeldOut:
    """Fit and search on the rows outside `test`, none within the filters' reach of it, and predict `test`.

    Args:
        rows: As `declare` gives them.
        raw: Rigid columns after the first kernel alone.
        declared: What is fitted before the search.
        test: (N,) held-out rows.
        effects: Candidates of the search; none to fit the declared model alone.
        thresholds: What counts as real.
        progress: Told how far the search is.
    """
    train = ~test & ~_near(rows, test)
    first = _renumbered(rows.take(train))
    fitted = fit_arm(first, tuple(declared), np.sqrt(np.mean(first.torque**2, axis=0)))
    for _ in range(SIGMA_ROUNDS):
        fitted = reweighted(fitted, np.sqrt(np.mean(fitted.residual**2, axis=0)))
    loaded = rows.with_load(fitted.beta[: rows.rigid.shape[2]], raw)
    first, held = replace(first, signals=loaded.signals), loaded.take(test)
    baseline = fit_arm(first, tuple(declared), fitted.sigma)
    chosen = search_arm(baseline, effects, thresholds, progress).chosen if effects else baseline
    before, after = (held.torque - f.predict(held) for f in (baseline, chosen))
    return ArmHeldOut(held.torque, before, after, baseline, chosen)


def _renumbered(rows: ArmRows) -> ArmRows:
    return replace(rows, block=np.unique(rows.block, return_inverse=True)[1].astype(np.int64))


def _near(rows: ArmRows, test: BoolArray) -> BoolArray:
    """Rows within the filters' reach of a held-out row of the same run (N,)."""
    near = np.zeros(test.size, dtype=bool)
    reach = rows.reach_s / rows.light.period
    for run in np.unique(rows.run):
        mine = np.flatnonzero(rows.run == run)
        held = rows.rows[mine][test[mine]]
        if held.size:
            at = rows.rows[mine]
            after = np.searchsorted(held, at)
            distance = np.minimum(
                np.abs(at - held[np.minimum(after, held.size - 1)]), np.abs(at - held[np.maximum(after - 1, 0)])
            )
            near[mine] = distance < reach
    return near & ~test


def every_other_block(rows: ArmRows, seconds: float, folds: int, which: int) -> BoolArray:
    """(N,) rows in every `folds`-th stretch of `seconds`, counted from each run's first row: a split set beforehand."""
    start = np.array(
        [rows.rows[rows.run == r].min() if (rows.run == r).any() else 0 for r in range(rows.run.max() + 1)]
    )
    stretch = ((rows.rows - start[rows.run]) * rows.light.period / seconds).astype(np.int64)
    return np.asarray(stretch % folds == which)
