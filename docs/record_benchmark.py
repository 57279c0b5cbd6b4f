"""Run benchmarks of docs/benchmarks/commands.yaml and store what they print, with commit, date and machine.

usage: record_benchmark.py NAME [NAME ...]
"""

import json
import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
STORE = ROOT / "docs" / "benchmarks"


def record(name: str, known: dict[str, dict[str, str]]) -> Path:
    """Run one benchmark and write its file.

    Args:
        name: A key of commands.yaml.
        known: What commands.yaml says.

    Raises:
        SystemExit: no such name, uncommitted changes in the package, or a command that failed.
    """
    if name not in known:
        sys.exit(f"no benchmark {name!r}; benchmarks: {', '.join(known)}")
    if _git("status", "--porcelain", "--", "drake_tc", "diagrams", "models", "tests/benchmarks"):
        sys.exit("the package has uncommitted changes: commit them first, so that the result belongs to a commit")
    arguments = os.path.expandvars(known[name]["command"]).split()[1:]
    ran = subprocess.run([sys.executable, *arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if ran.returncode:
        sys.exit(f"{known[name]['command']}: ended with exit code {ran.returncode}")
    path = STORE / f"{name}.json"
    path.write_text(json.dumps(_document(known[name], json.loads(ran.stdout)), indent=1) + "\n", encoding="utf-8")
    return path


def _document(said: dict[str, str], result: dict[str, Any]) -> dict[str, Any]:
    machine = {"CPUs": os.cpu_count(), "Python": platform.python_version(), "Drake": version("drake")}
    kept = {"name": result.get("name"), "rows": result["rows"]}
    now = datetime.now(UTC).date().isoformat()
    return {**said, "commit": _git("rev-parse", "HEAD"), "date": now, "machine": machine, "result": kept}


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    commands = yaml.safe_load((STORE / "commands.yaml").read_text(encoding="utf-8"))
    for each in sys.argv[1:]:
        print(record(each, commands))
