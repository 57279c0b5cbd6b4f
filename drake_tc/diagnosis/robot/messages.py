"""What the joints say of the parameters that they share: one fit of all joints, joint by joint.

Joint i has the whitened rows u_i = X_i b_i + S_i s + n_i with its own coefficients b_i and the shared parameters s. All
priors are Gaussian, so that its own coefficients can be integrated out, and what remains is a quadratic form, its
message:

    log p(u_i | s) = c_i + h_i' s - 1/2 s' L_i s
    L_i = H_ss - H_so H_oo^-1 H_os,   h_i = r_s - H_so H_oo^-1 r_o

with the blocks of the Hessian H and of the right-hand side r of the joint's least squares. With s ~ N(m, diag(t^2)) and
y = (s - m)/t, messages add up:

    log p(u_1, ..., u_n) = c - 1/2 log|A| + 1/2 h' A^-1 h,   A = I + sum_i L_i,   y | u ~ N(A^-1 h, A^-1)

in units of t. The same sum without joint i is what joint i knows of s before it sees its own rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.evidence import Evidence, Scored, placed
from drake_tc.diagnosis.linear import Prior, Products, log_determinant
from drake_tc.diagnosis.split import Split
from drake_tc.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Message:
    """c + h' s - 1/2 s' L s.

    Attributes:
        constant: c. moment: (p,) h. precision: (p, p) L.
    """

    constant: float
    moment: FloatArray
    precision: FloatArray

    def __add__(self, other: "Message") -> "Message":
        return Message(self.constant + other.constant, self.moment + other.moment, self.precision + other.precision)

    def of(self, places: IntArray) -> "Message":
        """With all but these parameters at 0."""
        return Message(self.constant, self.moment[places], self.precision[np.ix_(places, places)])

    def moved(self, step: FloatArray) -> "Message":
        """Of s - step (p,)."""
        turned = self.precision @ step
        return Message(
            self.constant + float(self.moment @ step - 0.5 * step @ turned), self.moment - turned, self.precision
        )

    @classmethod
    def none(cls, size: int) -> "Message":
        """Of a joint that says nothing."""
        return cls(0.0, np.zeros(size), np.zeros((size, size)))


@dataclass(frozen=True, eq=False)
class Belief:
    """What is known of s: mean (p,), a root R (p, p) of its covariance R R', and the log evidence of what told it."""

    mean: FloatArray
    root: FloatArray
    log_evidence: float

    @property
    def covariance(self) -> FloatArray:
        """(p, p)."""
        return np.asarray(self.root @ self.root.T)


def belief(mean: FloatArray, deviation: FloatArray, messages: Sequence[Message]) -> Belief:
    """What prior N(mean, diag(deviation^2)) and messages together know of s (p,)."""
    total = sum(messages, Message.none(mean.size))
    precision = np.eye(mean.size) + total.precision * np.outer(deviation, deviation)
    moment = deviation * (total.moment - total.precision @ mean)
    constant = total.constant + float(mean @ total.moment - 0.5 * mean @ total.precision @ mean)
    size, turn = np.linalg.eigh(0.5 * (precision + precision.T))
    size = np.maximum(size, 1.0)  # the prior's own; less is rounding
    root = turn / np.sqrt(size)
    towards = root.T @ moment
    evidence = constant - 0.5 * float(np.sum(np.log(size))) + 0.5 * float(towards @ towards)
    return Belief(mean + deviation * (root @ towards), deviation[:, None] * root, evidence)


def message(evidence: Evidence, scored: Scored, columns: FloatArray) -> Message:
    """What one joint says of s.

    Args:
        evidence: Of the joint; columns that it shares in its own model are left out.
        scored: Its set; its noise is held.
        columns: (N, p) by which its load errs for each unit of s [N m].
    """
    alone = _alone(evidence)
    products, prior = _products(alone, alone.model.train, scored, columns)
    constant = alone.odds(scored.terms, scored.posterior) - scored.posterior.log_evidence
    told = integrated(products, prior, _held(scored, prior), scored.posterior.variance)
    return replace(told, constant=told.constant + constant)


