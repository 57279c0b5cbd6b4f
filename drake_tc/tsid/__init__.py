"""Task-space inverse dynamics that stays feasible when the torques err: tasks, limits, contacts, programs, solvers."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.tsid.configuration import load_law
    from drake_tc.tsid.controller import RobustTsid
    from drake_tc.tsid.kinds import LimitKind, TaskKind, register_limit, register_task
    from drake_tc.tsid.law import Law

__all__ = [
    "Law",
    "LimitKind",
    "RobustTsid",
    "TaskKind",
    "load_law",
    "register_limit",
    "register_task",
]

_HOMES = {
    "Law": "law",
    "LimitKind": "kinds",
    "RobustTsid": "controller",
    "TaskKind": "kinds",
    "load_law": "configuration",
    "register_limit": "kinds",
    "register_task": "kinds",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
