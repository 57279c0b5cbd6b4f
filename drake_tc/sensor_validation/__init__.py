"""Sensors checked before they are used, and what stands in for those that fail."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
