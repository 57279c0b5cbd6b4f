"""Does an effect that the search chose hold? It must be possible, help in every run where it acts, and carry over.

An effect of the chosen set is withdrawn when
  1. its values are physically impossible (`effects.plausibility`),
  2. it corrects the encoder by less than the logs resolve,
  3. it is a curve over the position that is mostly a multiple of the known load,
  4. some training run speaks against it: fitted on the other runs, it makes the error of that run larger. With two
     training runs the effect alone is fitted on the other run, beside the model of both,
  5. the held-out runs speak against it,
  6. another effect was withdrawn, and without that one it no longer lowers the training error.
A run says something about an effect where it has the rows of a regression and the effect acts in it: where its
contribution has an RMS of a quarter of the noise floor or more. A training run speaks against it when its error is
larger with the effect in 98 % of block resamples, which is the certainty that the search asks of an improvement. The
model of a short run, or of one in which other things are missing too, differs from run to run by chance, so a smaller
certainty would withdraw true effects. A held-out run speaks against it when its error is larger, or when its gain may
be chance: less than 90 % of the block resamples have it; the model without the effect is fitted anew. The same is asked
of all held-out runs together, and they also speak against an effect that acts in them at all and makes their error
larger.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.data.sliding import LEAST_ROWS
from drake_tc.diagnosis.problem.bounded import solve_bounded
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, bounds_of, fit, predict
from drake_tc.diagnosis.problem.sensor_errors import expected_errors
from drake_tc.diagnosis.selection.plausible_values import looks_like_known_load, objection_to_values
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, Withdrawal
from drake_tc.diagnosis.thresholds import FEW_RUNS, HELDOUT_ACTS, HELDOUT_CERTAIN, RUN_ACTS, RUN_CERTAIN
from drake_tc.effects.base import Context
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray

RESAMPLES = 400
KEPT_OF_FIT = 1e-3
"""Weight of the fitted coefficients against one run's rows when an effect is fitted on the other run."""
FEWEST_STRETCHES = 4
"""Stretches of blocks that a run is cut into at least when it is resampled."""
FEWEST_BLOCKS = 24
"""Blocks that are resampled at least: half a second is most of what a short run has, so its blocks are cut smaller."""


@dataclass(frozen=True)
class Confirmed:
    """Rows that know the final model, the effects that held, fitted anew, and those that did not."""

    train: Columns
    held: Columns
    fit: Fit
    withdrawn: tuple[DidNotHold, ...]


Settle = Callable[[Fit], tuple[Columns, Columns, Fit]]
"""A fit to training rows, held-out rows and the fit itself, once the columns know the fit's coefficients."""


def confirm(
    settle: Settle, chosen: Fit, known: frozenset[str], context: Context, floor: float, least_gain: float
) -> Confirmed:
    """Withdraw effects one by one until all that are left hold.

    Args:
        settle: Makes columns know a fit.
        chosen: What the search chose.
        known: Keys of the declared effects, which are not questioned.
        context: What the logs span.
        floor: Noise floor [effort].
        least_gain: Smallest relative drop of the cross-validated error that the search asks of an effect. It is asked
            again once an effect was withdrawn, beside which another one was chosen.
    """
    withdrawn: list[DidNotHold] = []
    while True:
        columns, held, chosen = settle(chosen)
        expected = expected_errors(columns, chosen, known, context)
        if expected:  # not worth a word: the model has them anyway
            chosen = fit(columns, [t for t in chosen.terms if t not in expected])
            continue
        added = [t for t in chosen.terms if t.effect.key not in known]
        failed = [f for t in added if (f := _objection(columns, held, chosen, t, context, floor)) is not None]
        if withdrawn and not failed:
            failed = [f for t in added if (f := _no_longer_needed(columns, held, chosen, t, least_gain)) is not None]
        if not failed:
            return Confirmed(columns, held, chosen, tuple(withdrawn))
        worst = min(failed, key=lambda f: (f.reason != "implausible", f.heldout_gain or 0.0))
        withdrawn.append(worst)
        chosen = fit(columns, [t for t in chosen.terms if t.effect.key != worst.key])


