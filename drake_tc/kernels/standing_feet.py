"""The recursion of feet that stand, but for the robot's kinematics, see `drake_tc.sensor_validation.standing_feet`.

State: [flag; time without an IMU; joint speed; tilts of the soles (2 s); angular velocity of the base (3); link angles
(n); 1 once there was a tick].
"""

import math
from typing import Any

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, REAL, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

FLAG, ABSENT, SPEED, TILTS = 0, 1, 2, 3
"""Where they begin in the state."""
READING, TILT, STATE = 0, 6, 8
"""Where the reading, the tilt of the IMU, and flag and loss of the state begin in the outputs."""
STEEPEST = 0.1
"""Tilt of a sole beyond which its springs have long let go of the floor at one end [rad]."""
PERIOD, MEMORY, SINKING, BLEND, POSITIONS = 0, 1, 2, 3, 4
"""Places in the options: period [s], share of a speed that is remembered, shares of new tilts and of other new values,
number of positions before the velocities in a state."""


@helper
def finite(values: FloatArray) -> bool:
    """Whether all are."""
    found = True
    for value in values:
        found = found and math.isfinite(value)
    return found


@kernel(VECTOR, VECTOR, REAL, OUT_VECTOR)
def shown(imu: FloatArray, held: FloatArray, lost: float, out: FloatArray) -> bool:
    """The outputs as far as they need no kinematics.

    Args:
        imu: (6,).
        held: The state.
        lost: Time without an IMU after which it is lost [s].
        out: (10,) the reading and no tilt; flag, and 1 for a loss; written.

    Returns:
        Whether there is an IMU.
    """
    out[READING:TILT] = imu
    out[TILT:STATE] = math.nan
    out[STATE], out[STATE + 1] = held[FLAG], 1.0 if held[ABSENT] > lost else 0.0
    return finite(imu)


SOLES = together(INDEX, INDEX, MATRIX)
"""(s,) which sensor has the load of a sole, (s,) which contact it is, (s, 2) compliance [rad/(N m)]."""


@kernel(VECTOR, VECTOR, SOLES, OUT_VECTOR)
def sunk(wrench: FloatArray, pressure: FloatArray, soles: tuple[Any, ...], out: FloatArray) -> None:
    """Tilts of the soles towards their centres of pressure.

    Args:
        wrench: (6 k,) [N, N m].
        pressure: (2 c,) centres of pressure of the contacts [m].
        soles: See `SOLES`.
        out: (2 s,) [rad], written.
    """
    sensors, contacts, compliance = soles
    for i in range(sensors.size):
        force = wrench[6 * sensors[i] : 6 * sensors[i] + 3]
        load = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
        for axis in range(2):
            tilt = compliance[i, axis] * load * pressure[2 * contacts[i] + axis]
            if tilt > STEEPEST:
                tilt = STEEPEST
            elif tilt < -STEEPEST:
                tilt = -STEEPEST
            out[2 * i + axis] = tilt


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR), VECTOR, SOLES, VECTOR, together(OUT_VECTOR, OUT_VECTOR))
def advance(
    given: tuple[FloatArray, ...],
    held: FloatArray,
    soles: tuple[Any, ...],
    options: FloatArray,
    written: tuple[FloatArray, FloatArray],
) -> bool:
    """The next state, with a flag of 0.

    Args:
        given: (6,) IMU, (6 k,) wrenches, (2 c,) centres of pressure, (nq + nv,) estimate [q; v], (n,) angles of the
            links [rad].
        held: The state.
        soles: See `SOLES`.
        options: (5,) see `PERIOD` and what follows it.
        written: The next state; (n,) rates of the link angles [rad/s], 0 in the first tick.

    Returns:
        Whether there is an IMU.
    """
    (imu, wrench, pressure, state, angles), (after, rates), sensors = given, written, soles[0]
    n, begun, there, first = angles.size, held[-1] > 0.0, finite(imu), TILTS + 2 * sensors.size
    after[FLAG], after[ABSENT] = 0.0, 0.0 if there else held[ABSENT] + options[PERIOD]
    sunk(wrench, pressure, soles, after[TILTS:first])
    for i in range(TILTS, first):
        after[i] = held[i] + options[SINKING] * (after[i] - held[i])
    for i in range(3 + n):
        value = state[int(options[POSITIONS]) + i] if i < 3 else angles[i - 3]
        after[first + i] = held[first + i] + options[BLEND] * (value - held[first + i]) if begun else value
    squared = 0.0
    for j in range(n):
        at = first + 3 + j
        rates[j] = options[BLEND] * (angles[j] - held[at]) / options[PERIOD] if begun else 0.0
        squared += rates[j] * rates[j]
    speed, remembered = math.sqrt(squared / n), held[SPEED] * options[MEMORY]
    after[SPEED] = remembered if remembered > speed else speed
    after[-1] = 1.0
    return there
