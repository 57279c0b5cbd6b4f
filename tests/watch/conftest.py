"""A joint of a bench that was diagnosed, and recordings of it later."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from few_effects import diagnoses_look_for

from drake_tc.actuation.model import ActuatorModel
from drake_tc.cli.demo import DemoLength, demo_model, demo_run, record_demo
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.models import models_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.watch.compare import ComparisonResult, compare

LENGTH = DemoLength(duration=14.0, period=2e-3, step=1e-3)
OWN_EFFECTS = DiagnosisOptions(effects=(effect("stribeck"), effect("deadzone")), assess_residual=False)
"""A search for what the joint has beside its model, and nothing else."""


@dataclass(frozen=True)
class Diagnosed:
    """Files of a joint whose model was made."""

    folder: Path
    rig: Path
    model: Path

    def later(self, seed: int, **scales: float) -> pd.DataFrame:
        """A new recording of the joint, parameters of its effects multiplied."""
        return recorded(seed, tuple(scales.items())).copy()


@cache
def recorded(seed: int, scales: tuple[tuple[str, float], ...]) -> pd.DataFrame:
    model = scaled(demo_model(0), dict(scales))
    run = demo_run(model, "multisine_held_out", 5, LENGTH, np.random.default_rng(seed))
    return pd.DataFrame({"time": run.time, **run.columns})


def scaled(model: ActuatorModel, scales: dict[str, float]) -> ActuatorModel:
    def one(value):
        numbers = {n: v * scales.get(n, 1.0) for n, v in value.parameters.items()}
        return replace(value, parameters=numbers)

    return replace(model, effects=tuple(one(value) for value in model.effects))


@pytest.fixture
def own_effects(monkeypatch) -> None:
    """Commands search with OWN_EFFECTS."""
    diagnoses_look_for(monkeypatch, "stribeck", "deadzone")


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory) -> Diagnosed:
    folder = tmp_path_factory.mktemp("watched")
    rig, logs, holdout = record_demo(folder, 0, LENGTH, jobs=1)
    found = close_loop(rig, logs, holdout, OWN_EFFECTS)
    models_of(found, folder)
    return Diagnosed(folder, rig, folder / "model_after.yaml")


@pytest.fixture(scope="session")
def same(diagnosed, tmp_path_factory) -> ComparisonResult:
    """Of a later recording without a change, with a stored model that lacks what only `close-loop` writes."""
    document = yaml.safe_load(diagnosed.model.read_text(encoding="utf-8"))
    document.pop("provenance")
    bare = tmp_path_factory.mktemp("bare") / "bare.yaml"
    bare.write_text(yaml.safe_dump(document), encoding="utf-8")
    return compare(bare, [diagnosed.later(1)], diagnosed.rig, options=OWN_EFFECTS)


@pytest.fixture(scope="session")
def worn(diagnosed) -> ComparisonResult:
    """Of a later recording with three tenths more Coulomb friction."""
    return compare(diagnosed.model, [diagnosed.later(2, coulomb=1.3)], options=OWN_EFFECTS)


@contextmanager
def the_command_finds(result: ComparisonResult) -> Iterator[None]:
    """Inside, the comparison of the command is this one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("drake_tc.watch.compare.compare", lambda *_: result)
        yield
