"""The page about drivers: its file runs as it stands, as a script and under the command."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import drake_tc

ROOT = Path(drake_tc.__file__).parents[1]


def ran(folder, *arguments):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), str(ROOT)))}
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, env=environment, cwd=folder, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_driver_of_the_page_runs(tmp_path):
    text = (ROOT / "docs" / "your_own_driver.md").read_text("utf-8")
    name, code = re.search(r"File `([^`]+)`:\n\n```python\n(.*?)```", text, flags=re.DOTALL).groups()
    (tmp_path / name).write_text(code, encoding="utf-8")
    assert "Counts(ticks=" in ran(tmp_path, name)
    command = ("-c", "from drake_tc.cli.entry import main; main()")
    robot = ("run", "my_robot:controller", "--robot", "my_robot:Driver", "--duration", "0.5", "--json")
    told = json.loads(ran(tmp_path, *command, *robot))
    assert told["ended"] == "duration"
    assert told["counts"]["controller_errors"] == told["counts"]["link_errors"] == 0
    assert len([line for line in code.splitlines() if line.strip() and not line.strip().startswith("#")]) <= 40
