"""Where the load torque of a joint comes from when no sensor measures it, and what is known of the sensors.

Noise replaces what is estimated from the log. A tolerance is the standard deviation of an error that stays the same
over all runs; errors within a few of them are expected of any sensor of its kind and are estimated along, not reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal, TypeAlias

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import LogError
from drake_tc.logs.record import Run
from drake_tc.types import GRAVITY, FloatArray


@dataclass(frozen=True)
class Pendulum:
    """A rigid pendulum on the joint.

    Its torque on the link side is  tau = inertia qddot + mass g length sin(q - zero)  [N m].

    Attributes:
        mass: [kg], > 0.
        length: From the axis to the centre of mass [m], > 0.
        inertia: About the axis [kg m^2]; a point mass's m l^2 when not given.
        zero: Joint position at which it hangs [rad].
        by_run: (pattern of file names, pendulum) of runs with different masses; the first pattern that fits counts.
            This pendulum is then the first of them. Empty where all runs have this one.
    """

    mass: float
    length: float
    inertia: float = float("nan")
    zero: float = 0.0
    by_run: tuple[tuple[str, "Pendulum"], ...] = ()

    def __post_init__(self) -> None:
        if np.isnan(self.inertia):
            object.__setattr__(self, "inertia", self.mass * self.length**2)
        for name in ("mass", "length", "inertia"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, got {value!r}")
        if not np.isfinite(self.zero):
            raise ValueError(f"zero must be a finite angle [rad], got {self.zero!r}")

    def in_run(self, run: Run) -> "Pendulum":
        """The pendulum of one run.

        Raises:
            LogError: No pattern fits the name of its file.
        """
        if not self.by_run:
            return self
        name = run.file_name
        for pattern, pendulum in self.by_run:
            if fnmatchcase(name, pattern) or fnmatchcase(run.name, pattern):
                return pendulum
        patterns = [pattern for pattern, _ in self.by_run]
        raise LogError(
            f"{run.source or run.name}: no mass: the name fits none of the patterns of load.pendulum.mass "
            f"({', '.join(patterns)}){did_you_mean(run.name, patterns)}; "
            "add the file, or the pattern '*', to the rig file"
        )

    @property
    def weight(self) -> float:
        """Largest torque of gravity m g l [N m]."""
        return self.mass * GRAVITY * self.length

    def torque(self, position: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Link-side torque (T,) [N m] at q (T,) [rad] and qddot (T,) [rad/s^2]."""
        gravity = self.weight * np.sin(position - self.zero)
        return np.asarray(self.inertia * acceleration + gravity)


RobotMethod = Literal["estimate", "inverse_dynamics", "fitted"]


@dataclass(frozen=True)
class RobotLoad:
    """Torques from the model of the whole robot that the rig file names.

    Attributes:
        method: "estimate": encoders, IMU and F/T sensors (Del Prete et al., 2016, Algorithm 1); "inverse_dynamics":
            encoders and, where there is one, the IMU, for a robot that nothing touches or whose F/T sensors are not in
            the way; "fitted": the same, but the links' inertial parameters are fitted together with the joints' models.
        tolerance: Of a fitted robot: standard deviation of a link's mass as a share of the file's; its first moments
            and inertia follow with the link's size (`robot.rigid_regressor`).
        gain_tolerance: Of a fitted robot: standard deviation of the common relative error of the declared drive gains.
        payload: Of a fitted robot: names of the logs in which a link carries a load that is not known.
        carrier: That link; empty for the robot's only outermost link.
    """

    method: RobotMethod = "estimate"
    tolerance: float = 1.0
    gain_tolerance: float = 0.0
    payload: tuple[str, ...] = ()
    carrier: str = ""

    @property
    def fitted(self) -> bool:
        """Whether the links' parameters are fitted."""
        return self.method == "fitted"


UnknownForm = Literal["pendulum", "smooth"]


