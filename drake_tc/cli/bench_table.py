"""How `drake-tc bench` prints its figures."""

import json
import sys
from collections.abc import Sequence

from rich.console import Console

from drake_tc.report.figure_row import FigureRow, rows_json
from drake_tc.report.figure_table import figure_table


def print_rows(name: str, rows: Sequence[FigureRow], *, as_json: bool) -> None:
    """Figures on stdout, as a table for people or as one JSON document."""
    if as_json:
        print(json.dumps(rows_json(name, rows)))
    else:
        Console(file=sys.stdout, highlight=False).print(figure_table(rows))
