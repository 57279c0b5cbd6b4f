"""`bench close-loop`: time and memory of the whole command `drake-tc close-loop` on simulated logs of one joint."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.errors import DrakeTcError
from tests.benchmarks.figures import BenchmarkRow

RUNS = ("one", "two", "held")
"""Two runs to fit and one that is held out."""
RIG = "joint: joint\ndrive: current\ndeclared: {rotor_inertia: 0.3}\n"
RIG_OF_SEVERAL = "joints: [{}]\ndrive: current\ndeclared: {{rotor_inertia: 0.3}}\n"
COMMAND = "from drake_tc.cli.entry import main; main()"


@dataclass(frozen=True)
class SpeedCase:
    """Logs of one joint: their name in the table, the rig file, the runs to fit and those held out."""

    name: str
    rig: Path
    logs: tuple[Path, ...]
    holdout: tuple[Path, ...]


@dataclass(frozen=True)
class Cost:
    """What a command costs.

    Attributes:
        wall: Time from start to end [s].
        cpu: User and system time of all its processes [s]; hardly depends on what else the machine does.
        memory: Peak resident memory of its largest process [GiB].
    """

    wall: float
    cpu: float
    memory: float


def write_runs(folder: Path, seconds: float, rate: float = 1000.0, joints: int = 1) -> SpeedCase:
    """Three Parquet runs and the rig file of joints that lack quadratic friction, by inverse dynamics.

    Args:
        folder: Where to write.
        seconds: Length of each run [s].
        rate: Of the samples [Hz].
        joints: How many, each with motions and noise of its own.
    """
    rng = np.random.default_rng(0)
    names = ["joint"] if joints == 1 else [f"joint_{number}" for number in range(1, joints + 1)]
    for k, name in enumerate(RUNS):
        t = np.arange(round(seconds * rate)) / rate
        table = {"time": t}
        for number, joint in enumerate(names):
            q, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
            for hertz, size in ((0.13, 0.5), (0.41, 0.35), (0.83, 0.15)):
                w = 2 * np.pi * hertz
                phase = w * t + k + hertz + number
                q, v, a = q + size * np.sin(phase), v + size * w * np.cos(phase), a - size * w**2 * np.sin(phase)
            tau = 8.0 * np.sin(q) + 0.3 * a + 4.0 * np.sin(1.8 * t + k + number)
            current = 0.08 * (tau + 0.3 * a + 6.0 * v + 3.0 * np.sign(v) + 1.2 * v * np.abs(v))
            torque = tau + 0.25 * rng.standard_normal(t.size)
            table |= {f"{joint}/position": q, f"{joint}/current": current, f"{joint}/torque": torque}
        pd.DataFrame(table).to_parquet(folder / f"{name}.parquet", index=False)
    rig = folder / "rig.yaml"
    rig.write_text(RIG if joints == 1 else RIG_OF_SEVERAL.format(", ".join(names)), encoding="utf-8")
    one, two, held = (folder / f"{name}.parquet" for name in RUNS)
    samples = len(RUNS) * round(seconds * rate)
    what = f"{samples:_} samples, one effect" if joints == 1 else f"{joints} joints, {samples:_} samples each"
    return SpeedCase(what.replace("_", " "), rig, (one, two), (held,))


def command_cost(case: SpeedCase) -> Cost:
    """Run `drake-tc close-loop` on a case, in a process of its own, report and free runs included.

    Raises:
        DrakeTcError: the command failed.
    """
    with tempfile.TemporaryDirectory() as out:
        arguments = ["close-loop", "--rig", str(case.rig), "--out", out]
        for option, files in (("--log", case.logs), ("--holdout", case.holdout)):
            arguments += [word for file in files for word in (option, str(file))]
        command = [sys.executable, "-c", COMMAND, *arguments]
        measured = [sys.executable, "-m", "tests.benchmarks.process_usage", *command]
        done = subprocess.run(measured, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise DrakeTcError(f"{case.name}: `drake-tc close-loop` ended with {done.returncode}: {reason}")
    return Cost(**json.loads(done.stdout))


def cost_rows(cases: Sequence[SpeedCase]) -> list[BenchmarkRow]:
    """Three rows a case: wall time, CPU time, and peak memory."""
    rows = []
    for case in cases:
        cost = command_cost(case)
        for name, unit, value in (
            ("wall time", "s", cost.wall),
            ("CPU time of all processes", "s", cost.cpu),
            ("peak memory of the largest process", "GiB", cost.memory),
        ):
            rows.append(BenchmarkRow(f"{case.name}: {name}", value, unit))
    return rows
