"""A controller without a plant against a robot: stepped tick by tick, and against wall-clock time.

torque_controller(...) --> RealTimeLoop --> a link: two functions of your own (CallbackLink), or LCM (LcmLink)
"""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
