"""How `drake-tc bench` prints times."""

import json
import sys
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from drake_tc.report.bench_row import BenchRow


def print_times(name: str, rows: Sequence[BenchRow], *, as_json: bool) -> None:
    """Rows of times [us] and of ratios on stdout, as a table for people or as one JSON document."""
    if as_json:
        print(json.dumps({"name": name, "rows": [row.to_json() for row in rows]}))
        return
    table = Table(box=None, padding=(0, 2))
    table.add_column("what")
    for heading in ("median us", "99 % us", "n"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        digits = 0 if row.unit == "us" else 2
        table.add_row(row.name, f"{row.median:.{digits}f}", f"{row.p99:.{digits}f}", str(row.n))
    Console(file=sys.stdout, highlight=False).print(table)
