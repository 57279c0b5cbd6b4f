"""The intervals that a design states for its motion are those that a diagnosis states after it, on simulated joints."""

import numpy as np
import pandas as pd
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.experiments.design.goal import parse_goal
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.run import DesignOptions, design_joint
from drake_tc.experiments.rehearsal.twin import integrated
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.joint_simulator.measurement import clean_log, measured
from drake_tc.joint_simulator.spec import RigSpec, Sensors
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from tests.benchmarks.blind.files import rig_yaml
from tests.benchmarks.blind.joints import draw_joint
from tests.benchmarks.evidence.loop import LIMITS, twin_run

PER_SECOND = 1000.0
SECONDS = 14.0
JOINT = "joint"
SLOW = MotionLimits((-0.45, 0.45), 0.8, 2.5)


def recorded(folder, spec, rate, runs, seed):
    """A log file of each run, at a rate [Hz]."""
    rng, paths = np.random.default_rng(seed), []
    for run, record in zip(runs, integrated([spec] * len(runs), runs), strict=True):
        log = clean_log(record)
        time = np.arange(0.0, log.time[-1], 1.0 / rate)
        names = ("position", "motor_position", "command", "torque", "temperature")
        columns = {name: np.interp(time, log.time, getattr(log, name)) for name in names}
        paths.append(folder / f"{run.name}.parquet")
        measured(pd.DataFrame({"time": time, **columns}), spec, rng).to_parquet(paths[-1], index=False)
    return paths


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drive", "rate", "seed"),
    [
        pytest.param(
            *("position_servo", 500, 821),
            marks=pytest.mark.xfail(strict=True, reason="Coulomb friction: +- 0.0129 N m where 0.0209 was expected"),
        ),
        ("current", 2000, 822),
    ],
)
def test_stated_intervals_are_those_of_the_diagnosis_within_a_factor_of_one_and_a_half(tmp_path, drive, rate, seed):
    rng = np.random.default_rng(seed)
    noise = Sensors(torque_noise=0.25)
    spec = RigSpec("rig", "null", "plain", "", draw_joint(rng, drive), seed, sensors=noise)
    (tmp_path / "rig.yaml").write_text(rig_yaml(spec), encoding="utf-8")
    rig = load_rig(tmp_path / "rig.yaml")
    time = np.arange(0.0, SECONDS, 1.0 / PER_SECOND)
    slow = [growing_sinusoid(time, hz, 0.1, 0.3 / SECONDS, SLOW).position for hz in (0.22, 0.28)]
    first = recorded(tmp_path, spec, rate, [twin_run(f"first_{i}", time, q, 0.0) for i, q in enumerate(slow)], seed)
    joint, _, prepared = joint_from_logs(rig, load_runs(first, rig), JOINT)
    design = design_joint(joint, LIMITS, parse_goal("parameters"), DesignOptions(), prepared)
    clock, motion = design.motion(PER_SECOND)
    last = recorded(tmp_path, spec, rate, [twin_run("designed", clock, motion[0], 0.0)], seed + 1)
    train, held = load_runs(last, rig), load_runs(first[:1], rig)
    options = DiagnosisOptions(effects=(), assess_residual=False)
    found = diagnose_joint(train, held, rig, JOINT, options).baseline_parameters
    half = {name: 0.5 * (e.ci95[1] - e.ci95[0]) for values in found.values() for name, e in values.items()}
    gain = found["drive"]["gain"].value
    half["1/drive gain"] = half.pop("gain") / gain**2
    stated = {row.name.partition(",")[0]: row.after for row in design.expected}
    assert {"viscous", "coulomb", "1/drive gain"} <= set(stated)
    for name, value in stated.items():
        assert 1.0 / 1.5 <= half[name] / value <= 1.5, name
