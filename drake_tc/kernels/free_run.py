"""One joint's actuator on a pendulum or a rotor over a whole run, see `drake_tc.actuation.free_run`."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels import joint_layout as at
from drake_tc.kernels.actuator import TABLES, Inputs, Tables, begin, drive, finish, resist
from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, VECTOR, kernel
from drake_tc.types import FloatArray

STEP, SUBSTEPS, MOVED, MOMENT, ZERO, KNOWN, START, VELOCITY, CENTRE, LIMIT = range(10)


@kernel(MATRIX, TABLES, VECTOR, OUT_VECTOR, OUT_VECTOR)
def positions(
    samples: FloatArray, constants: tuple[Any, ...], plant: FloatArray, memory: FloatArray, out: FloatArray
) -> None:
    """Position (T,) [rad] into out, which stays as it is from where the joint has left its range.

    Args:
        samples: (T, 4) command, load [N m], its change in a step, and temperature [deg C].
        constants: `actuator.Tables` of the joint, whose effects all have a compiled equation.
        plant: h, steps in a sample, inertia that is moved, moment of the pendulum's weight and where it hangs, 1 where
            the load is all that the gear transmits, position and velocity at the start, middle and half of the range.
        memory: (m,) of the joint, which has started; updated.
        out: Written.
    """
    tables = Tables(*constants)
    q, v, work = plant[START], plant[VELOCITY], np.zeros(at.WORK)
    for k in range(samples.shape[0]):
        out[k] = q
        for n in range(int(plant[SUBSTEPS])):
            outside = samples[k, 1] + n * samples[k, 2]
            load = outside if plant[KNOWN] else np.nan
            now = Inputs(samples[k, 0], q, v, load, samples[k, 3], True)
            begin(memory, tables, 0, now, work)
            if work[at.STATUS] == 0.0:
                return
            resist(memory, tables, 0, samples[k, 3], work)
            drive(memory, tables, 0, work)
            torque = finish(memory, tables, 0, now, work)[0]
            v += plant[STEP] * (torque - plant[MOMENT] * math.sin(q - plant[ZERO]) - outside) / plant[MOVED]
            q += plant[STEP] * v
        if not abs(q - plant[CENTRE]) <= plant[LIMIT]:
            return
