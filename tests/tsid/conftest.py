"""Tests of a named solver are skipped where it is not installed, and say what it lacks."""

import pytest

from tests.benchmarks.qp_solvers import SOLVERS, unavailable


@pytest.fixture(autouse=True)
def _solver_is_installed(request):
    parameters = request.node.callspec.params if hasattr(request.node, "callspec") else {}
    if parameters.get("name") in SOLVERS and (why := unavailable(parameters["name"])) is not None:
        pytest.skip(why)
