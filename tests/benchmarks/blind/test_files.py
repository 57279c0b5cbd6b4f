"""What is written can be read by others, is what the owner would know, and no more."""

import ast
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.signal import savgol_filter

import drake_tc.joint_simulator
import tests.benchmarks.blind
from drake_tc.joint_simulator.measurement import coloured_noise
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.spec import RUNS, BlindError, RigSpec, Sensors
from tests.benchmarks.blind.catalogue import PAIRS, SETTINGS, catalogue
from tests.benchmarks.blind.files import rig_yaml, write_rig

from .make import rig


def read(path: Path) -> pd.DataFrame:
    return pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)


def write(spec: RigSpec, out: Path) -> Path:
    return write_rig(simulate([spec] * 3, list(RUNS)), out)


@pytest.mark.parametrize("file_format", ["csv", "csv.gz", "parquet"])
def test_files_load_and_truth_stays_apart(tmp_path: Path, file_format: str) -> None:
    spec = replace(rig(duration=1.0), file_format=file_format, name="rig_001")
    folder = write(spec, tmp_path)
    assert sorted(p.name for p in folder.iterdir()) == ["rig.yaml"] + [
        f"run_{r}.{file_format}" for r in ("multisine", "sine", "static")
    ]
    table = read(folder / f"run_sine.{file_format}")
    columns = ["time", "joint/position", "joint/position_command", "joint/torque", "joint/temperature"]
    assert list(table.columns) == columns
    assert len(table) == 1000
    assert np.isfinite(table.to_numpy()).all()
    truth = np.load(tmp_path / "truth" / "rig_001" / "truth.npz")
    assert truth["sine/unmodelled"].shape == (1000,)
    oracle = json.loads((tmp_path / "truth" / "rig_001" / "truth.json").read_text())["oracle"]
    assert 0.0 < oracle["heldout"] / spec.joint.gain < 0.5


def test_same_seed_same_files(tmp_path: Path) -> None:
    spec = replace(rig(duration=1.0), sensors=Sensors(jitter=0.2, lost=0.02, torque_noise_time=0.01))
    first, second = write(spec, tmp_path / "a"), write(spec, tmp_path / "b")
    for path in first.iterdir():
        assert path.read_bytes() == (second / path.name).read_bytes()


def test_file_of_a_null_rig_fits_the_declared_model_to_the_noise(tmp_path: Path) -> None:
    """Fitted with another smoother (cubic Savitzky-Golay) than the oracle's, K, B, C come back."""
    spec = rig(duration=9.0)
    table = read(write(spec, tmp_path) / "run_multisine.csv")

    def smooth(x: np.ndarray, order: int = 0) -> np.ndarray:
        y = savgol_filter(x, 31, 3) if order == 0 else savgol_filter(smooth(x), 31, 3, deriv=order, delta=1e-3)
        return y if order else savgol_filter(y, 31, 3)

    q = table["joint/position"].to_numpy()
    v, a = smooth(q, 1), smooth(q, 2)
    y = smooth(table["joint/position_command"].to_numpy() - q)
    balance = smooth(table["joint/torque"].to_numpy()) + spec.joint.rotor_inertia * a
    moving = np.abs(v) > 0.3
    design = np.stack([balance, v, np.sign(v)], axis=1)[moving]
    k, kv, kc = np.linalg.lstsq(design, y[moving], rcond=None)[0]
    np.testing.assert_allclose([k, kv / k, kc / k], [1.5e-4, 35.0, 4.0], rtol=0.05)  # 9 s of data
    left = (y[moving] - design @ [k, kv, kc]) / k
    assert np.sqrt(np.mean(left**2)) < 0.3  # white 0.25 N m smoothed, and the smoother's own mismatch


def test_sensors_do_what_they_say(tmp_path: Path) -> None:
    step = 2 * np.pi / 4096
    spec = replace(rig(duration=2.0), sensors=Sensors(rate_hz=200, encoder_step=step, jitter=0.3, lost=0.05))
    table = read(write(spec, tmp_path) / "run_sine.csv")
    counts = table["joint/position"] / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-5)
    assert 300 < len(table) < 400
    assert (np.diff(table["time"]) > 0).all()
    rng = np.random.default_rng(0)
    noise = coloured_noise(np.arange(200_000) * 1e-3, 0.3, 0.02, rng)
    np.testing.assert_allclose(np.std(noise), 0.3, rtol=0.05)
    correlation = np.mean(noise[20:] * noise[:-20]) / np.var(noise)
    np.testing.assert_allclose(correlation, np.exp(-1.0), atol=0.05)
    with pytest.raises(BlindError, match="divisor of 1000"):
        Sensors(rate_hz=300)


def test_rig_file_tells_what_the_owner_knows() -> None:
    known = yaml.safe_load(rig_yaml(rig()))
    assert known == {"joint": "joint", "drive": "position_servo", "declared": {"rotor_inertia": 0.36}}
    unknown = yaml.safe_load(rig_yaml(rig({"rotor_inertia": {"inertia": 0.36}})))
    assert unknown["declared"] == {}
    hung = yaml.safe_load(rig_yaml(replace(rig(), pendulum=(4.0, 0.5))))
    assert hung["load"] == {"pendulum": {"mass": 4.0, "length": 0.5}}


def test_catalogue_is_complete_and_its_names_tell_nothing() -> None:
    specs = catalogue("full", 1)
    count = pd.Series([spec.group for spec in specs]).value_counts()
    assert count["single"] == 9 * len(SETTINGS) and len(SETTINGS) >= 24
    assert count["pair"] == 2 * len(PAIRS) >= 24
    assert count["null"] >= 40 and count["outside"] >= 18
    assert len({spec.name for spec in specs}) == len(specs)
    assert not any(spec.kind in spec.name for spec in specs)
    assert catalogue("full", 1) == specs and catalogue("full", 2) != specs
    assert 25 <= len(catalogue("smoke")) <= 40


def test_generator_imports_nothing_of_what_it_tests() -> None:
    forbidden = ("effects", "diagnosis", "actuation", "identification", "filtering", "report", "cli")
    folders = [Path(module.__file__).parent for module in (tests.benchmarks.blind, drake_tc.joint_simulator)]
    for path in (path for folder in folders for path in folder.glob("*.py") if not path.name.startswith("test_")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
                rest = [name for name in names if not name.startswith("drake_tc.report.figure_")]  # of the scores
                assert not any(name.startswith(f"drake_tc.{part}") for name in rest for part in forbidden), path.name
