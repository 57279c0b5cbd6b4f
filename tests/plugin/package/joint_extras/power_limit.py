"""The mechanical power of every joint stays below a limit: tau_j qd_j <= P."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import number
from drake_tc.tsid.kinds import LimitKind
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import LimitRows, Parts, Terms


class PowerLimit:
    """-inf <= diag(qd) tau <= P, one row a joint [W]."""

    name, group = "joint power", "torque"

    def __init__(self, model: TsidModel, period: float, *, watts: float) -> None:
        if watts <= 0.0:
            raise ParamsError(f"watts: expected a number > 0, got {watts:g}")
        self._watts, self._joints = watts, model.actuated
        self._labels = tuple(f"{joint} power" for joint in model.robot.joints)

    def rows(self, terms: Terms) -> LimitRows:
        """The rows at this state."""
        n = self._joints.size
        matrix = Parts(torque=np.diag(terms.v[self._joints]))
        return LimitRows(self.name, self.group, matrix, np.full(n, -np.inf), np.full(n, self._watts), self._labels)


JOINT_POWER = LimitKind(PowerLimit, required={"watts": number})
