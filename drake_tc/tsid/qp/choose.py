"""Solvers by name; only the default's package comes with drake_tc."""

from importlib import import_module

from drake_tc.errors import ParamsError
from drake_tc.tsid.qp.problem import QpSolver

DEFAULT = "daqp"
SOLVERS = {
    "daqp": ("drake_tc.tsid.qp.daqp", "Daqp"),
    "quadprog": ("drake_tc.tsid.qp.quadprog", "Quadprog"),
    "proxqp": ("drake_tc.tsid.qp.proxqp", "ProxQp"),
    "piqp": ("drake_tc.tsid.qp.piqp", "Piqp"),
}
"""Module and class of each solver from PyPI."""
OF_DRAKE = ("clarabel", "osqp", "scs", "gurobi", "mosek")


def solver(name: str = DEFAULT) -> QpSolver:
    """A solver.

    Args:
        name: One of SOLVERS or OF_DRAKE.

    Raises:
        ParamsError: an unknown name, or one whose package or licence is not there.
    """
    if name in OF_DRAKE:
        from drake_tc.tsid.qp.drake import DrakeSolver

        return DrakeSolver(name)
    if name not in SOLVERS:
        raise ParamsError(f"solver: wanted one of {', '.join((*SOLVERS, *OF_DRAKE))}; got {name!r}")
    module, made = SOLVERS[name]
    try:
        found = import_module(module)
    except ImportError as error:
        raise ParamsError(
            f"solver {name!r}: its package is not here ({error}); pip install 'drake-tc[solvers]', or take {DEFAULT!r}"
        ) from None
    chosen: QpSolver = getattr(found, made)()
    return chosen
