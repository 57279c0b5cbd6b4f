"""The state of a base estimator as a vector, and the parts of one that a tick reads and writes.

A state is [scalars; arrays], in the order of `drake_tc.estimation.base.state.BaseState`, n joints and k contacts.
"""

from typing import NamedTuple

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray

STARTED, YAW, RESTED, QUIET, STOOD, PAIRED, MISMATCH, GROUND = range(8)
"""Scalars of a state."""
ON, LOAD, DROPPED, AIRBORNE, SINK, SHAPE, HELD_FOR, AIR_LOAD = range(8)
"""Columns of `Memory.contacts`."""
NO_CONTACT, ENCODER_MISSING, ENCODER_SPIKE, IMU_MISSING, WRENCH_MISSING = range(5)
YAW_DRIFT, LOAD_MISMATCH, INCONSISTENT, FAILED = range(5, 9)
"""Flags of the whole."""
TOUCHES, LIMITED, SLIPS, TILTED, FORCE_OFFSET = range(5)
"""Flags of a contact."""
NUM_FLAGS, NUM_CONTACT_FLAGS, NUM_COLUMNS = 9, 5, 8


class Memory(NamedTuple):
    """Views into a state, see `BaseState`; `scalars` (8,)."""

    scalars: FloatArray
    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    rate: FloatArray
    lever: FloatArray
    bias: FloatArray
    trail: FloatArray
    velocity_innovation: FloatArray
    usual: FloatArray
    held: FloatArray
    foot: FloatArray
    foot_up: FloatArray
    pressure: FloatArray
    drift: FloatArray
    contacts: FloatArray
    q: FloatArray
    qd: FloatArray
    doubt: FloatArray
    flags: FloatArray
    contact_flags: FloatArray


@helper
def memory_of(vector: FloatArray, n: int, k: int) -> Memory:
    """The parts of a state.

    Args:
        vector: (50 + 3n + 35k,).
        n: Joints.
        k: Contacts.
    """
    usual = 41
    held = usual + 2 * k
    foot, foot_up = held + 3 * k, held + 12 * k
    pressure = foot_up + 3 * k
    drift = pressure + 2 * k
    contacts = drift + 3 * k
    q = contacts + NUM_COLUMNS * k
    flags = q + 3 * n
    contact_flags = flags + NUM_FLAGS
    return Memory(
        vector[:8],
        vector[8:11],
        vector[11:20].reshape(3, 3),
        vector[20:23],
        vector[23:26],
        vector[26:29],
        vector[29:32],
        vector[32:38],
        vector[38:41],
        vector[usual:held].reshape(k, 2),
        vector[held:foot].reshape(k, 3),
        vector[foot:foot_up].reshape(k, 3, 3),
        vector[foot_up:pressure].reshape(k, 3),
        vector[pressure:drift].reshape(k, 2),
        vector[drift:contacts].reshape(k, 3),
        vector[contacts:q].reshape(k, NUM_COLUMNS),
        vector[q : q + n],
        vector[q + n : q + 2 * n],
        vector[q + 2 * n : flags],
        vector[flags:contact_flags],
        vector[contact_flags:].reshape(k, NUM_CONTACT_FLAGS),
    )
