"""Logs of a velocity without a position, as from a motor test stand: what does not depend on the position is found."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.errors import IdentificationError, LogError
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

from .log_files import found, write_logs
from .rigs import Joint

STEP = 0.01
"""Of the recorded velocity [rad/s]."""
JOINT = Joint(duration=10.0, torque_noise=0.05)


def _velocity_alone(noise=0.0, step=STEP):
    """The position's column replaced by a velocity with steps: its central difference (exact to 3e-6 rad/s here)."""
    rng = np.random.default_rng(5)

    def change(table):
        velocity = np.gradient(table.pop("joint/position"), table["time"])
        velocity = velocity + noise * rng.standard_normal(velocity.size)
        return table.assign(**{"joint/velocity": np.round(velocity / step) * step})

    return change


def test_an_effect_of_the_motion_is_found_and_those_of_the_position_are_left_out_with_the_reason(tmp_path: Path):
    quadratic = replace(JOINT, extra=lambda m: 1.2 * m.v * np.abs(m.v))
    report = write_logs(tmp_path, quadratic, _velocity_alone()).report(assess_residual=False)
    joint = report["joints"]["joint"]
    assert found(report) == ["quadratic_viscous"]
    assert_allclose(joint["effects"][0]["parameters"]["quadratic_viscous"]["value"], 1.2, rtol=0.02)
    why = {entry["id"]: entry["why"] for entry in joint["rejected"]}
    for name in ("torque_ripple", "cable_spring", "payload", "position_dependent_friction", "encoder_offset"):
        assert why[name] == "the position was not recorded, and the integral of the velocity has no known zero"
    assert any("the velocity was integrated" in note for note in joint["notes"])


def test_the_declared_model_is_that_of_a_log_with_positions(tmp_path: Path):
    reports = [
        write_logs(tmp_path / "q", replace(JOINT, encoder_step=1e-5)).report(assess_residual=False),
        write_logs(tmp_path / "v", JOINT, _velocity_alone(noise=2e-3, step=1e-4)).report(assess_residual=False),
    ]
    assert [found(report) for report in reports] == [[], []]
    with_q, with_v = (report["joints"]["joint"]["baseline"]["parameters"] for report in reports)
    for key, name in (("drive", "gain"), ("viscous", "viscous"), ("coulomb", "coulomb")):
        assert_allclose(with_v[key][name], with_q[key][name], rtol=5e-3)


@pytest.mark.parametrize(("noise", "step"), [(0.02, 1e-5), (0.0, 0.05)])
def test_the_floor_is_what_the_noise_of_the_velocity_leaves(tmp_path: Path, noise: float, step: float):
    """Against the residual of the true model on the same rows: noise, and steps, of the velocity alone."""
    silent = replace(JOINT, torque_noise=0.0, viscous=40.0)
    logs = write_logs(tmp_path, silent, _velocity_alone(noise, step))
    rig = load_rig(logs.rig)
    runs = load_runs([*logs.train, *logs.held], rig)
    samples = build_samples(runs, rig, "joint")
    s = samples.signals
    torque = s.load_torque + 0.3 * s.acceleration + 40.0 * s.velocity + 3.0 * s.direction
    left = samples.reduce(s.effort / silent.gain) - samples.reduce(torque)
    far = samples.reduce(np.abs(s.velocity)) > 0.15  # a reversal's friction is smeared over the filter's width
    told = samples.floor.torque(1.0 / silent.gain, 40.0)
    assert_allclose(np.std(left[far]), told, rtol=0.25)  # blocks of a few hundred independent rows
    assert samples.resolution.position_step == 0.0
    assert_allclose(samples.resolution.velocity_step, step if noise == 0.0 else 0.0, rtol=1e-6, atol=2e-5)


def test_a_declared_effect_of_the_position_is_refused(tmp_path: Path):
    keys = {"declared": {"rotor_inertia": 0.3, "cable_spring": {"spring_stiffness": 2.0}}}
    with pytest.raises(IdentificationError, match="cable_spring depends on the position, and the logs have the veloc"):
        write_logs(tmp_path, JOINT, _velocity_alone(), keys).report(assess_residual=False)


def test_other_rigs_ask_for_the_position(tmp_path: Path):
    logs = write_logs(tmp_path, JOINT, _velocity_alone(), {"load": {"pendulum": {"mass": 1.0, "length": 0.2}}})
    with pytest.raises(LogError, match="no column 'joint/position'"):
        logs.report()


def test_a_forgotten_unit_of_the_velocity_is_refused(tmp_path: Path):
    def in_rpm(table):
        table = _velocity_alone()(table)
        return table.assign(**{"joint/velocity": table["joint/velocity"] * 60.0 / (2.0 * np.pi) * 10.0})

    with pytest.raises(LogError, match=r"reaches .* it looks like rpm or deg/s; set units: {velocity: rpm}"):
        write_logs(tmp_path, JOINT, in_rpm).report()


def test_runs_with_and_without_positions_do_not_mix(tmp_path: Path):
    both = write_logs(tmp_path / "a", JOINT)
    alone = write_logs(tmp_path / "b", replace(JOINT, gain=0.081), _velocity_alone())
    with pytest.raises(LogError, match=r"one\.csv: no column 'joint/position', which .*two\.csv has"):
        load_runs([alone.train[0], both.train[1]], load_rig(both.rig))
