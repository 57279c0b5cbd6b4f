"""Control loops wired from the library's systems: torque loop, whole-body loop, series-elastic joint, joint bench.

All loops pass the same way, and each step of it is one class:

    ScenarioBase (file) -> LoopBuilder (stages) -> WiredLoop -> BuiltLoop (diagram) -> Recording -> Simulated (command)

The torque loop, the whole-body loop and the series-elastic loop extend these classes, each in its folder, and are
three for what the steps hold, not for how they work:

- Their scenarios have different keys. One class for all would accept the keys of every loop in each file, where an
  unknown key is now an error that names the nearest one.
- They are built around different things: a robot and its drives, a law with its contacts, a motor with its spring.
- They end differently: a torque loop runs away by the speed of a joint, a humanoid falls, a motor runs away behind its
  spring. What follows from a run, such as tracking, probabilities or the delayed torque, is computed from that.

A diagram of the user's own needs none of this; `function_entry` gives one to the commands.
"""

from drake_tc.front_door import front_door

__all__, __getattr__, __dir__ = front_door(__name__)
