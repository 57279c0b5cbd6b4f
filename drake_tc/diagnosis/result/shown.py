"""How a result shows itself in a Python shell and in a notebook.

`drake_tc.report` renders results, and stands above them: it is imported when a person looks at one, and not before.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def text_of(found: object) -> str:
    """What was found, as the command prints it."""
    return str(_render("summary", "result_text", found))


def html_of(found: object) -> str:
    """The same as an HTML fragment, with the residual of each joint."""
    return str(_render("summary", "result_html", found))


def residual_plot(joint: object) -> "Figure":
    """The residual of a joint over time."""
    figure: Figure = _render("time_plots", "residual_figure", joint)
    return figure


def _render(module: str, name: str, found: object) -> Any:
    return getattr(import_module(f"drake_tc.report.{module}"), name)(found)
