"""Refinement of shapes: a search that ends on a bound begins anew, and bounds that are the best are kept."""

import numpy as np
import pytest

from drake_tc.diagnosis.selection.shapes import refine_values
from drake_tc.effects.library import effect

SHAPES = effect("stribeck").shapes
SPEED = np.linspace(0.01, 1.2, 200)


def peak(velocity: float, exponent: float):
    return np.exp(-((SPEED / velocity) ** exponent))


def refined(truth: tuple[float, float], start: tuple[float, float]) -> tuple[tuple[float, ...], int]:
    """Shapes of the least error of a constant, a slope and a peak against a peak alone, and how often it was asked."""
    asked = []

    def cost(values):
        columns = np.column_stack([np.ones_like(SPEED), SPEED, peak(*values)])
        left = peak(*truth) - columns @ np.linalg.lstsq(columns, peak(*truth), rcond=None)[0]
        asked.append((float(np.log(np.sqrt(np.mean(left**2)) + 1e-5)), tuple(map(float, values))))
        return asked[-1][0]

    refine_values(SHAPES, np.array(start), cost, evaluations=60)
    return min(asked)[1], len(asked)


@pytest.mark.parametrize(
    ("truth", "start"),
    [
        ((0.12, 1.6), (0.6, 2.0)),
        ((0.12, 1.6), (1.0, 1.0)),
        ((0.2, 0.8), (0.03, 1.0)),
        ((0.2, 0.8), (1.0, 1.0)),
        ((0.3, 1.9), (0.1, 0.5)),
    ],
)
def test_a_search_that_meets_a_bound_on_its_way_comes_back(truth, start):
    found, _ = refined(truth, start)
    assert found == pytest.approx(truth, rel=1e-3)


@pytest.mark.parametrize("exponent", [0.5, 2.0])
def test_a_bound_that_is_the_best_is_kept_at_little_cost(exponent):
    found, asked = refined((0.2, exponent), (0.1, 1.0))
    assert found == pytest.approx((0.2, exponent), rel=1e-3)
    assert asked < 400
