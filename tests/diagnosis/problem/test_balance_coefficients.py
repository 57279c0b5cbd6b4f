"""Viscous and Coulomb friction are found by effect: nothing depends on the order in which terms are declared."""

from itertools import permutations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.residual.structure import FEATURES, features
from drake_tc.effects.library import effect

from ..rigs import Joint, problem

JOINT = Joint(torque_noise=0.05, encoder_noise=1e-3)
TERMS = tuple(Term(effect(name)) for name in ("viscous", "coulomb", "rotor_inertia"))
ORDERS = list(permutations(TERMS))


@pytest.fixture(scope="module")
def columns() -> Columns:
    return problem(JOINT).columns


@pytest.fixture(scope="module", params=ORDERS, ids=lambda terms: "-".join(t.effect.id for t in terms))
def fitted(columns: Columns, request: pytest.FixtureRequest) -> Fit:
    return fit(columns, request.param)


def test_coefficients_are_those_of_their_effects(columns: Columns, fitted: Fit) -> None:
    by_effect = {term.effect.id: float(theta[0]) for term, theta in coefficients_by_term(fitted.terms, fitted.beta)}
    found = BalanceCoefficients.of(fitted.terms, fitted.beta, 0.3)
    assert_allclose([found.viscous, found.coulomb], [6.0, 3.0], rtol=0.05)  # of the simulated joint
    assert (found.viscous, found.coulomb) == (by_effect["viscous"], by_effect["coulomb"])
    assert found.inertia == effect("rotor_inertia").balance_inertia(np.array([by_effect["rotor_inertia"]]), {}, 0.3)
    assert found.stiffness == fitted.beta[0]


def test_absent_friction_is_zero() -> None:
    assert BalanceCoefficients.of(TERMS[2:], np.array([12.5, 0.1])) == BalanceCoefficients(12.5, 0.0, 0.0, 0.1)


def test_noise_floor_error_and_features_do_not_depend_on_the_order(columns: Columns, fitted: Fit) -> None:
    first = fit(columns, TERMS)
    assert_allclose(noise_floor(columns, fitted), noise_floor(columns, first), rtol=1e-6)
    assert_allclose(fitted.cv_rms, first.cv_rms, rtol=1e-6)
    known = [columns.with_model(f.terms, f.beta, servo=True).samples.signals for f in (fitted, first)]
    assert_allclose(known[0].viscous, known[1].viscous, rtol=1e-6)
    assert_allclose(known[0].stiffness, known[1].stiffness, rtol=1e-6)
    tables = [
        features(columns.samples, BalanceCoefficients.of(f.terms, f.beta), servo=False, load_measured=True)
        for f in (fitted, first)
    ]
    expected = FEATURES.index("expected_torque")
    assert_allclose(tables[0][:, expected], tables[1][:, expected], atol=1e-6)
