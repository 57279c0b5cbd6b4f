"""The kernels as plain Python, which coverage and debuggers see: the same tests, with Numba's compiler switched off."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
FILES = (
    "kernels/test_dynamics.py",
    "kernels/test_gaussian.py",
    "kernels/test_linear_algebra.py",
    "kernels/test_compiling.py",
    "tsid/test_robust_newton.py",
    "tsid/test_robust_box.py",
    "tsid/test_robust_individual.py",
    "tsid/test_limits_viability.py",
    "tsid/test_tasks_motion.py",
    "tsid/test_reduction.py",
    "tsid/test_fused_tick.py",
    "tsid/test_warm_start.py",
    "tsid/test_warm_tick.py",
    "sensor_validation/test_fault_monitor.py",
    "kernels/test_instant.py",
    "kernels/test_newton_euler.py",
    "kernels/test_sensor_reading.py",
    "estimation/test_torque_model.py",
    "estimation/test_joint_torque.py",
    "filtering/test_savitzky_golay.py",
    "control/test_inverse_dynamics.py",
    "loops/fused/test_fuse.py",
    "control/test_torque_control.py",
    "control/test_guard.py",
    "actuation/test_joint_program.py",
    "actuation/test_compensator.py",
    "actuation/test_friction.py",
    "sensor_validation/test_joint_sensors.py",
    "sensor_validation/test_body_sensors.py",
    "control/test_series_elastic.py",
    "estimation/base/test_attitude.py",
    "estimation/base/test_contact_switch.py",
    "estimation/base/test_imu_filters.py",
    "estimation/base/test_pose.py",
    "estimation/base/test_soft_sole.py",
    "estimation/base/test_system.py",
    "estimation/base/test_velocity.py",
)


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("file", FILES)
def test_the_kernels_as_python(file):
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}  # NumPy warns of what overflows
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "no:cacheprovider",
        "-m",
        "not slow",
        "-W",
        "ignore::RuntimeWarning",
        str(TESTS / file),
    ]
    found = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=TESTS.parent, check=False)
    assert found.returncode == 0, found.stdout[-4000:]
