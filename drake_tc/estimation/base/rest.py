"""Whether the robot rests, and what the gyro's bias is while it does.

It rests when for `_LONG` joints and base have moved less than `still_rate` and the centres of pressure have stayed
where they usually are: a robot that rocks slowly moves its load over its soles long before its gyro tells it from a
bias.
"""

import numpy as np

from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import BaseState
from drake_tc.estimation.base.valid_sample import ValidSample
from drake_tc.types import FloatArray

USUAL_TIME = 0.3
"""Over which centres of pressure are averaged [s]."""
_LONG = 0.1
"""How long it must have been still [s]."""
_STRAY = 5e-3
"""How far a centre of pressure may be from its average [m]."""
_DOUBT = 0.02
"""What a bias of zero counts for, before any is seen [s]."""


def rest(state: BaseState, sample: ValidSample, spec: BaseEstimatorSpec) -> tuple[float, float, FloatArray]:
    """(ticks that the robot has rested so far, ticks since something moved, (3,) bias of the gyro [rad/s]).

    Args:
        state: Before the tick.
        sample: Readings after validation.
        spec: Tuning.
    """
    qd = sample.qd
    if sample.imu_missing or qd @ qd > qd.size * spec.still_rate**2:  # so one of them at least is too fast
        return state.rested, 0.0, state.bias
    error = sample.gyro - state.bias
    if not (np.abs(error).max() < spec.still_rate and np.abs(qd).max() < spec.still_rate):
        return state.rested, 0.0, state.bias
    on = state.contacts[:, 0] > 0.0
    if not on.any() or np.abs(state.pressure - state.usual)[on].max() > _STRAY:
        return state.rested, 0.0, state.bias
    quiet = state.quiet + 1.0
    if quiet * spec.period < _LONG:
        return state.rested, quiet, state.bias
    rested = state.rested + 1.0
    share = max(1.0 / (rested + _DOUBT / spec.period), min(1.0, spec.period / spec.bias_time))
    return rested, quiet, state.bias + share * error
