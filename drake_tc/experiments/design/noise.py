"""Noise that a diagnosis will find in a run that has not been recorded yet.

A diagnosis filters a fast run less than a slow one, to keep the form of its columns. The acceleration of the fast run
is therefore noisier. With w, f, s and n/t of the logs and w', f', s' and n'/t of the future run,

    s'^2 = f'^2 + s^2 - f^2,   n'/t = (n/t) w/w'

w: width of both filters together [s]; f: noise floor [N m]; s: residual that noise and everything that no effect
explains leave [N m]; n/t: independent samples per second [1/s].
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from drake_tc.diagnosis.data.clocks import timing_moments
from drake_tc.diagnosis.data.preparation import final_kernel
from drake_tc.diagnosis.data.resolution import NoiseFloor, final_widths, light_width
from drake_tc.effects.base import Signals
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray


def measured_as(joint: DesignJoint, motion: FloatArray, step: float) -> DesignJoint:
    """The joint with the filters, the noise and the number of independent samples of a run with this motion.

    The joint is returned unchanged if the noise of its sensors is not known from a log, or if the logs contain its
    speed and not its position.

    Args:
        joint: With the noise of its logs.
        motion: (4, T) position [rad] and its three derivatives.
        step: Time between the samples of the motion [s].
    """
    return measured_together((joint,), (motion,), step)[0]


def measured_together(
    joints: Sequence[DesignJoint], motions: Sequence[FloatArray], step: float
) -> tuple[DesignJoint, ...]:
    """The same of several runs, which a diagnosis filters alike: the joint under the load of each of them.

    Args:
        joints: The joint under each load, with the noise of its logs.
        motions: (4, T) of each run.
        step: Time between the samples of the motions [s].
    """
    joint = joints[0]
    resolution, period = joint.resolution, joint.context.period
    if resolution is None or resolution.raw_velocity_noise > 0.0 or not period > 0.0:
        return tuple(joints)
    runs = [_sampled(motion, step, period) for motion in motions]
    ends = np.cumsum([run.shape[1] for run in runs])
    stretches = [slice(end - run.shape[1], end) for run, end in zip(runs, ends, strict=True)]
    q, v, a, _ = np.concatenate(runs, axis=1)
    noise, timing = resolution.position_noise, resolution.timing
    if timing is not None:
        noise = timing.position_noise(float(np.sqrt(np.mean(v**2))))
    light = CommonKernel(light_width(q, noise, stretches, period), period)
    # as in `build_samples`: a fit without inertia has no use for a wider filter
    no_inertia = joint.context.load == "torque" and "rotor_inertia" not in joint.context.declared
    moving = np.abs(v) > joint.slowest
    final = final_kernel(moving, stretches, light, final_widths(a, 0.0 if no_inertia else noise, light))
    signals = _joined([each.signals(run, period) for each, run in zip(joints, runs, strict=True)])
    servo = joint.context.drive == "position_servo"
    rows = np.flatnonzero(moving)
    moments = None
    if timing is not None:
        second, first = (np.convolve(light.kernels[d], final.kernels[0]) for d in (2, 1))
        moments = timing_moments(timing.time, ((v, second), (v, first), (np.zeros_like(v), second)), rows)
    floor = NoiseFloor.of(resolution, light, final, signals, rows, servo=servo, timing=moments)
    left = floor.torque(1.0 / joint.numbers.gain, joint.numbers.viscous)
    beyond = max(joint.noise**2 - joint.floor**2, 0.0)
    widths = [np.hypot(joint.kernel_width, joint.final_width), np.hypot(light.actual_width_s, final.actual_width_s)]
    return tuple(
        replace(
            each,
            noise=float(np.hypot(left, np.sqrt(beyond))),
            floor=left,
            independent_per_second=joint.independent_per_second * float(widths[0] / widths[1]),
            kernel_width=light.actual_width_s,
            final_width=final.actual_width_s,
        )
        for each in joints
    )


def _sampled(motion: FloatArray, step: float, period: float) -> FloatArray:
    """(4, n) the motion at the period of the logs, its jerk left out."""
    grid = np.arange(motion.shape[1]) * step
    spline = CubicHermiteSpline(grid, motion[0], motion[1])
    time: FloatArray = np.asarray(np.arange(int(grid[-1] / period)) * period, dtype=np.float64)
    return np.stack([spline(time), spline(time, 1), np.interp(time, grid, motion[2]), np.zeros_like(time)])


def _joined(parts: Sequence[Signals]) -> Signals:
    """Signals of several runs one after the other; what a log has one value of is the mean."""
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Signals)
        if isinstance(getattr(parts[0], f.name), np.ndarray)
    }
    return replace(parts[0], **rows, link_inertia=float(np.mean([part.link_inertia for part in parts])))
