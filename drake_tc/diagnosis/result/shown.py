"""How a result shows itself in a Python shell and in a notebook.

`drake_tc.report` renders results, and stands above them: it is imported when a person looks at one, and not before.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Shown:
    """A result: its `repr` is what the command prints, and a notebook shows the residual of each joint too."""

    def __repr__(self) -> str:
        return str(_render("summary", "result_text", self))

    def _repr_html_(self) -> str:
        return str(_render("summary", "result_html", self))


def residual_plot(joint: object) -> "Figure":
    """The residual of a joint over time."""
    figure: Figure = _render("time_plots", "residual_figure", joint)
    return figure


def _render(module: str, name: str, found: object) -> Any:
    return getattr(import_module(f"drake_tc.report.{module}"), name)(found)
