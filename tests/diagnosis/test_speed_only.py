"""Logs of a velocity without a position, as from a motor test stand: what does not depend on the position is found."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
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
    of_position = ("torque_ripple", "cable_spring", "payload", "position_dependent_friction", "encoder_offset")
    report = write_logs(tmp_path, quadratic, _velocity_alone()).report(
        "quadratic_viscous", "load_dependent_friction", *of_position, assess_residual=False
    )
    joint = report["joints"]["joint"]
    assert found(report) == ["quadratic_viscous"]
    assert_allclose(joint["effects"][0]["parameters"]["quadratic_viscous"]["value"], 1.2, rtol=0.02)
    why = {entry["id"]: entry["why"] for entry in joint["rejected"]}
    for name in of_position:
        assert why[name] == "the position was not recorded, and the integral of the velocity has no known zero"
    assert any("the velocity was integrated" in note for note in joint["notes"])


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
