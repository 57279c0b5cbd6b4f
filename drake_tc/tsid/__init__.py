"""Task-space inverse dynamics that stays feasible when the torques err: tasks, limits, contacts, programs, solvers."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.tsid.configuration import load_law
    from drake_tc.tsid.controller import RobustTsid
    from drake_tc.tsid.law import Law
    from drake_tc.tsid.limit_fields import LimitKind, register_limit
    from drake_tc.tsid.task_fields import TaskKind, register_task

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
    "LimitKind": "limit_fields",
    "RobustTsid": "controller",
    "TaskKind": "task_fields",
    "load_law": "configuration",
    "register_limit": "limit_fields",
    "register_task": "task_fields",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
