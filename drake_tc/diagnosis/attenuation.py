"""What the sensors' noise in the columns takes off the coefficients, and the coefficients without it.

With noise dX in whitened columns and du in the target, the most probable coefficients b are on average those of

    H b' = (H - S) b + s,    S = E[dX' dX]/s^2,   s = E[dX' du]/s^2

with the Hessian H of the posterior (Fuller, 1987, section 2.2). Noise of each channel is drawn and passes the filters,
the columns and the whitening as the channel itself did, so that no effect needs a formula of its own.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import JITTER, Posterior
from drake_tc.diagnosis.model import Split, with_clean, with_needed
from drake_tc.diagnosis.priors import ALTERNATIVE, NOISE_LEVEL
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Signals
from drake_tc.types import BoolArray, FloatArray

SEED = 0
LEAST_SIGNAL = 0.1
"""Least eigenvalue of H - S beside a scaled H below which noise is most of a column, and nothing is corrected."""


def corrected(evidence: Evidence, scored: Scored) -> Scored:
    """The set with coefficients that noise does not attenuate; how well the noise is known widens their covariance.

    Shapes and what differs from run to run stay. Where noise is most of a column, the coefficients stay, and their own
    size is their uncertainty.
    """
    columns, target = drawn(evidence, scored)
    held = scored.posterior
    share = evidence.noise.share / held.variance
    size, shapes = scored.coefficients, scored.shapes
    places = np.r_[:size, size + shapes : columns.shape[1] + shapes]
    seen = (held.beta[places] != 0.0) & (np.mean(columns**2, axis=0) > 0.0)
    free, columns = places[seen], columns[:, seen]
    gram, moment = share * columns.T @ columns, share * columns.T @ target
    true = held.hessian.copy()
    true[np.ix_(free, free)] -= gram
    scale = 1.0 / np.sqrt(np.diag(held.hessian))
    shift: FloatArray = np.zeros(held.beta.size)
    if np.linalg.eigvalsh(true * np.outer(scale, scale))[0] < LEAST_SIGNAL * _least(held.hessian, scale):
        shift[free] = held.beta[free]
        beta = held.beta
    else:
        shift[free] = np.linalg.solve(true[np.ix_(free, free)], gram @ held.beta[free] - moment)
        beta = held.beta + shift
        beta[:size] = np.where(_positive(evidence, scored), np.maximum(beta[:size], 0.0), beta[:size])
    covariance = held.covariance + NOISE_LEVEL**2 * np.outer(shift, shift)
    sizes = np.outer(*2 * [1.0 / np.sqrt(np.diag(covariance))])
    hessian = sizes * np.linalg.pinv(covariance * sizes, rcond=JITTER, hermitian=True)
    return replace(scored, posterior=Posterior(beta, np.asarray(hessian), held.variance, held.log_evidence))


def without_noise(evidence: Evidence, scored: Scored) -> tuple[Scored, tuple[Term, ...]]:
    """The set without effects that noise in the columns alone asks for, and these.

    Less of a noisy column leaves less noise. Without that, the coefficients of such an effect can be 0.
    """
    asked = [t for t in scored.terms if t.effect.coefficients and not evidence.model.is_declared(t.effect)]
    if not asked:
        return scored, ()
    true = corrected(evidence, scored).posterior
    ends = np.cumsum([1, *(len(t.effect.coefficients) for t in scored.terms)])
    places = {t.effect.key: slice(*pair) for t, pair in zip(scored.terms, pairwise(ends), strict=True)}

    def odds(own: slice) -> float:
        b = true.beta[own]
        return 0.5 * float(b @ np.linalg.lstsq(true.covariance[own, own], b, rcond=None)[0])

    noise = tuple(t for t in asked if odds(places[t.effect.key]) < ALTERNATIVE)
    return evidence.refined(evidence.score([t for t in scored.terms if t not in noise])) if noise else scored, noise


def _positive(evidence: Evidence, scored: Scored) -> BoolArray:
    """(1 + k,) of the drive gain and the coefficients, which may not be negative."""
    blocks = evidence.model.blocks(evidence.model.train, scored.terms)
    return np.concatenate([block.prior.positive for block in blocks])


def _least(hessian: FloatArray, scale: FloatArray) -> float:
    return float(np.linalg.eigvalsh(hessian * np.outer(scale, scale))[0])


@dataclass(frozen=True)
class Drawn:
    """Noise (T,) of each channel after the light kernel: position, its rates, load torque and effort."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    load_torque: FloatArray
    effort: FloatArray

    @classmethod
    def of(cls, split: Split, *, measured: bool) -> "Drawn":
        """Drawn as large as the log shows each channel's; `measured`: a sensor tells the load torque."""
        samples, light = split.samples, split.samples.light
        level, size, random = samples.resolution, len(samples.signals), np.random.default_rng(SEED)
        if level.raw_velocity_noise > 0.0:
            raw = level.raw_velocity_noise * random.standard_normal(size)
            motion = (np.zeros(size), light.smooth(raw), light.derivative(raw))
        else:
            raw = level.position_noise * random.standard_normal(size)
            motion = (light.smooth(raw), light.derivative(raw), light.second_derivative(raw))
        s = samples.signals
        torque = s.load_slope * motion[0] + s.link_inertia * motion[2]
        if measured:
            torque = level.torque_noise * light.smooth(random.standard_normal(size))
        own = max(level.effort_noise, level.effort_step / np.sqrt(12.0))
        effort = own * light.smooth(random.standard_normal(size))
        return cls(*motion, torque, effort - motion[0] if samples.floor.servo else effort)

    def added(self, signals: Signals) -> Signals:
        """The recorded signals with this noise once more."""
        names = ("position", "velocity", "acceleration", "load_torque", "effort")
        return replace(signals, **{name: getattr(signals, name) + getattr(self, name) for name in names})


def drawn(evidence: Evidence, scored: Scored) -> tuple[FloatArray, FloatArray]:
    """Whitened noise (n, m) of the training columns (no shapes, no runs) in the posterior's order, and (n,) of u."""
    model, measured = evidence.model, evidence.model.context.load == "torque"
    recorded = model.train.recorded
    noise = Drawn.of(model.train, measured=measured)
    samples = replace(recorded.samples, signals=noise.added(recorded.samples.signals))
    columns = []
    for each in (recorded, recorded.changed(samples=samples, target=None)):
        needed = with_needed(each, scored.terms, scored.beta, measured=measured, ages=model.train.ages)
        shares = replace(needed, share=model.train.share, of_load=model.train.of_load)
        own = replace(model, train=with_clean(shares, measured=measured))
        blocks = [*own.blocks(own.train, scored.terms), *own.nuisances(own.train)]
        columns.append(np.concatenate([*(b.values for b in blocks), own.train.target(())[:, None]], axis=1))
    white = model.train.rows.whitened(columns[1] - columns[0], evidence.noise)[0]
    return white[:, :-1], white[:, -1]
