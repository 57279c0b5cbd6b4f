"""Messages of joints against one least-squares problem of all joints stacked."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.diagnosis.linear import Prior, Products, posterior
from drake_tc.diagnosis.robot.messages import Message, belief, integrated

OWN, SHARED = (3, 2, 4), 5
VARIANCES = (0.3, 2.0, 0.05)
MEAN = np.array([0.2, -0.1, 0.0, 0.4, 1.0])
DEVIATION = np.array([0.5, 2.0, 1e-3, 1.0, 40.0])


def joints(seed=0):
    """(own columns, shared columns, target, prior of the own coefficients) of three joints."""
    rng, made = np.random.default_rng(seed), []
    shared = MEAN + DEVIATION * rng.standard_normal(SHARED)
    for size, variance in zip(OWN, VARIANCES, strict=True):
        own, common = rng.standard_normal((60, size)), rng.standard_normal((60, SHARED)) / DEVIATION
        prior = Prior(rng.standard_normal(size), rng.uniform(0.5, 3.0, size), np.zeros(size, dtype=bool))
        target = own @ rng.standard_normal(size) + common @ shared + np.sqrt(variance) * rng.standard_normal(60)
        made.append((own, common, target, prior))
    return made


def told(parts):
    out = []
    for (own, common, target, prior), variance in zip(parts, VARIANCES, strict=True):
        products = Products.of(np.concatenate([own, common], axis=1), target)
        out.append(integrated(products, prior, np.zeros(prior.mean.size, dtype=bool), variance))
    return out


def stacked(parts):
    """All joints as one problem: rows over their noise, own coefficients beside each other, the shared ones last."""
    width = sum(OWN) + SHARED
    design, at = np.zeros((60 * len(parts), width)), 0
    for number, (own, common, _, _) in enumerate(parts):
        rows = slice(60 * number, 60 * (number + 1))
        design[rows, at : at + own.shape[1]] = own / np.sqrt(VARIANCES[number])
        design[rows, -SHARED:] = common / np.sqrt(VARIANCES[number])
        at += own.shape[1]
    target = np.concatenate([part[2] / np.sqrt(v) for part, v in zip(parts, VARIANCES, strict=True)])
    last = Prior(MEAN, DEVIATION, np.zeros(SHARED, dtype=bool))
    return posterior(Products.of(design, target), Prior.stacked([*(part[3] for part in parts), last]), 1.0)


def test_messages_are_the_stacked_fit_of_all_joints():
    parts = joints()
    found, whole = belief(MEAN, DEVIATION, told(parts)), stacked(parts)
    assert_allclose(found.mean, whole.beta[-SHARED:], rtol=1e-8)
    assert_allclose(found.covariance, whole.covariance[-SHARED:, -SHARED:], rtol=1e-8, atol=1e-12)
    scale = -0.5 * 60 * np.log(VARIANCES).sum()  # rows over their noise have another density
    assert_allclose(found.log_evidence, whole.log_evidence + scale, rtol=1e-10)


def test_a_joint_beside_what_the_others_know_has_the_coefficients_of_the_stacked_fit():
    parts, at = joints(1), 0
    messages, whole = told(parts), stacked(parts)
    for number, (own, common, target, prior) in enumerate(parts):
        known = belief(MEAN, DEVIATION, [m for j, m in enumerate(messages) if j != number])
        start = np.linalg.solve(known.root, known.mean)
        unit = Prior(start, np.ones(SHARED), np.zeros(SHARED, dtype=bool))
        products = Products.of(np.concatenate([own, common @ known.root], axis=1), target)
        alone = posterior(products, Prior.stacked([prior, unit]), VARIANCES[number])
        mine = slice(at, at + own.shape[1])
        assert_allclose(alone.beta[: own.shape[1]], whole.beta[mine], rtol=1e-8)
        assert_allclose(np.diag(alone.covariance)[: own.shape[1]], np.diag(whole.covariance)[mine], rtol=1e-8)
        at += own.shape[1]


def test_the_gain_of_an_effect_of_one_joint_beside_the_others_is_that_of_the_stacked_fit():
    parts = joints(2)
    smaller = [parts[0], parts[1], (parts[2][0][:, :3], *parts[2][1:3], Prior(*(getattr(parts[2][3], n)[:3] for n in
               ("mean", "deviation", "positive"))))]  # fmt: skip
    whole = [belief(MEAN, DEVIATION, told(each)).log_evidence for each in (parts, smaller)]
    known = belief(MEAN, DEVIATION, told(parts)[:2])
    unit = Prior(np.linalg.solve(known.root, known.mean), np.ones(SHARED), np.zeros(SHARED, dtype=bool))
    alone = []
    for own, common, target, prior in (parts[2], smaller[2]):
        products = Products.of(np.concatenate([own, common @ known.root], axis=1), target)
        alone.append(posterior(products, Prior.stacked([prior, unit]), VARIANCES[2]).log_evidence)
    assert_allclose(alone[0] - alone[1], whole[0] - whole[1], rtol=1e-8)


def test_a_moved_message_is_the_same_density():
    message = told(joints())[0]
    rng = np.random.default_rng(4)
    step, s = rng.standard_normal((2, SHARED)) * 1e-2

    def density(m: Message, at):
        return m.constant + m.moment @ at - 0.5 * at @ m.precision @ at

    assert_allclose(density(message.moved(step), s - step), density(message, s), rtol=1e-10)
