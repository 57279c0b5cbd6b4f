"""A newcomer's path: the README's commands alone, in an empty environment made from the wheel, to a report."""

import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LONGEST = 180.0
"""From the installed packages to the report of one's own log: processor time of all processes [s], about the wall time
of an idle machine or more; downloads are not counted."""
RIG = re.search(r"```yaml\n(.*?)```", README, re.S)[1]
AS_RECORDED = """
import numpy as np, pandas as pd, sys
names = {"postures_with_pushes": "postures", "growing_sinusoid": "sinusoid", "multisine_held_out": "multisine"}
for name, out in names.items():
    log = pd.read_parquet(f"out/demo/demo_logs/{name}.parquet")
    joint = "simulated_knee"
    degrees = {"q_meas": f"{joint}/position", "q_ref": f"{joint}/position_command"}
    table = {"t": 1e3 * log["time"], **{short: np.rad2deg(log[long]) for short, long in degrees.items()}}
    pd.DataFrame({**table, "ft_torque": log[f"{joint}/torque"]}).to_csv(f"{out}.csv", index=False)
"""
"""The demo's logs with the columns and units of the README's rig file: a newcomer has such logs already."""


def readme_command(*words: str) -> list[str]:
    """The indented `drake-tc` command of the README that begins with these words."""
    (line,) = [line for line in README.splitlines() if line.startswith("    " + " ".join(("drake-tc", *words)))]
    return shlex.split(line)


class Newcomer:
    """An empty folder with an environment of its own, and the processor time of its commands [s]."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.seconds = folder, {}
        self._bin = folder / "venv" / "bin"
        self._environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}

    def does(self, what: str, *command: str) -> str:
        """Run a command; `drake-tc` and `python` are those of the environment."""
        program = self._bin / command[0]
        words = [str(program) if program.exists() else command[0], *command[1:]]
        begin = _children_seconds()
        ran = subprocess.run(words, cwd=self.folder, env=self._environment, capture_output=True, text=True, check=False)
        self.seconds[what] = _children_seconds() - begin
        assert ran.returncode == 0, ran.stdout + ran.stderr
        return ran.stdout


def _children_seconds() -> float:
    """Processor time of processes that ended [s]: the clock on the wall also counts what else the machine does."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.fixture(scope="module")
def newcomer(tmp_path_factory) -> Newcomer:
    """The package is installed from its wheel, everything else from the package index."""
    made = Newcomer(tmp_path_factory.mktemp("newcomer"))
    sources = made.folder / "sources"  # a copy: what an older build left in build/ would go into the wheel
    sources.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    for name in ("drake_tc", "diagrams", "models"):
        shutil.copytree(ROOT / name, sources / name, ignore=shutil.ignore_patterns("__pycache__"))
    dist = str(made.folder / "dist")
    made.does("build", sys.executable, "-m", "build", "--quiet", "--wheel", "--outdir", dist, str(sources))
    made.does("environment", sys.executable, "-m", "venv", "venv")
    (wheel,) = (made.folder / "dist").glob("*.whl")
    made.does("download and install", "python", "-m", "pip", "install", "--quiet", str(wheel))
    return made


@pytest.mark.slow
def test_the_commands_of_the_readme_lead_to_a_report_within_three_minutes(newcomer):
    assert "make demo" in README
    newcomer.does("demo", "drake-tc", "demo", "--out", "out/demo")  # what `make demo` runs
    newcomer.does("logs", "python", "-c", AS_RECORDED)
    (newcomer.folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    newcomer.does("own log", *readme_command("close-loop", "--rig"))
    report = json.loads((newcomer.folder / "out" / "knee" / "report.json").read_text("utf-8"))
    assert report["verdict"] == "effects_found"
    assert {effect["id"] for effect in report["joints"]["knee"]["effects"]} >= {"deadzone", "stribeck"}
    assert (newcomer.folder / "out" / "knee" / "report.html").stat().st_size > 100_000
    print({what: round(seconds, 1) for what, seconds in newcomer.seconds.items()})
    assert newcomer.seconds["demo"] + newcomer.seconds["own log"] <= LONGEST
