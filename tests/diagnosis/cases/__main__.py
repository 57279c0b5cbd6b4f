"""`python -m tests.diagnosis.cases [--only PATTERN] [--json]` prints found, verdict, right or wrong.

Seconds are those of the processor. A failing case does not end the table; the last line counts.
"""

import argparse
import json
import os
import re
import sys
import time
import traceback
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # fitted_arm and robot_files, as for the tests

from .case import Answer, Case, Outcome, run_case
from .table import CASES


def outcome_of(case: Case, seed: int) -> Outcome:
    """The outcome; a crash is a wrong answer."""
    begin = time.process_time()
    with TemporaryDirectory() as folder:
        try:
            return run_case(case, seed, Path(folder))
        except Exception as crash:
            where = traceback.extract_tb(crash.__traceback__)[-1]
            told = f"crash: {type(crash).__name__}: {crash} ({Path(where.filename).name}:{where.lineno})"
            return Outcome(f"{case.name}[{seed}]", Answer(), [told], time.process_time() - begin)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.diagnosis.cases", description=__doc__)
    parser.add_argument("--only", default="", help="regular expression that the name of a case must contain")
    parser.add_argument("--json", action="store_true", help="one JSON document a line")
    parser.add_argument("--list", action="store_true", help="print the names of the cases alone")
    given = parser.parse_args()
    chosen = [(case, seed) for case in CASES for seed in case.seeds if re.search(given.only, f"{case.name}[{seed}]")]
    right = 0
    for case, seed in chosen:
        if given.list:
            print(f"{case.name}[{seed}]")
            continue
        outcome = outcome_of(case, seed)
        right += outcome.is_right
        if given.json:
            row = {"case": outcome.case, "right": outcome.is_right, "problems": list(outcome.problems)}
            told = {
                "found": sorted(outcome.answer.found),
                "verdict": outcome.answer.verdict,
                "answer": str(outcome.answer),
            }
            print(json.dumps(row | told | {"seconds": round(outcome.seconds, 2)}), flush=True)
            continue
        print(f"{'right' if outcome.is_right else 'WRONG'} {outcome.seconds:6.1f} s  {outcome.case}", flush=True)
        print(f"      {outcome.answer}")
        for problem in outcome.problems:
            print(f"      - {problem}")
    if not given.list and not given.json:
        print(f"{right} of {len(chosen)} right")


if __name__ == "__main__":
    main()
