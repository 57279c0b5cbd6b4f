"""Sensor models: what encoders, IMUs and force/torque sensors make of the truth."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