def _no_longer_needed(columns: Columns, held: Columns, chosen: Fit, term: Term, least_gain: float) -> DidNotHold | None:
    """Withdraws an effect that lowers the training error no more once another one is gone."""
    rest = fit(columns, [t for t in chosen.terms if t is not term])
    gain = 1.0 - chosen.cv_rms / max(rest.cv_rms, 1e-300)
    if gain >= least_gain:
        return None
    heldout = 1.0 - _rms(predict(held, chosen)) / max(_rms(predict(held, rest)), 1e-300)
    why = f"Without the effects that did not hold, it lowers the cross-validated training error by {100 * gain:.1f} %."
    return DidNotHold(term.effect.key, term.effect.id, term.effect.title, "no_longer_needed", why, heldout)


def _objection(
    columns: Columns, held: Columns, chosen: Fit, term: Term, context: Context, floor: float
) -> DidNotHold | None:
    without = [t for t in chosen.terms if t is not term]
    rest = fit(columns, without)
    with_it, without_it = predict(held, chosen), predict(held, rest)
    gain = 1.0 - _rms(with_it) / max(_rms(without_it), 1e-300)

    def withdrawn(reason: Withdrawal, why: str) -> DidNotHold:
        effect = term.effect
        return DidNotHold(effect.key, effect.id, effect.title, reason, why, gain)

    impossible = objection_to_values(chosen, term, context, columns)
    if impossible is not None:
        return withdrawn(*impossible)
    same = looks_like_known_load(chosen, term, columns)
    if same:
        return withdrawn("looks_like_known_load", same)
    against = _training_run_against(columns, chosen, term, floor)
    if against:
        return withdrawn("training_run_against", f"Fitted on the other runs, it makes the error of {against} larger.")
    against = heldout_against(held.samples, without_it, with_it, floor)
    return withdrawn("heldout_run_against", against) if against else None


def heldout_against(samples: Samples, without: FloatArray, with_it: FloatArray, floor: float) -> str:
    """What the held-out runs say against an effect, or "".

    Args:
        samples: Held-out rows.
        without: (N,) residual without the effect [effort].
        with_it: (N,) with it.
        floor: Noise floor [effort].
    """
    for r in np.unique(samples.run):
        rows = samples.run == r
        run, lost = samples.runs[int(r)], _rms(with_it[rows]) / max(_rms(without[rows]), 1e-300) - 1.0
        if not _says_something(without[rows], with_it[rows], floor):
            continue
        if lost > 0.0:
            return f"It makes the held-out error of {run} larger."
        better = _worse_share(samples.block[rows], with_it[rows], without[rows])
        if better < HELDOUT_CERTAIN:
            return f"It lowers the held-out error of {run} by {-100 * lost:.1f} %, {_in_resamples(better)}."
    gain, acts = 1.0 - _rms(with_it) / max(_rms(without), 1e-300), _rms(with_it - without)
    if gain <= 0.0 and acts >= HELDOUT_ACTS * floor:
        return f"It changes the held-out error by {-100 * gain:+.1f} %."
    better = _worse_share(samples.block, with_it, without) if acts >= RUN_ACTS * floor else 1.0
    if better < HELDOUT_CERTAIN:
        return f"It lowers the held-out error by {100 * gain:.1f} %, {_in_resamples(better)}."
    return ""


def _in_resamples(share: float) -> str:
    return f"in {100 * share:.0f} % of the block resamples"


def _says_something(without: FloatArray, with_it: FloatArray, floor: float) -> bool:
    """Whether the rows (N,) of a run are enough for a regression and the effect acts in them."""
    return with_it.size >= LEAST_ROWS and _rms(with_it - without) >= RUN_ACTS * floor


def _training_run_against(columns: Columns, chosen: Fit, term: Term, floor: float) -> str:
    """The training run that speaks against an effect, or ""; noise that the effect lets through is no error of it."""
    samples, without = columns.samples, [t for t in chosen.terms if t is not term]
    count = np.unique(samples.run).size
    if count < 2:
        return ""  # the cross-validated gain in block resamples is a condition of the search
    rest = fit(columns, without)
    if count < FEW_RUNS:
        without_it = columns.target - columns.design(rest.terms) @ rest.beta
        with_it = exchanged(columns, chosen, term)
    else:
        without_it, with_it = (left_out(columns, f.terms) for f in (rest, chosen))
    gain = columns.gain or chosen.gain
    weights = (gain * columns.noise_ratio(f.beta, f.terms) for f in (rest, chosen))
    before, after = (weight * left for weight, left in zip(weights, (without_it, with_it), strict=True))
    return speaks_against(samples, before, after, floor)


