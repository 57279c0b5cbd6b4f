"""Runs with different masses on one pendulum."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.errors import LogError, RigError
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import parse_rig, rig_document
from drake_tc.types import GRAVITY

from .pendulum_rig import Swing, record, rig_of

LENGTH = 0.3
MASSES = {"light_1": 0.5, "heavy_1": 1.4, "light_2": 0.5}
BY_NAME = {"pendulum": {"mass": {"light_*": 0.5, "heavy_*": 1.4}, "length": LENGTH}}
BASE = Swing(duration=14.0, constant=0.0, zero=0.0, encoder_noise=2e-5)
NEAR = DiagnosisOptions(effects=(effect("load_dependent_friction"), effect("payload.pendulum")), assess_residual=False)


def _swing(mass: float) -> Swing:
    return replace(BASE, moment=mass * GRAVITY * LENGTH, inertia=mass * LENGTH**2)


def _runs():
    return [record(_swing(mass), name, k, 0.37 * k) for k, (name, mass) in enumerate(MASSES.items())]


def test_each_run_has_its_own_load_torque():
    runs = _runs()
    samples = build_samples(runs, rig_of(BASE, BY_NAME), "joint")
    s = samples.signals
    for k, mass in enumerate(MASSES.values()):
        mine = samples.rows[samples.run == k]
        wanted = mass * (GRAVITY * LENGTH * np.sin(s.position) + LENGTH**2 * s.acceleration)
        # sin(smoothed q) is the smoothed sin q to the filter's width squared times qdot^2
        assert_allclose(s.load_torque[mine], wanted[mine], atol=2e-3)


def test_the_right_masses_leave_nothing_and_give_the_drive_gain():
    runs = _runs()
    rig = rig_of(BASE, BY_NAME, drive_gain=None)
    found = diagnose_joint(runs[:2], runs[2:], rig, "joint", NEAR)
    assert [e.id for e in found.effects] == []
    assert_allclose(found.final.gain, BASE.gain, rtol=2e-3)
    wrong = rig_of(BASE, {"pendulum": {"mass": 0.95, "length": LENGTH}}, drive_gain=None)
    ready = [prepare_joint(runs[:2], runs[2:], each, "joint") for each in (rig, wrong)]
    right, one_mass = (fit(each.train, each.terms).rms for each in ready)
    assert one_mass > 5.0 * right


def test_the_first_pattern_that_fits_counts_and_the_rig_is_written_back():
    rig = rig_of(BASE, {"pendulum": {"mass": {"heavy_1": 2.0, "heavy_*": 1.4, "*": 0.8}, "length": LENGTH}})
    load = rig.load["joint"]
    assert isinstance(load, Pendulum)
    masses = {name: load.in_run(record(BASE, name, 0)).mass for name in ("heavy_1", "heavy_2", "any")}
    assert masses == {"heavy_1": 2.0, "heavy_2": 1.4, "any": 0.8}
    assert parse_rig(rig_document(rig)) == rig


def test_length_and_inertia_may_differ_with_the_mass():
    keys = {"mass": {"a*": 1.0, "b*": 2.0}, "length": {"a*": 0.1, "b*": 0.2}, "inertia": {"a*": 0.02, "b*": 0.09}}
    load = rig_of(BASE, {"pendulum": keys}).load["joint"]
    assert isinstance(load, Pendulum)
    assert load.in_run(record(BASE, "b1", 0)) == Pendulum(2.0, 0.2, 0.09)


@pytest.mark.parametrize(
    ("pendulum", "said"),
    [
        ({"mass": {}, "length": 0.3}, "load.pendulum.mass: expected {pattern of file names: value}, got {}"),
        ({"mass": {"a": -1}, "length": 0.3}, "load.pendulum.mass.a: expected a positive number, got -1"),
        (
            {"mass": {"a": 1.0, "b": 2.0}, "length": {"a": 0.3}},
            "load.pendulum.length: expected the same file names as in mass (a, b), got a",
        ),
    ],
)
def test_what_cannot_be_read_is_refused(pendulum, said):
    with pytest.raises(RigError, match="rig") as caught:
        rig_of(BASE, {"pendulum": pendulum})
    assert said in str(caught.value)


def test_a_log_without_a_mass_is_refused(tmp_path):
    run = record(BASE, "other", 0)
    pd.DataFrame({"time": run.time, **run.columns}).to_csv(tmp_path / "haevy_1.csv", index=False)
    with pytest.raises(LogError, match=r"haevy_1\.csv: no mass: .*\(light_\*, heavy_\*\); did you mean 'heavy_\*'"):
        load_runs([tmp_path / "haevy_1.csv"], rig_of(BASE, BY_NAME))
