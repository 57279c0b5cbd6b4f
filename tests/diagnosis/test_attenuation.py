"""Coefficients beside noisy columns, against the truth of simulated logs and against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.intervals import CRITICAL
from drake_tc.diagnosis.model import RunSpread
from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.priors import NAMED
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.search import equally_noisy
from drake_tc.effects.deadzone import Deadzone
from drake_tc.effects.load_dependent_friction import LoadDependentFriction
from drake_tc.effects.payload import Payload
from tests.diagnosis.rigs import Joint, record, rig_of, servo

NOISE = 1.5
"""Of the torque sensor [N m], a quarter of the torque's RMS, before the filters."""


def _heard(joint: Joint) -> tuple[Evidence, Scored]:
    train = [record(joint, f"run{k}", 0.4 * k, seed=k) for k in range(3)]
    prepared = prepare_joint(train, [record(joint, "held", 2.1, seed=9)], rig_of(joint), "joint")
    model = joint_model(prepared)
    evidence = Evidence(model).tempered(model.declared)
    return evidence, evidence.score(model.declared)


@pytest.fixture(scope="module")
def noisy() -> tuple[Evidence, Scored]:
    return _heard(Joint(torque_noise=NOISE))


def test_the_gain_beside_a_noisy_torque_sensor_is_that_of_the_joint(noisy: tuple[Evidence, Scored]) -> None:
    truth = Joint().gain
    evidence, scored = noisy
    after = evidence.corrected(scored)
    deviation = float(np.sqrt(after.posterior.covariance[0, 0]))
    attenuated = CRITICAL * float(np.sqrt(scored.posterior.covariance[0, 0]))
    assert scored.b[0] < truth - attenuated
    assert abs(after.b[0] - truth) <= 2.5 * deviation
    assert deviation < 0.02 * truth


def test_the_drawn_noise_of_the_gain_s_column_is_what_the_filters_pass(noisy: tuple[Evidence, Scored]) -> None:
    """White noise through both kernels has the sum of the squares of their taps as its variance."""
    evidence, scored = noisy
    samples = evidence.model.train.samples
    taps = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    gram = evidence.noise_products(scored.terms)[0]
    drawn = np.sqrt(gram[0, 0] / (evidence.noise.share * evidence.model.train.rows.index.size))
    unit = evidence.model.train.rows.whitened(
        np.random.default_rng(1).normal(size=(samples.rows.size, 1)), evidence.noise
    )[0]
    expected = NOISE * np.sqrt(taps @ taps) * np.sqrt(np.mean(unit**2))
    assert drawn == pytest.approx(expected, rel=0.35)


def test_without_noise_nothing_changes() -> None:
    evidence, scored = _heard(Joint())
    after = evidence.corrected(scored)
    np.testing.assert_allclose(after.b, scored.b, rtol=2e-4)


