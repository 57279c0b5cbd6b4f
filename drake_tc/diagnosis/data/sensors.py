"""What the sensors of one joint resolve: as the rig file declares, else as the recorded channels show."""

from collections.abc import Mapping

import numpy as np

from drake_tc.diagnosis.data.channels import Channels
from drake_tc.diagnosis.data.resolution import WIDEST_FINAL, WIDEST_LIGHT, Resolution
from drake_tc.diagnosis.data.sample_noise import interpolated_noise, sample_noise, scatter, typical_hold
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import Pendulum, RobotLoad, unknown_form
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

LEAST_NOISE = 1e-12
"""Of a position [rad], so that noise-free logs have a resolution too."""


def encoder_of(channels: Channels, rig: Rig, position: FloatArray) -> tuple[float, float]:
    """(step, standard deviation of one sample with its steps) of the position [rad]: declared, or from the log.

    Of a speed-only log the same of the velocity [rad/s].
    """
    if channels.speed_only:
        step = channels.step("velocity")
        return step, max(sample_noise(channels.raw("velocity"), step, channels.segments), LEAST_NOISE)
    declared = rig.joint_sensors(channels.joint)
    step = channels.step("position") if declared.encoder_step is None else declared.encoder_step
    if declared.position_noise is not None:
        return step, max(float(np.hypot(declared.position_noise, step / np.sqrt(12.0))), LEAST_NOISE)
    return step, max(_noise(channels, "position", position, step), LEAST_NOISE)


SLOWEST_TOPIC: Mapping[bool, float] = {False: WIDEST_FINAL, True: WIDEST_LIGHT}
"""Time [s] for which a command may typically stay the same and still be a channel that a slower topic reports; of a
position servo (true), whose goal is never measured, less than of another drive. Values that stay for longer are steps
that somebody commands, and the differences between them are no noise."""


def resolution_of(channels: Channels, rig: Rig, step: float, noise: float, light: CommonKernel) -> Resolution:
    """What the joint's sensors resolve, after the light kernel where velocity is concerned."""
    declared, load = rig.joint_sensors(channels.joint), rig.load[channels.joint]
    command = rig.command_column(channels.joint).rpartition("/")[2]
    torque_noise, effort_noise = 0.0, 0.0
    unknown = unknown_form(load) is not None
    tells_load = unknown or (isinstance(load, RobotLoad) and load.method != "estimate")
    servo = rig.drive[channels.joint] == "position_servo"
    if typical_hold(channels.raw(command), channels.segments) * channels.period > SLOWEST_TOPIC[servo]:
        effort_noise = 0.0  # beside its steps
    elif tells_load or not servo:
        effort_noise = _recorded_noise(channels, command)
    else:
        effort_noise = scatter(channels.raw(command), channels.segments)
    if declared.torque_noise is not None:
        torque_noise = 0.0 if unknown else declared.torque_noise
    elif not (unknown or isinstance(load, Pendulum)):
        torque_noise = _recorded_noise(channels, "torque")
    alone = channels.speed_only
    kernel = light.kernels[0 if alone else 1]
    return Resolution(
        position_step=0.0 if alone else step,
        position_noise=LEAST_NOISE if alone else noise,
        torque_noise=torque_noise,
        velocity_noise=noise * float(np.sqrt(np.sum(kernel**2))),
        torque_correlation_time=declared.torque_correlation_time or 0.0,
        torque_is_declared=declared.torque_noise is not None,
        effort_step=channels.step(command),
        effort_noise=effort_noise,
        effort_tells_load=tells_load,
        velocity_step=step if alone else 0.0,
        raw_velocity_noise=noise if alone else 0.0,
    )


def _recorded_noise(channels: Channels, name: str) -> float:
    """Standard deviation of one sample of `<joint>/name` as it was recorded."""
    return _noise(channels, name, channels.raw(name), channels.step(name))


def _noise(channels: Channels, name: str, values: FloatArray, step: float) -> float:
    """Standard deviation of one sample of `<joint>/name` (T,), as large as if the log's clock had sampled it."""
    ratios = channels.ratios(name)
    if max(ratios) > 1.0:
        return interpolated_noise(values, step, channels.segments, ratios)
    return sample_noise(values, step, channels.segments)