def message_of_both(evidence: Evidence, scored: Scored, columns: tuple[FloatArray, FloatArray]) -> Message:
    """The same of training and held-out rows together, without the constants that do not depend on s.

    Coefficients of single runs are each run's own.
    """
    alone = _alone(evidence)
    model, size = alone.model, columns[0].shape[1]
    (train, prior), (held, more) = (
        _products(alone, split, scored, each) for split, each in zip((model.train, model.held), columns, strict=True)
    )
    runs = [
        sum(b.values.shape[1] for b in model.of_runs(s, alone.spread.of(scored.terms)))
        for s in (model.train, model.held)
    ]
    common, shapes = prior.mean.size - runs[0] - scored.shapes, np.arange(scored.shapes)
    own = prior.mean.size + runs[1]
    shared, places = own + np.arange(size), np.arange(prior.mean.size)
    of_held = np.concatenate([places[:common], prior.mean.size + np.arange(runs[1]), common + runs[0] + shapes, shared])
    both = placed(train, np.concatenate([places, shared]), own + size) + placed(held, of_held, own + size)
    joined = Prior.stacked([prior, more.part(slice(common, common + runs[1]))])
    return integrated(both, joined, _held(scored, joined), scored.posterior.variance)


def _alone(evidence: Evidence) -> Evidence:
    return Evidence(replace(evidence.model, shared=None), evidence.noise, evidence.spread)


def _held(scored: Scored, prior: Prior) -> BoolArray:
    """Which own coefficients a bound holds at 0."""
    out = np.zeros(prior.mean.size, dtype=np.bool_)
    out[: scored.coefficients] = prior.positive[: scored.coefficients] & (scored.b == 0.0)
    return out


def _products(alone: Evidence, split: Split, scored: Scored, columns: FloatArray) -> tuple[Products, Prior]:
    """Products of [own, slopes of the shapes, shared] of a split, and the prior of the own ones."""
    design, prior = alone.design(split, scored.terms)
    slopes = alone.tangents(split, scored.terms, scored.b)
    shared = split.rows.whitened(-split.gain * columns, alone.noise)[0]
    joined = np.concatenate([design, slopes, shared], axis=1)
    target = alone.target(split, scored.terms)
    return Products.of(joined, target, alone.noise.share), Prior.stacked([prior, alone.model.shape_prior(scored.terms)])


def residual_at(
    evidence: Evidence, scored: Scored, columns: tuple[FloatArray, FloatArray], step: FloatArray
) -> FloatArray:
    """(N,) residual [effort] of a joint's held-out rows where s = step, its own coefficients fitted to that.

    Args:
        evidence: Of the joint.
        scored: Its set, with its shapes.
        columns: (N, p) of the training and of the held-out rows.
        step: (p,).
    """
    alone = _alone(evidence)
    products, prior = _products(alone, alone.model.train, scored, columns[0])
    size, free = prior.mean.size, np.flatnonzero(~_held(scored, prior))
    precision = scored.posterior.variance / prior.deviation**2
    hessian = products.gram[:size, :size] + np.diag(precision)
    right = products.moment[:size] + precision * prior.mean - products.gram[:size, size:] @ step
    scale = 1.0 / np.sqrt(np.diag(hessian)[free])
    own = np.zeros(size)
    own[free] = scale * np.linalg.solve(hessian[np.ix_(free, free)] * np.outer(scale, scale), scale * right[free])
    held = alone.model.held
    blocks = [*alone.model.blocks(held, scored.terms), *alone.model.nuisances(held)]
    design = np.concatenate([block.values for block in blocks], axis=1)
    return np.asarray(held.target(scored.terms) - design @ own[: design.shape[1]] + held.gain * columns[1] @ step)


def integrated(products: Products, prior: Prior, held: BoolArray, variance: float) -> Message:
    """The message of products of [own, shared] columns under noise of this variance.

    Args:
        products: Own columns first.
        prior: Of the own coefficients (k,).
        held: (k,) own coefficients that a bound holds at 0.
        variance: Of the whitened rows.
    """
    size, free = prior.mean.size, np.flatnonzero(~held)
    hessian = products.gram / variance
    own = hessian[:size, :size] + np.diag(1.0 / prior.deviation**2)
    right = products.moment / variance
    towards = (right[:size] + prior.mean / prior.deviation**2)[free]
    scale = 1.0 / np.sqrt(np.diag(own)[free])
    factor = np.linalg.cholesky(own[np.ix_(free, free)] * np.outer(scale, scale) + 1e-13 * np.eye(free.size))
    cross = np.linalg.solve(factor, scale[:, None] * hessian[:size, size:][free])
    along = np.linalg.solve(factor, scale * towards)
    off = prior.mean / prior.deviation
    constant = -0.5 * products.rows * np.log(2.0 * np.pi * variance) - 0.5 * products.square / variance
    constant += 0.5 * float(along @ along - off @ off) - float(np.sum(np.log(prior.deviation)))
    constant += float(np.log(2.0) * np.count_nonzero(prior.positive)) - 0.5 * log_determinant(own)
    return Message(constant, right[size:] - cross.T @ along, hessian[size:, size:] - cross.T @ cross)
