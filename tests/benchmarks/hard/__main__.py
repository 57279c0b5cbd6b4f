"""`python -m tests.benchmarks.hard`: the score of a seed, as tables or as JSON."""

import argparse
import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from drake_tc.errors import DrakeTcError
from tests.benchmarks.hard import score
from tests.benchmarks.hard.run import close_loop_on, hard_benchmark


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.hard", description=__doc__)
    parser.add_argument("--seed", type=int, required=True, help="seed of the draw")
    parser.add_argument("--count", type=int, default=100, help="number of rigs")
    parser.add_argument("--folder", type=Path, required=True, help="where rigs, truth and reports are written")
    parser.add_argument("--only", action="append", default=[], help="draw and diagnose this rig alone; repeatable")
    parser.add_argument("--processes", type=int, default=2, help="worker processes")
    parser.add_argument("--score", action="store_true", help="only score the reports that are there")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    given = parser.parse_args()
    if given.score:
        results = score.outcomes(given.folder)
    else:
        try:
            context = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(given.processes, mp_context=context) as pool:
                results = hard_benchmark(given.folder, given.seed, given.count, pool, close_loop_on, given.only)
        except (ValueError, DrakeTcError) as error:
            parser.error(str(error))
    if given.json:
        counts = [asdict(row) | {"share": row.share} for row in (*score.rows(results), *score.by_cause(results))]
        print(json.dumps({"name": "hard", "rows": counts, "rigs": [asdict(r) for r in results]}, indent=1))
        return
    console = Console(width=180)
    for shown in (score.rig_table(results), score.cause_table(results), score.table(results)):
        console.print(shown)


if __name__ == "__main__":
    main()
