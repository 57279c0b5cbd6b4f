"""The robot at one state, as everything in a tick shares it."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.types import FloatArray, IntArray

Pose = tuple[FloatArray, FloatArray]
"""(3, 3) R_WF and (3,) p_WoFo_W [m]."""


@dataclass(frozen=True, eq=False)
class FrameTerms:
    """A frame F of the robot: where it is, how it moves, and how it would accelerate.

    Attributes:
        rotation: (3, 3) R_WF.
        position: (3,) p_WoFo_W [m].
        velocity: (6,) V_WF = [omega; v] in world axes.
        jacobian: (6, nv) V_WF = J v.
        bias: (6,) [alpha; a] at vdot = 0, so A_WF = J vdot + bias.
    """

    rotation: FloatArray
    position: FloatArray
    velocity: FloatArray
    jacobian: FloatArray
    bias: FloatArray


@dataclass(frozen=True, eq=False)
class Terms:
    """M vdot + h = S^T tau + J^T f at one state (Del Prete et al., 2016, eq. 1).

    There are n driven joints, nv velocities and k contact forces.

    Attributes:
        q, v: (nq,), (nv,) in the plant's order, a floating base first (quaternion, position; omega, velocity).
        mass_matrix: (nv, nv) M, with the reflected rotor inertia of the robot file.
        bias: (nv,) h: Coriolis, centrifugal and gravity.
        actuated: (n,) index in v of each joint, in the robot's order; S^T tau puts tau there.
        joint_position: (n,) in the robot's order [rad].
        contact_jacobian: (k, nv) J of the contacts that are active, one after the other; rows as its contact says.
        contact_bias: (k,) Jdot v.
        contact_velocity: (k,) J v: zero unless a contact slips.
        mass: Of the robot [kg].
        com, com_velocity: (3,) in the world [m, m/s].
        momentum_matrix: (6, nv) A_G: [angular; linear] momentum about the centre of mass, in world axes, = A_G v.
        momentum_bias: (6,) Adot_G v.
        frame: Terms of a frame by name (a link, a contact or an added frame); those that are never asked for cost
            nothing. Good until the scratch memory goes to another state, as is `pose`.
        pose: R_WF and p_WF of a frame by name, for less than `frame`.
        contacts: Which contacts are active, and where each stands in f.
    """

    q: FloatArray
    v: FloatArray
    mass_matrix: FloatArray
    bias: FloatArray
    actuated: IntArray
    joint_position: FloatArray
    contact_jacobian: FloatArray
    contact_bias: FloatArray
    contact_velocity: FloatArray
    mass: float
    com: FloatArray
    com_velocity: FloatArray
    momentum_matrix: FloatArray
    momentum_bias: FloatArray
    frame: Callable[[str], FrameTerms] = field(repr=False)
    pose: Callable[[str], Pose] = field(repr=False)
    contacts: ActiveContacts

    @property
    def com_jacobian(self) -> FloatArray:
        """(3, nv) of the centre of mass: the linear rows of A_G over the mass."""
        jacobian: FloatArray = self.momentum_matrix[3:] / self.mass
        return jacobian

    @property
    def com_bias(self) -> FloatArray:
        """(3,) Jdot_com v [m/s^2]."""
        bias: FloatArray = self.momentum_bias[3:] / self.mass
        return bias
