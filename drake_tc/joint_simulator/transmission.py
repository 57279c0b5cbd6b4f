"""The gear between motor and link where it is not rigid: a gap, a soft spring, or both, between two masses."""

from dataclasses import dataclass

import numpy as np

from drake_tc.joint_simulator.spec import RigSpec
from drake_tc.types import FloatArray, IntArray

RIGID_STIFFNESS = 4e5  # [N m/rad], of a gear that has a gap but is otherwise stiff
DAMPING_RATIO = 0.5


@dataclass(frozen=True)
class TwoMassGear:
    """tau = k d + c ddot outside the gap, where d = (q_m - q_l) -/+ half gap; it can push but not pull.

    Attributes:
        index: (m,) columns with two masses.
        half_gap: (m,) [rad].
        stiffness: k (m,) [N m/rad].
        damping: c (m,) [N m s/rad].
    """

    index: IntArray
    half_gap: FloatArray
    stiffness: FloatArray
    damping: FloatArray

    @classmethod
    def of(cls, specs: list[RigSpec]) -> "TwoMassGear":
        """The gears of all columns that have `backlash` or `elasticity`."""
        index = np.array([i for i, spec in enumerate(specs) if spec.link_side], dtype=np.int64)
        gap = np.zeros(index.size)
        stiffness = np.full(index.size, RIGID_STIFFNESS)
        damping = np.zeros(index.size)
        for row, i in enumerate(index):
            causes, joint = specs[i].causes, specs[i].joint
            if "backlash" in causes:
                gap[row] = causes["backlash"]["half_gap"]
            if "elasticity" in causes:
                stiffness[row] = 1.0 / causes["elasticity"]["compliance"]
            reduced = 1.0 / (1.0 / joint.rotor_inertia + 1.0 / joint.link_inertia)
            damping[row] = 2.0 * DAMPING_RATIO * np.sqrt(stiffness[row] * reduced)
        return cls(index, gap, stiffness, damping)

    def torque(self, twist: FloatArray, rate: FloatArray) -> FloatArray:
        """Transmitted torque (m,) from q_m - q_l and its rate.

        The contact only pushes: where k d + c ddot would pull the teeth together, the torque is zero. Without
        a gap the spring is bilateral.
        """
        depth = twist - np.clip(twist, -self.half_gap, self.half_gap)
        torque = self.stiffness * depth + self.damping * rate * (depth != 0.0)
        pulling = (self.half_gap > 0.0) & (torque * depth < 0.0)
        return np.asarray(np.where(pulling, 0.0, torque))
