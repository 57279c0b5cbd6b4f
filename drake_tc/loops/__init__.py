"""Control loops wired from the library's systems: torque loop, whole-body loop, series-elastic joint, joint bench."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.loops.function_diagram import function_entry
    from drake_tc.loops.plant import add_robot_plant
    from drake_tc.loops.scenarios.parts import FilterSpec
    from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
    from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop
    from drake_tc.loops.torque.spec import TorqueLoopSpec
    from drake_tc.loops.torque.wiring import add_torque_loop
    from drake_tc.loops.whole_body.scenario import WholeBodySpec
    from drake_tc.loops.whole_body.wiring import add_whole_body_loop

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
]

_HOMES = {
    "FilterSpec": "scenarios.parts",
    "SeriesElasticLoopSpec": "series_elastic.scenario",
    "TorqueLoopSpec": "torque.spec",
    "WholeBodySpec": "whole_body.scenario",
    "add_robot_plant": "plant",
    "add_series_elastic_loop": "series_elastic.wiring",
    "add_torque_loop": "torque.wiring",
    "add_whole_body_loop": "whole_body.wiring",
    "function_entry": "function_diagram",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
