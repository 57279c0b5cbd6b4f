"""Torque control of position-controlled robots in Drake, with models that are checked against measured data.

What a user types stands in `__all__`; each name is imported when it is first used, so `import drake_tc` costs nothing.
The same names stand in the packages below: `drake_tc.control.GuardSpec` is `drake_tc.GuardSpec`.
"""

from drake_tc.front_door import front_door

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = front_door(__name__)
