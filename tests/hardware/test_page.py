"""The page about drivers: its file runs as it stands, as a script and under the command."""

import json
import re
import runpy
from pathlib import Path

import drake_tc
from drake_tc.cli.main import run

ROOT = Path(drake_tc.__file__).parents[1]


def test_the_driver_of_the_page_runs(tmp_path, monkeypatch, capsys):
    text = (ROOT / "docs" / "your_own_driver.md").read_text("utf-8")
    name, code = re.search(r"File `([^`]+)`:\n\n```python\n(.*?)```", text, flags=re.DOTALL).groups()
    (tmp_path / name).write_text(code, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    runpy.run_path(name, run_name="__main__")
    assert "Counts(ticks=" in capsys.readouterr().out
    robot = ["run", "my_robot:controller", "--robot", "my_robot:Driver", "--duration", "0.5", "--json"]
    assert run(robot) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ended"] == "duration"
    assert told["counts"]["controller_errors"] == told["counts"]["link_errors"] == 0
    assert len([line for line in code.splitlines() if line.strip() and not line.strip().startswith("#")]) <= 40