def test_a_set_of_whose_load_all_is_noise_stays_as_it_is(
    noisy: tuple[Evidence, Scored], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing would be left of the drive gain, and every parameter is over it."""
    evidence, scored = noisy
    whole = evidence.products(evidence.model.train, scored.terms)[0]
    monkeypatch.setattr(Evidence, "noise_products", lambda self, terms: (whole.gram, whole.moment, 0.0))
    assert evidence.corrected(scored) is scored


def test_what_differs_from_run_to_run_takes_no_part_of_the_correction(noisy: tuple[Evidence, Scored]) -> None:
    """Residuals are told without it, and would hold the part that it took."""
    evidence, scored = noisy
    beside_runs = Evidence(evidence.model, evidence.noise, RunSpread(friction=0.1, zero=0.1))
    scored = beside_runs.score(scored.terms)
    after = beside_runs.corrected(scored)
    runs = sum(b.values.shape[1] for b in beside_runs.model.of_runs(beside_runs.model.train, beside_runs.spread))
    np.testing.assert_array_equal(after.posterior.beta[-runs:], scored.posterior.beta[-runs:])
    assert after.b[0] > scored.b[0]


def test_what_lets_less_noise_through_is_no_merit_of_a_set(noisy: tuple[Evidence, Scored]) -> None:
    """Half the drive gain beside a payload in place of the measured load: its columns have no noise."""
    evidence, scored = noisy
    with_noise = evidence.score([*scored.terms, Term(Payload())])
    assert with_noise.posterior.log_evidence > scored.posterior.log_evidence + NAMED  # of the effort alone
    sets = [(evidence, evidence.refined(each)) for each in (scored, with_noise)]
    truth, other = (each for _, each in equally_noisy(sets))
    assert other.log_odds < truth.log_odds - NAMED


def test_a_set_without_the_load_that_leaves_as_much_is_less_probable_by_the_noise_that_the_load_passes(
    noisy: tuple[Evidence, Scored],
) -> None:
    """Closed form: n/2 log(1 + v/s^2), v the variance that the torque sensor's noise has in the effort."""
    evidence, scored = noisy
    refined = evidence.refined(scored)
    quiet = replace(refined, passed=0.0, terms=(*refined.terms, Term(Payload())))
    loud, less = (each.log_odds for _, each in equally_noisy([(evidence, refined), (evidence, quiet)]))
    samples = evidence.model.train.samples
    taps = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    passed = (Joint().gain * NOISE) ** 2 * float(taps @ taps) * evidence.noise_gain(refined, NoiseModel())
    rows = evidence.noise.share * evidence.model.train.rows.index.size
    assert loud - less == pytest.approx(0.5 * rows * np.log1p(passed / refined.left), rel=0.25)


def test_what_no_sensor_s_noise_explains_may_be_the_load_s_and_a_smaller_gain_does_not_explain_it(
    noisy: tuple[Evidence, Scored],
) -> None:
    """Closed form: n s log(K/K_less), s the share of what is left without the effect that is no sensor's noise."""
    evidence, scored = noisy
    few = replace(evidence.refined(scored), passed=0.7)
    more = replace(few, terms=(*few.terms, Term(Payload())))
    half = replace(more, posterior=replace(few.posterior, beta=0.5 * few.posterior.beta))
    rows = evidence.noise.share * evidence.model.train.rows.index.size
    for larger, expected in ((more, 0.0), (half, rows * 0.3 * np.log(2.0))):
        (_, less), (_, without) = equally_noisy([(evidence, larger), (evidence, few)])
        assert without.log_odds - less.log_odds == pytest.approx(expected, abs=1e-6)
    declared = Evidence(replace(evidence.model, held_gain=few.b[0]), evidence.noise)
    (_, less), (_, without) = equally_noisy([(declared, half), (declared, few)])
    assert without.log_odds == pytest.approx(less.log_odds), "a declared gain is no choice of the fit"


@pytest.mark.parametrize("joint", [Joint(torque_noise=NOISE), servo(encoder_noise=3e-4)])
def test_how_much_noise_a_set_lets_through_does_not_depend_on_the_whitening(joint: Joint) -> None:
    """Else a discrepancy that another set leaves would count as sensors that are louder or quieter."""
    evidence, scored = _heard(joint)
    passed = []
    for noise in (NoiseModel(), NoiseModel(ratio=3.0, memory=3.0), NoiseModel(ratio=1.0, memory=0.1, moving=1.0)):
        own = Evidence(evidence.model, noise, evidence.spread)
        refined = own.refined(own.score(scored.terms))
        passed.append(refined.passed * refined.left / own.noise_gain(refined, NoiseModel()))
    assert passed == pytest.approx([passed[0]] * 3, rel=0.03)


def test_the_density_of_effort_and_load_is_that_of_the_load_where_the_effort_has_no_noise(
    noisy: tuple[Evidence, Scored],
) -> None:
    """n log K more than that of the effort: all of the noise is the torque sensor's."""
    evidence, scored = noisy
    model, rows = evidence.model, evidence.model.train.rows.index.size
    assert model.of_load == pytest.approx(1.0, abs=1e-6)
    half = replace(scored.posterior, beta=0.5 * scored.posterior.beta)
    more = evidence.log_jacobian(model.train, scored.terms, scored.posterior)
    less = evidence.log_jacobian(model.train, scored.terms, half)
    assert more - less == pytest.approx(evidence.noise.share * rows * np.log(2.0))


def test_beside_a_shape_no_coefficient_is_less_certain_than_its_prior(
    noisy: tuple[Evidence, Scored], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nine tenths of the columns are noise, what a shape has in common with them is known no better.

    How well the level of the noise is known widens intervals beyond those of the prior.
    """
    evidence, scored = noisy
    terms = [*scored.terms, Term(Deadzone(), {"deadzone": 2e-3})]
    dead = evidence.with_shapes(evidence.score(terms))
    whole, prior = evidence.products(evidence.model.train, terms)
    monkeypatch.setattr(Evidence, "noise_products", lambda self, terms: (0.9 * whole.gram, 0.9 * whole.moment, 0.0))
    size = dead.coefficients
    deviations = np.sqrt(np.diag(evidence.corrected(dead).posterior.covariance))
    assert dead.shapes == 1 and np.all(np.delete(deviations, size) <= 1.5 * prior.deviation)


def test_a_set_that_leaves_nothing_of_the_effort_has_no_odds() -> None:
    """Inside a dead zone that holds every effort, all motions cost nothing, and any load explains them."""
    evidence, scored = _heard(Joint())
    terms = [*scored.terms, Term(Deadzone(), {"deadzone": 1e3}), Term(LoadDependentFriction())]
    assert evidence.with_unbiased_odds(evidence.score(terms)).log_odds == -np.inf
