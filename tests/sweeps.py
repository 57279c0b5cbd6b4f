"""Sweeps of which the fast tests run a few cases, those that differ in kind."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow_but(cases: Iterable[Any], *fast: Any) -> list[Any]:
    """All cases as parameters of a test, a tuple being several; those that are not among `fast` are slow."""
    cases = list(cases)
    assert set(fast) <= set(cases), f"expected cases of the sweep, got {set(fast) - set(cases)}"
    values = {case: case if isinstance(case, tuple) else (case,) for case in cases}
    return [pytest.param(*values[case], marks=() if case in fast else pytest.mark.slow) for case in cases]
