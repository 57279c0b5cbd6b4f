"""A short recording of the demo's rig, and a way to call commands."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from few_effects import diagnoses_look_for, experiments_fit

from drake_tc.cli.demo import DemoLength, record_demo
from drake_tc.cli.main import run
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.experiments.check import effects
from drake_tc.experiments.design import known
from drake_tc.experiments.fitted import FittedJoint, fitted_joint

SHORT = DemoLength(duration=6.0, period=4e-3, step=5e-4)


@dataclass(frozen=True)
class Bench:
    """Files of a rig: training runs and a held-out run."""

    rig: Path
    logs: tuple[Path, ...]
    holdout: Path

    def arguments(self) -> list[str]:
        return ["--rig", str(self.rig), *(a for p in self.logs for a in ("--log", str(p)))]

    def close_loop(self, out: Path) -> list[str]:
        return ["close-loop", *self.arguments(), "--holdout", str(self.holdout), "--out", str(out)]


@dataclass(frozen=True)
class Outcome:
    """Exit code and both streams of one command."""

    code: int
    out: str
    err: str

    def refusal(self) -> str:
        """The one line on stderr of a command that could not use its input."""
        last = self.err.strip().splitlines()[-1]
        assert self.code == 2
        assert self.out == ""
        assert self.err.count("drake-tc: ") == 1 and last.startswith("drake-tc: ")
        assert "Traceback" not in self.err
        return last


@pytest.fixture(scope="session")
def bench(tmp_path_factory) -> Bench:
    rig, logs, holdout = record_demo(tmp_path_factory.mktemp("bench"), 0, SHORT, jobs=1)
    return Bench(rig, tuple(logs), holdout[0])


@pytest.fixture(scope="session")
def short_log(bench, tmp_path_factory) -> Path:
    """The last 3 s of a run."""
    log = tmp_path_factory.mktemp("short") / "run.parquet"
    pd.read_parquet(bench.logs[1]).iloc[-750:].to_parquet(log, index=False)
    return log


@pytest.fixture
def fits_nothing(monkeypatch) -> None:
    """`check`, `design` and `rehearse` fit the declared model alone, and judge all effects beside it."""
    experiments_fit(monkeypatch)


@pytest.fixture(scope="session")
def fits() -> dict[bytes, FittedJoint]:
    """Fits of a joint by the efforts and loads of its runs."""
    return {}


@pytest.fixture
def fitted_once(fits, monkeypatch) -> None:
    """`design`, `check` and `rehearse` search the same runs once, and only for what the bench has beside its model."""

    def fitted(prepared: Prepared, *rest: object, **keys: object) -> FittedJoint:
        signals = prepared.train.samples.signals
        runs = signals.effort.tobytes() + signals.load_torque.tobytes()
        return fits[runs] if runs in fits else fits.setdefault(runs, fitted_joint(prepared, *rest, **keys))

    experiments_fit(monkeypatch, "stribeck", "deadzone")
    monkeypatch.setattr(known, "fitted_joint", fitted)
    monkeypatch.setattr(effects, "fitted_joint", fitted)


@pytest.fixture
def look_for(monkeypatch) -> Callable[..., None]:
    """look_for(*keys): from here on a diagnosis tries these effects alone."""
    return partial(diagnoses_look_for, monkeypatch)


@pytest.fixture
def invoke(capsys) -> Callable[..., Outcome]:
    def call(*arguments: object) -> Outcome:
        code = run([str(a) for a in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call
