"""Solvers by name; only the default's package comes with drake_tc.

Each package is called directly: through `qpsolvers` the same solve takes 1.25 to 1.4 times as long, as two-sided rows
are written twice and converted at every tick (`tests/tsid/test_qpsolvers.py` measures it).
"""

from importlib import import_module

from drake_tc.errors import ParamsError
from drake_tc.system_libraries import how_to_install, missing_library
from drake_tc.tsid.qp.problem import QpSolver

DEFAULT = "daqp"
SOLVERS = {
    "daqp": ("drake_tc.tsid.qp.daqp", "Daqp"),
    "quadprog": ("drake_tc.tsid.qp.quadprog", "Quadprog"),
}
"""Module and class of each solver from PyPI."""
PROGRAM = "program"
"""The whole tick as one MathematicalProgram of Drake (`drake_tc.tsid.program_solver`): slow, and independent."""
OF_DRAKE = ("clarabel", "osqp", "scs", "gurobi", "mosek")


class SolverUnavailableError(ParamsError):
    """A solver whose package, or a shared library that the package loads, is not installed."""


def solver(name: str = DEFAULT) -> QpSolver:
    """A solver.

    Args:
        name: One of SOLVERS or OF_DRAKE, or PROGRAM.

    Raises:
        ParamsError: an unknown name, or a solver of Drake without a licence.
        SolverUnavailableError: its package, or a shared library that the package loads, is not installed.
    """
    if name in OF_DRAKE:
        from drake_tc.tsid.qp.drake import DrakeSolver

        return DrakeSolver(name)
    if name == PROGRAM:
        made: QpSolver = import_module("drake_tc.tsid.program_solver").ProgramSolver()
        return made
    if name not in SOLVERS:
        raise ParamsError(f"solver: expected one of {', '.join((*SOLVERS, *OF_DRAKE, PROGRAM))}, got {name!r}")
    module, kind = SOLVERS[name]
    try:
        found = import_module(module)
    except ImportError as error:
        library = missing_library(error)
        reason = how_to_install(library) if library else f"{error}; pip install 'drake-tc[solvers]'"
        raise SolverUnavailableError(f"solver {name!r} is not available: {reason}; or take {DEFAULT!r}") from None
    chosen: QpSolver = getattr(found, kind)()
    return chosen


def unavailable(name: str) -> str | None:
    """Why a solver cannot be used here; None if it can."""
    try:
        solver(name)
    except SolverUnavailableError as error:
        return str(error)
    return None
