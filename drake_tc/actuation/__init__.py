"""Drives and effects joined into actuator models, and the system that puts them before a plant."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
