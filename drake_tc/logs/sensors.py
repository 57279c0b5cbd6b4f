"""What a rig's owner knows of its sensors: noise of the joints' own channels, tolerances of F/T sensors and IMUs.

Noise replaces what is estimated from the log. A tolerance is the standard deviation of an error that stays the same
over all runs; errors within a few of them are expected of any sensor of its kind and are estimated along, not reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True)
class JointSensors:
    """Declared noise of one joint's channels; None where it is to be estimated from the log.

    Attributes:
        torque_noise: Standard deviation of one raw sample of the torque, before any filter [N m] (N of a slider).
        torque_correlation_time: Time over which that noise is correlated, 0 for white noise [s].
        encoder_step: Step between different positions [rad] (m).
        position_noise: Standard deviation of one raw position besides the steps [rad] (m).
    """

    torque_noise: float | None = None
    torque_correlation_time: float | None = None
    encoder_step: float | None = None
    position_noise: float | None = None


@dataclass(frozen=True)
class ForceTorqueTolerance:
    """Standard deviations of one F/T sensor's constant errors, alike on all axes; 0 for an error that is not there.

    Attributes:
        force_bias, torque_bias: [N, N m].
        gain: Relative error of the scale, one of the forces and one of the torques [-].
        alignment: Rotation about each axis [rad].
    """

    force_bias: float
    torque_bias: float
    gain: float
    alignment: float


@dataclass(frozen=True)
class ImuTolerance:
    """Standard deviations of one IMU's constant errors, alike on all axes; 0 for an error that is not there.

    Attributes:
        accel_bias, gyro_bias: [m/s^2, rad/s].
        gain: Relative error of the accelerometer's scale [-].
        alignment: Rotation about each axis, of accelerometer and gyro together [rad].
    """

    accel_bias: float
    gyro_bias: float
    gain: float
    alignment: float


Tolerance: TypeAlias = ForceTorqueTolerance | ImuTolerance

_G = 9.80665
_DEG = 0.017453292519943295

FORCE_TORQUE_PARTS: Mapping[str, ForceTorqueTolerance] = {
    # Strain-gauge sensors of some 300 N and 15 N m, zeroed unloaded: 0.1 % of range is left, 1 % of scale (data sheets
    # state 0.75 to 2 % of range at 95 %), and 0.3 degrees of mounting (a bolted flange with its dowel pin).
    "typical": ForceTorqueTolerance(0.3, 0.015, 0.01, 0.005),
    # ATI Industrial Automation, document 9620-05-Transducer Section, Mini45 SI-145-5: ranges 145 N (290 N along z) and
    # 5 N m; measurement uncertainty (95 %) of at most 1.5 % of range, half of which is one standard deviation.
    "ati_mini45": ForceTorqueTolerance(0.3, 0.01, 0.0075, 0.005),
    # The same document, Gamma SI-130-10: ranges 130 N (400 N along z) and 10 N m; uncertainty of at most 1.25 %.
    "ati_gamma": ForceTorqueTolerance(0.3, 0.02, 0.006, 0.005),
}
"""Common F/T sensors, zeroed unloaded before the runs."""

IMU_PARTS: Mapping[str, ImuTolerance] = {
    # Inertial modules that were calibrated in the factory (the MTi-30 below), their gyro zeroed at rest.
    "typical": ImuTolerance(0.03, 0.005, 0.001, 0.005),
    # Xsens, MTi user manual MT0605P: accelerometer's bias repeats within 0.03 m/s^2 in a year, misalignment of the axes
    # 0.05 deg; gyro's bias within 0.5 deg/s in a year (Xsens knowledge base, "Bias repeatability of gyroscopes").
    "xsens_mti_30": ImuTolerance(0.03, 0.5 * _DEG, 0.001, 0.003),
    # Bosch Sensortec BST-BMI088-DS001: zero-g offset 20 mg, zero-rate offset 1 deg/s, sensitivity 1 %, cross-axis
    # sensitivity 0.5 % (typical values: one standard deviation).
    "bmi088": ImuTolerance(0.020 * _G, 1.0 * _DEG, 0.01, 0.005),
    # InvenSense PS-MPU-6000A-00 revision 3.4, sections 6.1 and 6.2: zero-g output 50 mg (80 mg along z), zero-rate
    # output 20 deg/s, sensitivity 3 %, cross-axis sensitivity 2 %; neither is calibrated in the factory.
    "mpu_6050": ImuTolerance(0.080 * _G, 20.0 * _DEG, 0.03, 0.02),
}
"""Common IMUs, as they leave the factory."""


def typical(column: str) -> Tolerance:
    """What is assumed of a sensor of which the rig file says nothing; `column` as in the log, e.g. `ft_foot`."""
    return FORCE_TORQUE_PARTS["typical"] if column.startswith("ft_") else IMU_PARTS["typical"]
