"""Two joints move alike: the difference of their positions is held at a value."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import names, number
from drake_tc.tsid.kinds import TaskKind
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, Terms
from drake_tc.types import FloatArray


class MirrorTask:
    """qdd_a - qdd_b = kp (d - (q_a - q_b)) - kd (qd_a - qd_b); reference (1,): d [rad]."""

    reference_size = 1

    def __init__(
        self, model: TsidModel, *, joints: tuple[str, ...], kp: float, kd: float, weight: float = 1.0, name: str
    ) -> None:
        known = model.robot.joints
        if len(joints) != 2 or not set(joints) <= set(known):
            raise ParamsError(f"joints: expected two of {', '.join(known)}, got {', '.join(joints)}")
        self.name, self.weight = name, np.array([weight])
        self._kp, self._kd = kp, kd
        first, second = (known.index(joint) for joint in joints)
        self._positions = model.positions[[first, second]]
        self._velocities = model.actuated[[first, second]]
        row = np.zeros((1, model.nv))
        row[0, self._velocities] = [1.0, -1.0]
        self._parts = Parts(vdot=row)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference when its port is not connected: the difference at the robot's start."""
        first, second = terms.q[self._positions]
        return np.array([first - second])

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The row at this state: matrix times vdot shall be the target."""
        first, second = terms.q[self._positions]
        first_velocity, second_velocity = terms.v[self._velocities]
        target = self._kp * (reference - (first - second)) - self._kd * (first_velocity - second_velocity)
        return TaskRows(self.name, self._parts, target, self.weight)


MIRROR = TaskKind(
    MirrorTask,
    required={"joints": names, "kp": number, "kd": number},
    optional={"weight": number},
)
