"""When a reading counts as a fault: the thresholds of `FaultMonitor` and why they are what they are.

What no check of sensors can tell within a given time, whatever its rule: bounds to hold a check's delay against.

A gyro beside feet that turn: over N samples of period h, the yaw angle of the feet by kinematics minus the integral of
the gyro is

    y_k = c + b t_k + A cos(w t_k) + B sin(w t_k) + e_k,    e white with deviation s

where b is the gyro's bias and the sinusoid the turning of the feet themselves on soft soles, of unknown amplitude and
phase. With X the (N, 4) matrix of these columns, no unbiased estimate of b has a smaller deviation than (Cramér-Rao)

    s sqrt([(X'X)^-1]_bb)

A foot beside one whose load is not known: a sole of stiffness K under a load F gives way by F/K, and rises by as much
when the load goes over to other contacts. A rise below dF/K of a foot whose load is known within dF is therefore either
the loss of the contact or a shift of load.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.config.records import Checked, FromZero, Positive, Unbounded
from drake_tc.errors import ParamsError
from drake_tc.sensing.suite import SensorSuiteSpec

_NOISE_OF = {
    "encoder": "encoder_frozen",
    "gyro": "imu_frozen",
    "accel": "imu_frozen",
    "force": "wrench_frozen",
    "torque": "wrench_frozen",
}
LATE = 5e-3
"""By how much the positions of a robot may come late: as long as the real-time loop lets the last ones stand in [s]."""


@dataclass(frozen=True)
class MonitorSpec(Checked):
    """Thresholds: positive numbers, and infinity switches a check off. SI units.

    Attributes:
        encoder_frozen: Time of identical readings [s]. A live encoder of quantisation q and noise about q repeats a
            reading with a probability near 0.3: 20 times in a row once in 1e10 ticks. Infinite for an encoder without
            noise, which stands still when the joint does.
        encoder_stuck: Time of identical readings while the reference moves faster than `moving` [s]: also holds for
            encoders without noise, but a joint may hang in its friction, hence longer.
        moving: Reference speed at which a joint must be seen to move [rad/s].
        imu_frozen, wrench_frozen: As `encoder_frozen` [s]; their noise is many times their resolution.
        encoder_jump: Allowance for noise and resolution of the encoders [rad], in both bounds on the way of one tick:
            twice that of the velocity limit, and the change that `encoder_acceleration` allows.
        encoder_acceleration: Largest acceleration of a joint [rad/s^2]. A drive of 250 N m that moves 1 kg m^2 reaches
            250; the rest is for blows, which reach an encoder at the motor through the gear's compliance.
        encoder_timing: By how much positions may come early or late [s]: the way of a joint at its speed in that time
            is no jump. 0 for simulated sensors; `torque_controller` takes `LATE` in place of 0.
        gyro_jump: Largest possible step in one tick [rad/s]: 1000 rad/s^2 at 1 kHz.
        accel_jump: The same [m/s^2]; a hard impact of the foot reaches the torso with some 10 m/s^2 in 1 ms.
        force_jump, moment_jump: The same of an F/T sensor [N, N m]; most touch-downs rise over several ms, so about a
            fifth of a humanoid's weight in one tick is no load.
        wrench_jump_lasts: Whether a wrench that jumped stays flagged until it jumps back. If false, its flag clears
            after `hold`: for touch-downs that are as hard.
        still_gyro: Filtered rate of an IMU that is welded to a welded base [rad/s]: ten times a humanoid IMU's noise.
        still_accel: Filtered difference between its accelerometer and gravity [m/s^2]: ten times noise and bias.
        unexpected_force, unexpected_moment: Filtered wrench where there should be none: an unknown wrench, or the
            contact wrench of a sensor that is said to be free [N, N m]. Above the error that F/T bias and model leave.
        torque: Filtered difference between estimated torque and the actuator model's, as a fraction of the joint's
            effort limit (of 100 N m where there is none) [-].
        time_constant: Of those filters, finite [s]: a constant error of three times its threshold is flagged after 0.4
            time constants.
        hold: Time for which a flag stays up after its cause was last seen, finite [s].

    Example:
        >>> TorqueLoopSpec(monitor=MonitorSpec(hold=0.2)).monitor.hold
        0.2
    """

    encoder_frozen: Unbounded = 0.02
    encoder_stuck: Unbounded = 0.04
    moving: Unbounded = 0.05
    imu_frozen: Unbounded = 0.01
    wrench_frozen: Unbounded = 0.01
    encoder_jump: Unbounded = 1e-3
    encoder_acceleration: Unbounded = 2000.0
    encoder_timing: FromZero = 0.0
    gyro_jump: Unbounded = 1.0
    accel_jump: Unbounded = 30.0
    force_jump: Unbounded = 100.0
    moment_jump: Unbounded = 20.0
    wrench_jump_lasts: bool = True
    still_gyro: Unbounded = 0.05
    still_accel: Unbounded = 0.5
    unexpected_force: Unbounded = 10.0
    unexpected_moment: Unbounded = 2.0
    torque: Unbounded = 0.25
    time_constant: Positive = 0.01
    hold: Positive = 0.1

    def for_sensors(self, suite: SensorSuiteSpec) -> "MonitorSpec":
        """The same for given sensors.

        Those without noise may stand still, so they are never frozen. With a resolution q and noise of a standard
        deviation s, the change of an encoder's speed between two ticks errs by up to 2 q, and by 15 s once in 1e9:
        `encoder_jump` is at least their sum.

        Args:
            suite: What the sensors do.
        """
        noisy = {name: np.all(np.asarray(getattr(suite, name).noise) > 0.0) for name in _NOISE_OF}
        quiet: Any = {frozen: np.inf for name, frozen in _NOISE_OF.items() if not noisy[name]}
        encoder = suite.encoder
        errs = 2.0 * np.asarray(encoder.resolution) + 15.0 * np.asarray(encoder.noise)
        return replace(self, encoder_jump=max(self.encoder_jump, float(errs.max())), **quiet)


def bias_deviation(duration: float, period: float, noise: float, turning_hz: float = 0.0) -> float:
    """Least standard deviation of an unbiased estimate of a gyro's bias beside feet that may turn [rad/s].

    Args:
        duration: Of the window [s].
        period: Of the samples [s].
        noise: Standard deviation s of a sample of the angle [rad].
        turning_hz: w/(2 pi), frequency at which the feet may turn [Hz]; 0: they stand.

    Raises:
        ParamsError: fewer samples than unknowns, or a number that is not positive.
    """
    if not (duration > 0.0 and period > 0.0 and noise > 0.0 and turning_hz >= 0.0):
        raise ParamsError(
            "bias_deviation: expected duration, period and noise > 0 and turning_hz >= 0,"
            f" got {duration:g}, {period:g}, {noise:g} and {turning_hz:g}"
        )
    count = round(duration / period) + 1
    half = 0.5 * (count - 1) * period
    t = np.linspace(-half, half, count)
    w = 2.0 * np.pi * turning_hz
    others = np.stack([np.ones(count), np.cos(w * t), np.sin(w * t)] if w else [np.ones(count)], axis=1)
    if count <= others.shape[1] + 1:
        raise ParamsError(f"bias_deviation: expected at least {others.shape[1] + 2} samples, got {count}")
    # [(X'X)^-1]_bb is one over the square of what the other columns leave of the column t
    basis = np.linalg.qr(others / np.linalg.norm(others, axis=0))[0]
    rest = t - basis @ (basis.T @ t)
    rest -= basis @ (basis.T @ rest)  # once more, for rounding
    return float(noise / np.linalg.norm(rest))


DEVIATIONS = 3.0
"""By which a check must exceed the noise so that it hardly ever gives a false alarm [-]."""


def bias_resolved_after(
    bias: float, period: float, noise: float, turning_hz: float = 0.0, *, longest: float = 10.0
) -> float:
    """Shortest window in which a bias exceeds `DEVIATIONS` least standard deviations [s]; infinite beyond `longest`.

    Args:
        bias: |b| [rad/s].
        period: Of the samples [s].
        noise: Standard deviation of a sample of the angle [rad].
        turning_hz: Frequency at which the feet may turn [Hz]; 0: they stand.
        longest: Window up to which is looked [s].
    """
    for count in range(6, round(longest / period) + 1):
        if DEVIATIONS * bias_deviation(count * period, period, noise, turning_hz) <= bias:
            return count * period
    return float("inf")