@dataclass(frozen=True)
class UnknownLoad:
    """A load of which nothing is measured and nothing is declared but its form.

    In a rig file: `load: {unknown: smooth}`. The form "pendulum" is written, and kept, as the word "unknown".

    Attributes:
        form: "pendulum": J qddot + m g l sin(q - zero) + c of unknown J, m l, zero and c; "smooth": J qddot plus a
            smooth function of the position.
    """

    form: UnknownForm = "pendulum"


Load: TypeAlias = Literal["torque", "unknown"] | Pendulum | RobotLoad | UnknownLoad


def unknown_form(load: Load) -> UnknownForm | None:
    """The form of an unknown load; None where the load is known."""
    if isinstance(load, UnknownLoad):
        return load.form
    return "pendulum" if load == "unknown" else None


@dataclass(frozen=True)
class JointSensors:
    """Declared noise and tolerances of one joint's own sensors; None where nothing is declared.

    Noise that is not declared is estimated from the log. A sensor without a tolerance has no error in the model before.

    Attributes:
        torque_noise: Standard deviation of one raw sample of the torque, before any filter [N m] (N of a slider).
        torque_correlation_time: Time over which that noise is correlated, 0 for white noise [s].
        encoder_step: Step between different positions [rad] (m).
        position_noise: Standard deviation of one raw position besides the steps [rad] (m).
        torque_bias: Tolerance of the torque sensor's constant error [N m] (N).
        torque_gain: Tolerance of its relative error of scale [-].
        encoder_offset: Tolerance of the encoder's zero [rad] (m).
        current_bias, voltage_bias, torque_command_bias: Tolerance of the effort's zero [A, V, N m (N)]; that of the
            joint's drive counts.
    """

    torque_noise: float | None = None
    torque_correlation_time: float | None = None
    encoder_step: float | None = None
    position_noise: float | None = None
    torque_bias: float | None = None
    torque_gain: float | None = None
    encoder_offset: float | None = None
    current_bias: float | None = None
    voltage_bias: float | None = None
    torque_command_bias: float | None = None

    def tolerances(self, drive: str, drive_gain: float) -> dict[str, float]:
        """The tolerances above 0, by the id of the effect that a larger error is; those of torques in N m.

        Args:
            drive: Kind of drive.
            drive_gain: K [effort/(N m)], which turns the effort's tolerance into one of the torque.
        """
        efforts = {"current": self.current_bias, "voltage": self.voltage_bias, "torque": self.torque_command_bias}
        known = {
            "torque_sensor_bias": self.torque_bias,
            "torque_sensor_gain": self.torque_gain,
            "encoder_offset": self.encoder_offset,
            "effort_bias": (efforts.get(drive) or 0.0) / drive_gain,
        }
        return {name: size for name, size in known.items() if size}


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
    # Assumed of a strain-gauge sensor of some 300 N and 15 N m that was zeroed unloaded: 0.1 % of the range is left,
    # 1 % of scale, 0.3 degrees of mounting.
    "typical": ForceTorqueTolerance(0.3, 0.015, 0.01, 0.005),
}
"""Common F/T sensors, zeroed unloaded before the runs."""

IMU_PARTS: Mapping[str, ImuTolerance] = {
    # Assumed of an inertial module that was calibrated in the factory, its gyro zeroed at rest.
    "typical": ImuTolerance(0.03, 0.005, 0.001, 0.005),
    # Xsens: gyro's bias within 0.5 deg/s in a year (knowledge base, "Bias repeatability of gyroscopes"); base plate
    # aligned with the output frame within 0.1 deg (MTi user manual MT0605P.2018.E, section 5.2.1). The accelerometer's
    # bias and gain are those of "typical".
    "xsens_mti_30": ImuTolerance(0.03, 0.5 * _DEG, 0.001, 0.1 * _DEG),
    # InvenSense PS-MPU-6000A-00 revision 3.4, sections 6.1 and 6.2: zero-g output 50 mg (80 mg along z, taken for all
    # axes), zero-rate output 20 deg/s, sensitivity of the accelerometer 3 %, cross-axis sensitivity 2 %.
    "mpu_6050": ImuTolerance(0.080 * _G, 20.0 * _DEG, 0.03, 0.02),
}
"""Common IMUs, as they leave the factory."""
