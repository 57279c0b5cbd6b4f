"""Free runs of a robot whose links are fitted: the loads and the currents that they get belong to one model."""

import numpy as np
import pytest
from fitted_arm import COULOMB, GAIN, JOINTS, ROTOR, URDF, VISCOUS, record, rig_file
from numpy.testing import assert_allclose
from robot_files import link_tag, write_robot

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.robot.robot import load_robot

OFFSETS = np.array([0.006, -0.012, 0.009])
"""Of the recorded currents [A]."""
LEFT_OVER = 0.02
"""Mean torque [N m] that a free run's load and current may leave over: 2 to 4 % of the Coulomb friction."""


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """By joint, the held-out run that the free run of its model after gets."""
    folder = tmp_path_factory.mktemp("offsets")
    loaded = load_robot(write_robot(folder, URDF, JOINTS))
    logs = [_with_offsets(record(folder, loaded, f"run_{k}", k)) for k in range(3)]
    light = URDF.replace(
        link_tag("fore", (0.15, 0.01, 0), 1.2, (0.002, 0.012, 0.012)),
        link_tag("fore", (0.13, 0.0, 0), 0.95, (0.002, 0.012, 0.012)),
    )
    assert light != URDF
    write_robot(folder, light, JOINTS)
    rig = rig_file(folder, sensors={"current": {"bias": 0.01}})
    seen = {}

    def free_run(model, rig, joint, run):
        seen.setdefault(joint, []).append(run)

    close_loop(rig, logs[:2], logs[2:], DiagnosisOptions(effects=(), assess_residual=False), free_run=free_run)
    return {joint: runs[-1] for joint, runs in seen.items()}


def _with_offsets(path):
    columns = dict(np.load(path))
    for joint, offset in zip(JOINTS, OFFSETS, strict=True):
        columns[f"{joint}/current"] = columns[f"{joint}/current"] + offset
    np.savez(path, **columns)
    return path


@pytest.mark.parametrize("joint", JOINTS)
def test_nothing_is_left_over_on_average(given, joint):
    """Drive, friction and rotor of the truth: i/K - tau - J a - friction is 0, whatever links and offset share."""
    number = JOINTS.index(joint)
    run = given[joint]
    time, q = run.time, run.columns[f"{joint}/position"]
    v = np.gradient(q, time)
    a = np.gradient(v, time)
    rest = run.columns[f"{joint}/current"] / GAIN[number] - run.columns[f"{joint}/torque"]
    rest = rest - ROTOR[number] * a - VISCOUS[number] * v - COULOMB[number] * np.sign(v)
    moving = np.abs(v) > 0.1
    assert_allclose(np.mean(rest[moving]), 0.0, atol=LEFT_OVER)
