"""A robot as data: URDF and one YAML file become plants, joint order, limits and sensor frames."""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
