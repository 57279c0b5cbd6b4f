"""`python -m tests.benchmarks`: without a name it lists the benchmarks, and a slip is one line."""

import re
import subprocess
import sys
from pathlib import Path

import typer

from tests.benchmarks.__main__ import app, run

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = typer.main.get_command(app).commands


def test_without_a_name_the_benchmarks_are_listed():
    ran = subprocess.run([sys.executable, "-m", "tests.benchmarks"], cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 0 and ran.stderr == ""
    listed = re.findall(r"^  ([a-z-]+)  ", ran.stdout.partition("Commands:")[2], re.M)
    assert listed == list(COMMANDS) and len(listed) >= 20


def test_an_unknown_name_is_one_line(capsys):
    assert run(["nothing"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    assert told.err.startswith("python -m tests.benchmarks: ") and "nothing" in told.err


def test_every_benchmark_takes_a_seed_and_gives_json():
    for name, command in COMMANDS.items():
        assert {"--json", "--seed"} <= {option for p in command.params for option in p.opts}, name
