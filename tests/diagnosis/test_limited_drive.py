"""A servo that runs at its limit for much of the time, under a pendulum that nobody weighed."""

import numpy as np
import pytest

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from .stick_slip import GRAVITY, JOINT, Servo

LIMIT, ZERO, FINE = 0.11, 0.33, 2e-4
"""Of the position error [rad]; where the pendulum hangs [rad]; step of the integrator [s]."""
SERVO = Servo(
    period=0.01,
    duration=20.0,
    stiffness=12.0,
    inertia=0.004,
    viscous=0.25,
    coulomb=0.2,
    mass=1.1,
    length=0.12,
)
"""The drive can hold 1.32 N m, and the pendulum asks for up to 1.29 N m and its friction."""
MOMENT = SERVO.mass * GRAVITY * SERVO.length
RIG = parse_rig({"joint": JOINT, "drive": "position_servo", "load": "unknown", "drive_gain": 1.0 / SERVO.stiffness})


def run(number: int) -> Run:
    """J a = K clip(q_d - q) - m g l sin(q - z) - F_v v - F_c sign v, with rest as a state."""
    t, rng = SERVO.times(), np.random.default_rng(40 + number)
    waves = [(a, f * rng.uniform(0.8, 1.3), rng.uniform(0.0, 6.3)) for a, f in ((0.9, 0.13), (0.45, 0.37), (0.15, 0.9))]
    command = np.minimum(t, 1.0) * sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in waves)
    total = SERVO.inertia + SERVO.mass * SERVO.length**2
    q, v, position = float(command[0]), 0.0, np.empty(t.size)
    for k, wanted in enumerate(command.tolist()):
        position[k] = q
        for _ in range(round(SERVO.period / FINE)):
            drive = SERVO.stiffness * min(max(wanted - q, -LIMIT), LIMIT)
            faster = v + FINE * (drive - MOMENT * np.sin(q - ZERO) - SERVO.viscous * v) / total
            v = np.sign(faster) * max(abs(faster) - FINE * SERVO.coulomb / total, 0.0)
            q += FINE * v
    columns = {f"{JOINT}/position": SERVO.encoder(position, rng), f"{JOINT}/position_command": command}
    return SERVO.run(f"run{number}", columns)


@pytest.mark.parametrize("first", [3])
def test_a_limit_is_found_though_it_takes_most_of_the_effort_away(first: int):
    runs = [run(first + k) for k in range(3)]
    errors = np.concatenate([r.columns[f"{JOINT}/position_command"] - r.columns[f"{JOINT}/position"] for r in runs])
    assert np.std(np.clip(errors, -LIMIT, LIMIT)) < 0.6 * np.std(errors)
    found = diagnose_joint(runs[:2], runs[2:], RIG, JOINT, DiagnosisOptions(assess_residual=False))
    assert [each.id for each in found.effects] == ["saturation"]
    assert found.effects[0].parameters["limit"].value == pytest.approx(LIMIT, rel=0.02)
    load = found.final_parameters["unknown_load.pendulum"]
    assert load["moment"].value == pytest.approx(MOMENT, rel=0.02)
    assert load["zero"].value == pytest.approx(ZERO, abs=0.02)
