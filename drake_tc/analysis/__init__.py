"""Stability of sampled torque loops: linearisation, margins, one joint in closed form, limit cycles."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
