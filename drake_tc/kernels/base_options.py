"""What a tick of the base estimator is told, as names for the places of its tables."""

from typing import NamedTuple

from drake_tc.kernels.compiling import INDEX, MATRIX, TABLE, VECTOR, helper
from drake_tc.types import FloatArray

FLAT, MAKE, BREAK, STIFFNESS, ORIGIN, STEP, MIDDLE, HALF_PLANES = 0, 1, 2, 3, 4, 6, 8, 10
"""Columns of a contact's row: 1 for a sole, 0 for a point; loads at which it is made and lost [N]; stiffness of a soft
sole [N/m], 0 of a rigid one; first node and step of its table [m] (2 each); middle of the sole [m] (2); then rows
[normal (2), offset [m]] of the half planes that it is made of."""
TRANSFORM, WEIGHT = 36, 54
"""Ends of the parts of a contact's load: from its sensor to it (6, 6), and weight beyond the sensor (6, 3) [kg]."""


SAMPLE = (VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
"""Types of a sample's parts, see `drake_tc.estimation.base.state.Sample`."""
ROBOT = (MATRIX, TABLE, MATRIX, MATRIX, INDEX)
"""Types of a robot's tables: between (k, 54), see `external_wrench`; places (n, 4) and constants (n, 26) of its tree,
see `drake_tc.kernels.dynamics`; frames (k + 1, 12) of the contacts and the IMU, and rows (k + 1,) of their bodies."""


class Options(NamedTuple):
    """`BaseEstimatorSpec`, with 0 or 1 for choices; whether any sole is soft; the robot's weight [N]."""

    period: float
    imu_age: float
    level: float
    touchdown: float
    velocity_time: float
    contact_velocity: float
    cop_moment: float
    position_time: float
    yaw_time: float
    yaw_bias_time: float
    bias_time: float
    tilt_time: float
    sole_time: float
    still_rate: float
    anchor_time: float
    slip_speed: float
    slip_distance: float
    slip_turn: float
    slip_time: float
    slip_hold: float
    tilted: float
    force_offset: float
    yaw_drift: float
    encoder_spike: float
    quick_start: float
    any_soft: float
    weight: float


@helper
def options_of(row: FloatArray) -> Options:
    """Names for the places of a row."""
    return Options(
        row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12],
        row[13], row[14], row[15], row[16], row[17], row[18], row[19], row[20], row[21], row[22], row[23], row[24],
        row[25], row[26],
    )  # fmt: skip
