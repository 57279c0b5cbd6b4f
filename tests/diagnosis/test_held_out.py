"""The predictive density of the held-out runs, against the dense Gaussian that it stands for."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.linear import posterior
from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.problem.prepared import prepare_joint
from tests.diagnosis.rigs import Joint, record, rig_of


def test_the_held_out_rows_are_predicted_by_the_posterior_of_the_fit_whatever_the_noise_they_are_judged_under() -> None:
    joint = Joint(torque_noise=0.3, duration=4.0)
    runs = [record(joint, name, shift, seed=k) for k, (name, shift) in enumerate((("one", 0.0), ("held", 2.1)))]
    model = joint_model(prepare_joint(runs[:1], runs[1:], rig_of(joint), "joint"))
    fitted, judge = Evidence(model, NoiseModel(ratio=3.0, memory=0.3)), Evidence(model)
    terms = model.declared
    of_fit, variance = (each.score(terms).posterior.variance for each in (fitted, judge))
    products, prior = fitted.products(model.train, terms)
    known = posterior(products, prior, of_fit)
    rows, target = judge.design(model.held, terms)[0], judge.target(model.held, terms)
    spread = rows @ known.covariance @ rows.T + variance * np.eye(target.size)
    gain = known.covariance @ rows.T @ np.linalg.inv(spread)
    after = known.beta + gain @ (target - rows @ known.beta)
    of_load = 0.5 * target.size * np.log(judge.by_load(float(after[0])))
    expected = multivariate_normal(rows @ known.beta, spread).logpdf(target) + of_load
    assert judge.predictive(terms, variance, fitted, of_fit) == pytest.approx(expected, rel=1e-5)
    assert judge.predictive(terms, variance, judge, of_fit) != pytest.approx(expected, rel=1e-5)
