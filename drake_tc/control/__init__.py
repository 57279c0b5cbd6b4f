"""Torque control through a drive that was not made for it: gains, inverse dynamics, torque loop, safety."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
