"""A rotor inertia that is fitted, on a joint whose load is a pendulum and nothing else.

The load is tau = J_l qddot + m g l sin q then, so that J qddot = (J/J_l) (tau - m g l sin q): a smaller 1/K and a
function of the position explain the rotor as well as its inertia does, without the noise of an acceleration.
"""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from .rigs import COMMAND, Joint, sines

STEP = 2e-5
WAVES = (
    (0.19, 0.26, 4.4),
    (0.36, 0.19, 0.7),
    (0.98, 0.11, 2.3),
    (0.74, 0.13, 3.1),
    (0.2, 0.25, 2.6),
    (0.58, 0.15, 3.5),
    (0.63, 0.14, 4.4),
    (0.28, 0.21, 5.7),
)
PENDULUM = Joint(drive="position_servo", gain=2e-3, encoder_step=STEP, encoder_noise=0.3 * STEP, torque_noise=0.02)


def hung(joint: Joint, seed: int) -> Run:
    """A pendulum of 5 N m and 0.5 kg m^2, its torque measured."""
    rng, time = np.random.default_rng(seed), joint.times()
    q, v, a = sines(time, WAVES, 0.37 * seed)
    load = 0.5 * a + 5.0 * np.sin(q)
    effort = joint.gain * (load + joint.inertia * a + joint.viscous * v + joint.coulomb * np.sign(v))
    columns = {
        "joint/position": joint.encoder(q, rng),
        "joint/torque": load + joint.torque_noise * rng.standard_normal(time.size),
        f"joint/{COMMAND[joint.drive]}": effort + (q if joint.drive == "position_servo" else 0.0),
    }
    return joint.run(f"run{seed}", columns)


def diagnosed(joint: Joint, **keys: object) -> JointResult:
    rig = parse_rig({"joint": "joint", "drive": joint.drive, "command_hold": False, **keys})
    runs = [hung(joint, seed) for seed in range(3)]
    return diagnose_joint(runs[:2], runs[2:], rig, "joint", DiagnosisOptions(assess_residual=False))


@pytest.mark.parametrize("noise", [0.1, 0.3, 1.0], ids=lambda share: f"{share} steps")
def test_nothing_is_missing_where_the_rotor_inertia_is_declared_without_a_value(noise):
    result = diagnosed(replace(PENDULUM, encoder_noise=noise * STEP), declared=["rotor_inertia"])
    assert result.effects == ()
    found = result.final_parameters["rotor_inertia"]["rotor_inertia"]
    assert found.value == pytest.approx(PENDULUM.inertia, rel=0.02)


def test_an_undeclared_rotor_is_found_where_the_drive_gain_is_known():
    result = diagnosed(PENDULUM, drive_gain=PENDULUM.gain)
    assert [each.id for each in result.effects] == ["rotor_inertia"]
    assert result.effects[0].parameters["rotor_inertia"].value == pytest.approx(PENDULUM.inertia, rel=0.02)