def exchanged(columns: Columns, chosen: Fit, term: Term) -> FloatArray:
    """Residual (N,) [N m] of every training run with one effect's coefficients from the other runs.

        theta_r = argmin sum_(k not in r) (e_k + phi_k (theta - theta_fit))^2 + w sum_k (phi_k (theta - theta_fit))^2

    with the residual e of the fit. A small w leaves a level of a curve that the other runs do not reach as fitted. Two
    short runs identify no whole model each, but an effect beside the model of both.

    Args:
        columns: Training rows.
        chosen: Fitted to them.
        term: One of its effects.
    """
    left = columns.target - columns.design(chosen.terms) @ chosen.beta
    theta = next(theta for t, theta in coefficients_by_term(chosen.terms, chosen.beta) if t is term)
    if theta.size == 0:
        return left
    mine, run = columns.of(term), columns.samples.run
    held = KEPT_OF_FIT * mine.T @ mine + 1e-12 * np.trace(mine.T @ mine) * np.eye(theta.size)
    out = left.copy()
    for r in np.unique(run):
        rows, others = run == r, run != r
        gram = mine[others].T @ mine[others] + held
        change = -np.linalg.solve(gram, mine[others].T @ left[others])  # the residual holds + phi theta
        out[rows] += mine[rows] @ change
    return out


def left_out(columns: Columns, terms: Sequence[Term]) -> FloatArray:
    """Residual (N,) [N m] of every training run, predicted from the other runs; shapes stay as they are."""
    x, z, run = columns.design(terms), columns.target, columns.samples.run
    runs = np.unique(run)
    grams = {r: x[run == r].T @ x[run == r] for r in runs}
    moments = {r: x[run == r].T @ z[run == r] for r in runs}
    low, high = bounds_of(terms, columns.declared_gain)
    total, moment = columns.prior(terms).added(sum(grams.values()), sum(moments.values()))
    out = np.empty_like(z)
    for r in runs:
        beta = solve_bounded(total - grams[r], moment - moments[r], low, high)
        out[run == r] = z[run == r] - x[run == r] @ beta
    return out


def speaks_against(
    samples: Samples, without: FloatArray, with_it: FloatArray, floor: float, certain: float = RUN_CERTAIN
) -> str:
    """Name of the run whose error (N,) is larger with an effect, in at least `certain` of block resamples; or ""."""
    worst, name = 0.0, ""
    for r in np.unique(samples.run):
        rows = samples.run == r
        if not _says_something(without[rows], with_it[rows], floor):
            continue
        loss = _rms(with_it[rows]) / max(_rms(without[rows]), 1e-300) - 1.0
        if loss > worst and _worse_share(samples.block[rows], without[rows], with_it[rows]) >= certain:
            worst, name = loss, samples.runs[int(r)]
    return name


def _worse_share(block: IntArray, without: FloatArray, with_it: FloatArray) -> float:
    """Share of resamples of a run's blocks, half a second at most, in which the effect makes the squared error larger.

    Neighbouring blocks are drawn together, 2 tau - 1 of them where their differences have the correlation time tau: a
    model that is wrong in one way for seconds errs once, not once in each block (circular block bootstrap: Politis and
    Romano, 1992; stretches of tau alone would show half of an AR(1) process's variance).
    """
    number = cut_blocks(np.unique(block, return_inverse=True)[1])
    more = np.bincount(number, with_it**2 - without**2)
    correlated = round(2.0 * correlation_time(more - more.mean())) - 1
    together = min(correlated, max(more.size // FEWEST_STRETCHES, 1))
    starts = np.random.default_rng(0).integers(0, more.size, (RESAMPLES, -(-more.size // together)))
    draws = (starts[..., None] + np.arange(together)) % more.size
    return float(np.mean(more[draws].sum(axis=(1, 2)) > 0.0))


def cut_blocks(block: IntArray) -> IntArray:
    """Blocks (N,) cut into equal parts until there are at least `FEWEST_BLOCKS`, or one for each row."""
    sizes = np.bincount(block)
    parts = -(-FEWEST_BLOCKS // sizes.size)
    if parts == 1:
        return block
    within = np.arange(block.size) - (np.cumsum(sizes) - sizes)[block]
    return np.asarray(np.unique(block * parts + within * parts // sizes[block], return_inverse=True)[1])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
