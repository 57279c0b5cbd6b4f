"""Torque control through a drive that was not made for it: gains, inverse dynamics, torque loop, safety."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.control.gains import TorqueGains
    from drake_tc.control.guard import CommandGuard, GuardSpec
    from drake_tc.control.inverse_dynamics import InverseDynamics
    from drake_tc.control.reference_source import ReferenceSource
    from drake_tc.control.references import PointToPoint, Slerp, Swing
    from drake_tc.control.torque_control import TorqueControl
    from drake_tc.control.torque_law import CompensationSpec
    from drake_tc.control.trajectories import (
        Chain,
        PosePath,
        Sinusoid,
        constant_trajectory,
        knot_trajectory,
        sinusoid_trajectory,
    )

__all__ = [
    "Chain",
    "CommandGuard",
    "CompensationSpec",
    "GuardSpec",
    "InverseDynamics",
    "PointToPoint",
    "PosePath",
    "ReferenceSource",
    "Sinusoid",
    "Slerp",
    "Swing",
    "TorqueControl",
    "TorqueGains",
    "constant_trajectory",
    "knot_trajectory",
    "sinusoid_trajectory",
]

_HOMES = {
    "Chain": "trajectories",
    "CommandGuard": "guard",
    "CompensationSpec": "torque_law",
    "GuardSpec": "guard",
    "InverseDynamics": "inverse_dynamics",
    "PointToPoint": "references",
    "PosePath": "trajectories",
    "ReferenceSource": "reference_source",
    "Sinusoid": "trajectories",
    "Slerp": "references",
    "Swing": "references",
    "TorqueControl": "torque_control",
    "TorqueGains": "gains",
    "constant_trajectory": "trajectories",
    "knot_trajectory": "trajectories",
    "sinusoid_trajectory": "trajectories",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
