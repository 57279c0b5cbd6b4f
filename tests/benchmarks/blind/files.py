"""Writes a rig as its owner would hand it over, and its truth in a folder apart.

OUT/rigs/NAME/rig.yaml, run_static.csv, run_sine.csv, run_multisine.csv       (or .csv.gz, .parquet)
OUT/truth/NAME/truth.json, truth.npz
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.joint_simulator.measurement import clean_log, measured, sample_clean
from drake_tc.joint_simulator.physics import Record
from drake_tc.joint_simulator.reference import run_generator
from drake_tc.joint_simulator.spec import EFFORT_UNIT, HELD_OUT, RUNS, BlindError, RigSpec
from tests.benchmarks.blind.noise import torque_left_by_noise
from tests.benchmarks.blind.oracle import oracle_errors
from tests.benchmarks.blind.truth import beyond_refit, unmodelled_torque
from tests.benchmarks.blind.verdicts import right_verdicts

SENSOR_STREAM = 1


def write_rig(records: list[Record], out_dir: Path) -> Path:
    """Write one rig's files and truth; returns the folder that a diagnosis may see.

    Raises:
        BlindError: Records that are not the three runs of one rig.
    """
    spec = records[0].spec
    if sorted(r.run for r in records) != sorted(RUNS):
        raise BlindError(f"{spec.name}: expected the runs {', '.join(RUNS)}, got {', '.join(r.run for r in records)}")
    folder, hidden = out_dir / "rigs" / spec.name, out_dir / "truth" / spec.name
    folder.mkdir(parents=True, exist_ok=True)
    hidden.mkdir(parents=True, exist_ok=True)
    tables, truths = {}, {}
    for record in records:
        rng = run_generator(spec, record.run, SENSOR_STREAM)
        log = clean_log(record)
        clean = sample_clean(log, unmodelled_torque(record, log), spec.sensors, rng)
        truths[record.run], tables[record.run] = clean, measured(clean, spec, rng)
        _write_table(tables[record.run], folder / f"run_{record.run}.{spec.file_format}")
    (folder / "rig.yaml").write_text(rig_yaml(spec))
    _write_signals(truths, hidden / "truth.npz")
    oracle = oracle_errors(spec, tables, truths)
    truth = _truth(spec) | _strengths(records, oracle["smoothing_sigma"]) | {"oracle": oracle}
    (hidden / "truth.json").write_text(json.dumps(truth, indent=1))
    return folder


def rig_yaml(spec: RigSpec) -> str:
    """The rig file: what the owner believes his joint to be."""
    rig: dict[str, object] = {"joint": "joint", "drive": spec.joint.drive}
    declared = spec.declared_inertia
    rig["declared"] = {"rotor_inertia": float(np.round(declared, 6))} if declared else {}
    if spec.pendulum is not None:
        rig["load"] = {"pendulum": {"mass": spec.pendulum[0], "length": spec.pendulum[1]}}
    rig |= _declared_sensors(spec)
    return str(yaml.safe_dump(rig, sort_keys=False, default_flow_style=None))


def _declared_sensors(spec: RigSpec) -> dict[str, object]:
    """The section `sensors:` of an owner who declares the noise of his sensors; empty for the others."""
    if not spec.declares_sensors:
        return {}
    sensors = spec.sensors
    noise = {"torque_noise": sensors.torque_noise, "correlation_time": sensors.torque_noise_time}
    declared = {name: float(np.round(value, 6)) for name, value in noise.items()} if spec.pendulum is None else {}
    return {"sensors": declared | {"encoder_step": float(np.round(sensors.encoder_step, 9))}}


def _truth(spec: RigSpec) -> dict[str, object]:
    truth = asdict(spec)
    truth["effects"] = sorted(spec.causes) if spec.group in ("single", "pair") else []
    truth["right_verdicts"] = right_verdicts(spec)
    truth["unit"] = EFFORT_UNIT[spec.joint.drive]
    return truth


def _strengths(records: list[Record], sigma: float) -> dict[str, object]:
    """How strong the causes are [N m] where the joint moves, and whether they act in the training runs at all.

    reached: Beyond refitting gain, viscous and Coulomb friction, in both moving runs. reached_in_training: the same in
    the training runs. noise: what the sensors' noise leaves. acts_in_training: whether the second exceeds the third.
    """
    training = beyond_refit([record for record in records if record.run != HELD_OUT])
    noise = torque_left_by_noise(records[0].spec, sigma)
    return {
        "reached": beyond_refit([record for record in records if record.run != "static"]),
        "reached_in_training": training,
        "noise": noise,
        "acts_in_training": training > noise,
    }


def _write_signals(truths: dict[str, pd.DataFrame], path: Path) -> None:
    """`RUN/unmodelled` [N m] and `RUN/bristle`, one value a row of the run's file."""
    signals: dict[str, Any] = {}
    for run, truth in truths.items():
        for name in ("unmodelled", "bristle"):
            signals[f"{run}/{name}"] = truth[name].to_numpy(np.float32)
    np.savez_compressed(path, **signals)


def _write_table(table: pd.DataFrame, path: Path) -> None:
    if path.suffix == ".parquet":
        table.to_parquet(path, index=False)
    else:
        compression = {"method": "gzip", "compresslevel": 4, "mtime": 1} if path.suffix == ".gz" else None
        table.to_csv(path, index=False, compression=compression)
