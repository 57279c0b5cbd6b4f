"""Worker processes that have their modules before they start."""

import subprocess
import sys

import pytest

SCRIPT = """
import sys
from drake_tc.analysis.sweep import processes
def has(module):
    return module in sys.modules
if __name__ == "__main__":
    with processes(2, preload=("colorsys", "no_such_module")) as pool:
        print(list(pool.map(has, ["colorsys", "drake_tc.analysis.sweep", "sunau"])))
        pool.restart()
        print(pool.submit(has, "colorsys").result())
    with processes(1) as pool:
        print(pool.submit(has, "colorsys").result())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere workers import modules when they use them")
def test_workers_start_with_the_modules_that_the_server_has_imported(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=False)
    assert (done.stderr, done.returncode) == ("", 0)
    assert done.stdout.split("\n")[:3] == ["[True, True, False]", "True", "False"]
