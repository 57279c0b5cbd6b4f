"""The cost of a command counts the processes that outlive it."""

import subprocess
import sys

import pytest

from drake_tc.errors import DrakeTcError
from tests.benchmarks.close_loop_speed import RUNS, command_cost, write_runs

BURN = "import time\nwhile time.process_time() < 0.4: pass"
ORPHAN = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {BURN!r}])"


def measured(code: str) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-m", "tests.benchmarks.process_usage", sys.executable, "-c", code]
    return subprocess.run(call, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a process adopt orphans")
def test_a_process_that_the_command_leaves_behind_counts():
    done = measured(ORPHAN)
    assert done.returncode == 0
    assert '"cpu": 0.0' not in done.stdout and float(done.stdout.split('"cpu": ')[1].split(",")[0]) >= 0.4


def test_the_exit_code_is_that_of_the_command():
    assert measured("raise SystemExit(3)").returncode == 3


def test_a_command_that_fails_is_an_error_with_its_last_line(tmp_path):
    case = write_runs(tmp_path, 0.01)
    assert {path.stem for path in (*case.logs, *case.holdout)} == set(RUNS)
    with pytest.raises(DrakeTcError, match=r"ended with 2: drake-tc: "):
        command_cost(case)
