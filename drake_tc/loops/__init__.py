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

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.loops.function_diagram import function_entry
    from drake_tc.loops.plant import add_robot_plant
    from drake_tc.loops.scenarios import FilterSpec
    from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
    from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop, series_elastic_controller
    from drake_tc.loops.torque.scenario import TorqueLoopSpec
    from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
    from drake_tc.loops.whole_body.scenario import WholeBodySpec
    from drake_tc.loops.whole_body.wiring import add_whole_body_loop, whole_body_controller

__all__ = [
    "FilterSpec",
    "SeriesElasticLoopSpec",
    "TorqueLoopSpec",
    "WholeBodySpec",
    "add_robot_plant",
    "add_series_elastic_loop",
    "add_torque_loop",
    "add_whole_body_loop",
    "function_entry",
    "series_elastic_controller",
    "torque_controller",
    "whole_body_controller",
]

_HOMES = {
    "FilterSpec": "scenarios",
    "SeriesElasticLoopSpec": "series_elastic.scenario",
    "TorqueLoopSpec": "torque.scenario",
    "WholeBodySpec": "whole_body.scenario",
    "add_robot_plant": "plant",
    "add_series_elastic_loop": "series_elastic.wiring",
    "add_torque_loop": "torque.wiring",
    "add_whole_body_loop": "whole_body.wiring",
    "function_entry": "function_diagram",
    "series_elastic_controller": "series_elastic.wiring",
    "torque_controller": "torque.wiring",
    "whole_body_controller": "whole_body.wiring",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
