"""Task-space inverse dynamics that stays feasible when the torques err: tasks, limits, contacts, programs, solvers."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
