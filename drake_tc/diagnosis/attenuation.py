"""Coefficients without what the sensors' noise in the columns takes off them (`linear.Products.without_noise`)."""

from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import Posterior, mode
from drake_tc.diagnosis.priors import NOISE_LEVEL


def corrected(evidence: Evidence, scored: Scored) -> Scored:
    """The set with coefficients that noise does not attenuate; how well the noise is known widens their covariance.

    Shapes stay, and so does what differs from run to run: residuals are told without it. The set itself where noise is
    all of the load, so that nothing would be left of the drive gain.
    """
    train, held = evidence.model.train, scored.posterior
    products, prior = evidence.products(train, scored.terms)
    gram, moment = evidence.noise_products(scored.terms)
    size, shapes = scored.coefficients, scored.shapes
    places = np.r_[:size, size + shapes : held.beta.size]
    b = held.beta[places]
    of_runs = sum(block.values.shape[1] for block in evidence.model.of_runs(train, evidence.spread.of(scored.terms)))
    moved, kept = np.arange(b.size - of_runs), np.arange(b.size - of_runs, b.size)
    own = products.at(moved)
    own = replace(own, moment=own.moment - products.gram[np.ix_(moved, kept)] @ b[kept])
    true = own.without_noise(gram[np.ix_(moved, moved)], moment[moved])
    after = b.copy()
    after[moved] = mode(true, prior.part(moved), held.variance)
    if after[0] <= evidence.model.least_gain:
        return scored
    louder = products.rss(after) / products.rss(b)
    shift = np.zeros(held.beta.size)
    shift[places] = after - b
    hessian, at = held.hessian.copy(), places[moved]
    hessian[np.ix_(at, at)] += (true.gram - own.gram) / held.variance
    covariance = louder * Posterior(held.beta, hessian, held.variance, 0.0).covariance
    covariance += NOISE_LEVEL**2 * np.outer(shift, shift)
    return replace(scored, posterior=replace(held, beta=held.beta + shift).with_covariance(covariance))
