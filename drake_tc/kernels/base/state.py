"""The state of a base estimator: its parts, and their places in one vector.

Without a decorator, as `equations`: `drake_tc.estimation.base_kinematics` uses it as it stands, and modules of kernels
compile `memory_of`.
"""

from typing import NamedTuple

from drake_tc.types import FloatArray

SCALARS = ("started", "yaw", "rested", "quiet", "stood", "paired", "mismatch", "ground")
STARTED, YAW, RESTED, QUIET, STOOD, PAIRED, MISMATCH, GROUND = range(8)
"""Scalars of a state, see `Memory`."""

CONTACT_MEMORY = ("on", "load", "dropped", "airborne", "sink", "shape", "held_for", "air_load")
ON, LOAD, DROPPED, AIRBORNE, SINK, SHAPE, HELD_FOR, AIR_LOAD = range(8)
"""Columns of `Memory.contacts`: carries load (0 or 1); load [N]; ticks until a contact that slipped counts again; ticks
in the air; how far its sole gives way [m], and the shape of that [-] (`soft_sole`); ticks since its reference was
taken; mean load in the air [N]."""

FLAGS = (
    "no_contact",
    "encoder_missing",
    "encoder_spike",
    "imu_missing",
    "wrench_missing",
    "yaw_drift",
    "load_mismatch",
    "inconsistent",
    "failed",
)
NO_CONTACT, ENCODER_MISSING, ENCODER_SPIKE, IMU_MISSING, WRENCH_MISSING = range(5)
YAW_DRIFT, LOAD_MISMATCH, INCONSISTENT, FAILED = range(5, 9)
"""Flags of the whole: nothing carries load, so the IMU alone carries the estimate; readings that are not finite (three
kinds of sensors); an encoder step that was not believed; the gyro turns against the contacts; loads and weight differ;
contacts were too far from their references, which were taken anew; a tick gave no numbers."""

CONTACT_FLAGS = ("on", "limited", "slip", "tilt", "force_offset")
TOUCHES, LIMITED, SLIPS, TILTED, FORCE_OFFSET = range(5)
"""Flags of each contact: carries load; its centre of pressure is at the sole's edge; slips and is left out; its foot is
tilted against the touch-down; its sensor shows load in the air."""

NUM_COLUMNS, NUM_FLAGS, NUM_CONTACT_FLAGS = 8, 9, 5


class Memory(NamedTuple):
    """Between two ticks. World W: z up, where the base started; base B; n joints, k contacts.

    Attributes:
        scalars: (8,) `SCALARS`. started: 1 after the first tick. yaw: Of the base [rad]. rested: Ticks that the robot
            has rested so far. quiet: Ticks since something moved. stood: Ticks in which contacts told the velocity, 0
            while none does. paired: Ticks in which two of them told yaw. mismatch: Mean of loads less weight [N].
            ground: Height of a level ground [m]; NaN before the first contact.
        position: (3,) p_WB [m].
        rotation: (3, 3) R_WB; its last row is the vertical in B.
        velocity: (3,) ydot, of B's origin in its axes [m/s].
        rate: (3,) omega_WB in B [rad/s].
        lever: (3,) velocity of the IMU against B's origin, in B [m/s].
        bias: (3,) of the gyro, its axes [rad/s].
        trail: (6,) low-passed [gyro; accel] (`imu_age`).
        velocity_innovation: (3,) by how much the contacts overruled the accelerometer's velocity, in B [m/s].
        usual: (k, 2) low-passed centre of pressure in C [m].
        held: (k, 3) where the centre of pressure is held, in W [m].
        foot: (k, 3, 3) R_WC with which the reference moves.
        foot_up: (k, 3) the vertical in C at touch-down.
        pressure: (k, 2) centre of pressure in C [m].
        drift: (k, 3) averaged velocity against the others, in B [m/s].
        contacts: (k, 8) `CONTACT_MEMORY`.
        q: (n,) last believed [rad].
        qd: (n,) the same [rad/s].
        doubt: (n,) ticks for which an encoder was not believed.
        flags: (9,) `FLAGS`.
        contact_flags: (k, 5) `CONTACT_FLAGS`.
    """

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


def size_of(n: int, k: int) -> int:
    """Numbers in the state of n joints and k contacts."""
    return 41 + NUM_FLAGS + 3 * n + (22 + NUM_COLUMNS + NUM_CONTACT_FLAGS) * k


def memory_of(vector: FloatArray, n: int, k: int) -> Memory:
    """The parts of a state, as views.

    Args:
        vector: (`size_of`,).
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
