"""The motion with which the design of one joint is compared: a growing sinusoid within the same limits."""

import numpy as np

from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.types import FloatArray

DEFAULT_HZ = 0.4
"""Frequency of the growing sinusoid with which a design is compared [Hz]."""
SHRINKING, LEAST_DEFAULT = 0.95, 1e-3
"""Factor by which this sinusoid is made smaller until it keeps jerk and torque, and its least share of the span."""


def default_motion(joint: DesignJoint, limits: JointLimits, duration: float, step: float) -> FloatArray:
    """(4, T) growing sinusoid of the same length and limits, which fills them at its end.

    Args:
        joint: Whose motor has the torque limit.
        limits: Of position, speed, acceleration, jerk and torque.
        duration: Of the motion [s].
        step: Time between its samples [s].
    """
    time: FloatArray = np.asarray(np.arange(round(duration / step)) * step, dtype=np.float64)
    low, high = limits.position
    bounds = MotionLimits(limits.position, limits.velocity, limits.acceleration)
    half = 0.5 * (high - low)
    while True:
        made = growing_sinusoid(time, DEFAULT_HZ, 0.05 * half, 0.95 * half / duration, bounds, 0.5 * (low + high))
        jerk = np.gradient(made.acceleration, step)
        motion = np.stack([made.position, made.velocity, made.acceleration, jerk])
        kept = np.abs(jerk).max() <= limits.jerk and np.abs(joint.motor_torque(motion, step)).max() <= limits.torque
        if kept or half < LEAST_DEFAULT * (high - low):
            return motion
        half *= SHRINKING
