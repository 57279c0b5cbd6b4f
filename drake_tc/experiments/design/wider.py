"""Which limit stands in the way of a goal: the criterion of rough motions, each limit in turn twice as wide."""

from dataclasses import replace

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import MotionBasis, motion_basis, scaled
from drake_tc.experiments.design.criteria import Criterion
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.solve import random_start, sharp_value, single_waves

TRIES = 8
"""Random motions within each set of limits."""


def what_limits(joint: DesignJoint, limits: JointLimits, criterion: Criterion, basis: MotionBasis, seed: int) -> str:
    """One sentence: the limit whose doubling brings most, by the best of the same random motions and single waves.

    Args:
        joint: The joint.
        limits: That were kept.
        criterion: log of a squared distance.
        basis: Kind, period and step of the motion.
        seed: Of the random motions.
    """
    before = _best(joint, limits, criterion, basis, seed)
    low, high = limits.position
    half = 0.5 * (high - low)
    wider = {
        "the position limits": replace(limits, position=(low - half, high + half)),
        "the speed": replace(limits, velocity=2.0 * limits.velocity),
        "the acceleration": replace(limits, acceleration=2.0 * limits.acceleration),
        "the bandwidth": replace(limits, bandwidth_hz=2.0 * limits.bandwidth_hz),
        "acceleration, torque and bandwidth together": replace(
            limits,
            acceleration=2.0 * limits.acceleration,
            torque=2.0 * limits.torque,
            bandwidth_hz=2.0 * limits.bandwidth_hz,
        ),
    }
    gains = {name: _best(joint, each, criterion, basis, seed) - before for name, each in wider.items()}
    name, gain = max(gains.items(), key=lambda pair: pair[1])
    if not gain > np.log(1.2):
        return (
            "Twice as wide limits would not bring the two much further apart; the distance grows with the square root "
            "of the length of the experiment."
        )
    return (
        f"The limits, and not the search, keep the two close: of all limits, doubling {name} helps most and makes the "
        f"distance {float(np.exp(0.5 * gain)):.2g} times as large."
    )


def _best(joint: DesignJoint, limits: JointLimits, criterion: Criterion, basis: MotionBasis, seed: int) -> float:
    """The largest value of rough motions within limits; minus infinity where none keeps them."""
    rng = np.random.default_rng(seed)
    step = min(basis.step, 0.02 / limits.bandwidth_hz)
    own = scaled(motion_basis(basis.kind, basis.period, step, limits.bandwidth_hz), limits)
    found = -np.inf
    try:
        motions = [random_start(joint, own, limits, rng) for _ in range(TRIES)] + single_waves(joint, own, limits)
        for x in motions:
            found = max(found, sharp_value(joint, criterion, own, x))
    except ParamsError:
        pass
    return found
