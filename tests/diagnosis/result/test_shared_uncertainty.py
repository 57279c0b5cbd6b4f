"""Intervals of friction where two causes fit alike: they hold the truth whichever cause is named."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import FOLDS, Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.problem.shared.causes import Cause
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import fit_stacked
from drake_tc.diagnosis.result.shared_uncertainty import with_shared_uncertainty
from drake_tc.diagnosis.result.widening import spanned
from drake_tc.diagnosis.selection.shared import active, substituted
from drake_tc.effects.library import effect

N = 2000
GAIN = Cause("ft_gain", "foot", ("force",), ("-",), slice(0, 1))
MASS = Cause("link_mass", "shank", ("mass",), ("kg",), slice(1, 2))
ERROR = 0.07
FRICTION = (20.0, 15.0)
"""Viscous and Coulomb."""


@dataclass(frozen=True)
class Joint:
    """What of a joint's result the intervals rest on."""

    final: Fit
    final_parameters: Mapping[str, Mapping[str, Estimate]]
    baseline: Fit
    baseline_parameters: Mapping[str, Mapping[str, Estimate]]
    effects: tuple[Any, ...] = ()


def rows_of(seed):
    """A sensor that reads 7 % too much; a mass whose column differs by what the joint's own columns explain."""
    rng = np.random.default_rng(seed)
    time = np.arange(N) * 0.01
    v = np.sin(2.0 * np.pi * 0.31 * time)
    load = 40.0 * np.sin(2.0 * np.pi * 0.17 * time)
    own = np.stack([load + FRICTION[0] * v + FRICTION[1] * np.sign(v), -v, -np.sign(v)], axis=1)
    target = load * (1.0 + ERROR) + 0.3 * rng.standard_normal(N)
    reading = load
    shared = np.stack([reading, reading - own @ np.array([1.0, *FRICTION])], axis=1)
    shared[:, 1] += 0.5 * np.cos(2.0 * np.pi * 0.9 * time)
    block = (np.arange(N) // 50).astype(np.int64)
    every = np.column_stack([own, shared, target])
    fold = (block // 2) % FOLDS
    grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
    samples = SimpleNamespace(run=np.zeros(N, dtype=np.int64))
    return [JointRows("knee", samples, own, shared, target, block, grams, np.zeros(2, dtype=bool))]


def joint(rows, fitted):
    """The joint's own fit beside these causes, with intervals of one percent."""
    terms = (Term(effect("viscous")), Term(effect("coulomb")))
    final = Fit(terms, fitted.beta[0], rows[0].target, 1.0, 1.0, np.zeros(1))
    named = {
        key: {name: Estimate(x, "N*m", (0.99 * x, 1.01 * x), False) for name, x in group.items()}
        for key, group in physical_parameters(final).items()
    }
    return Joint(final, named, final, named)


@pytest.mark.parametrize(("named", "other"), [(MASS, GAIN), (GAIN, MASS)])
def test_the_interval_of_friction_spans_what_an_indistinguishable_cause_makes_of_it(named, other):
    rows = rows_of(0)
    nothing = np.zeros(1), np.array([1e-6])
    none = fit_stacked(rows, nothing[0].astype(np.int64), nothing[1])
    chosen, alternative = (fit_stacked(rows, *active((GAIN, MASS), (cause,))) for cause in (named, other))
    result = joint(rows, chosen)
    narrow = with_shared_uncertainty({"knee": result}, (rows, none), (rows, chosen))["knee"].final_parameters
    wide = with_shared_uncertainty({"knee": result}, (rows, none), (rows, chosen), [alternative])["knee"]
    for k, key in enumerate(("viscous", "coulomb")):
        estimate = wide.final_parameters[key][key]
        low, high = estimate.ci95
        assert low <= FRICTION[k] <= high
        assert estimate.value == result.final_parameters[key][key].value
        far = narrow[key][key].ci95
        assert low <= far[0] < far[1] <= high
        assert (far[0] <= FRICTION[k] <= far[1]) == (named is GAIN)


def test_an_alternative_takes_the_place_of_its_own_cause_alone():
    bias = Cause("ft_bias", "foot", ("force_x",), ("N",), slice(2, 3))
    assert substituted((MASS, bias), ((GAIN,), ())) == [(GAIN, bias)]
    assert substituted((MASS, bias), ((bias,), ())) == []


def test_the_interval_of_a_parameter_spans_those_of_all_models():
    one = Estimate(1.0, "N*m", (0.9, 1.1), False)
    models = [{"a": {"x": one}}, {"a": {"x": replace(one, value=2.0, ci95=(1.8, 2.3))}}]
    spanning = spanned(models)["a"]["x"]
    assert spanning.value == 1.0
    # mean 1.5; variances (0.1^2 + 0.25^2)/2 of the half widths and 0.5^2 of the estimates
    half = np.sqrt((0.1**2 + 0.25**2) / 2.0 + (1.959964 * 0.5) ** 2)
    assert_allclose(spanning.ci95, (min(0.9, 1.5 - half), max(2.3, 1.5 + half)), rtol=1e-6)
    assert spanned(models[:1]) == models[0]


def test_a_model_far_from_the_others_is_in_the_interval():
    one = Estimate(1.0, "N*m", (0.9, 1.1), False)
    models = [{"a": {"x": one}}] * 9 + [{"a": {"x": replace(one, value=2.0, ci95=(1.9, 2.1))}}]
    assert spanned(models)["a"]["x"].ci95[1] == 2.1
