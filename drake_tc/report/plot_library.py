"""The script of the plotting library uPlot, as the package `uplot-python` ships it, to be written into a page.

uPlot (Leon Sorokin, MIT licence, 120 kB) draws time series on a canvas. The licence lets it be part of generated files
as long as its notice stays, which stands at the top of the script.
"""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from drake_tc.errors import DrakeTcError

PACKAGE = "uplot-python"
SCRIPT, STYLE = "uplot/static/uPlot.iife.js", "uplot/static/uPlot.min.css"


def plot_script() -> str:
    """The library's script without comments and indentation, its notice kept; it defines `uPlot`, fetches nothing.

    Raises:
        DrakeTcError: the package is not installed.
    """
    lines = (line.strip() for line in _text(SCRIPT).splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//")).replace("</script", "<\\/script")


def plot_style() -> str:
    """The library's style sheet.

    Raises:
        DrakeTcError: the package is not installed.
    """
    return _text(STYLE)


def _text(name: str) -> str:
    """A file of the package; read without importing it, as its import loads IPython."""
    try:
        path = Path(str(distribution(PACKAGE).locate_file(name)))
    except PackageNotFoundError:
        raise DrakeTcError(f"the report needs the package {PACKAGE}: pip install {PACKAGE}") from None
    return path.read_text(encoding="utf-8")
