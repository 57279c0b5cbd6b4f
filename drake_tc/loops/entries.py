"""Entries for the registry: a diagram that is one of the library's loops, with a file of scenarios."""

from dataclasses import replace
from pathlib import Path

from drake_tc.loops.diagram_entry import DiagramEntry
from drake_tc.loops.series_elastic.loop import SeaLoop, build_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.loops.series_elastic.sliding import sliding_sea
from drake_tc.loops.simulated import simulate_sea_loop, simulate_torque_loop, simulate_tsid_loop
from drake_tc.loops.torque.loop import Loop, build_loop
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.sliding import sliding_scenario
from drake_tc.loops.whole_body.loop import TsidLoop, build_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario

TorqueLoopEntry = DiagramEntry[Scenario, Loop]
TsidEntry = DiagramEntry[TsidScenario, TsidLoop]
SeaEntry = DiagramEntry[SeaScenario, SeaLoop]


def torque_loop(name: str, title: str, scenario_file: Path) -> TorqueLoopEntry:
    """A diagram of the torque loop (Del Prete et al., 2016), which stability analysis and tuning know too.

    Args:
        name: As commands take it.
        title: One line.
        scenario_file: Its scenarios; the first is the default.
    """
    return DiagramEntry(
        name, title, "torque", scenario_file, Scenario.load, build_loop, simulate_torque_loop, _sliding_loop
    )


def _sliding_loop(scenario: Scenario, folder: Path) -> Scenario:
    return replace(sliding_scenario(scenario, folder), sensors="perfect")


def whole_body_loop(name: str, title: str, scenario_file: Path) -> TsidEntry:
    """A diagram of a legged robot on a floor under robust TSID; see `torque_loop` for the arguments."""
    return DiagramEntry(name, title, "whole_body", scenario_file, TsidScenario.load, build_tsid, simulate_tsid_loop)


def series_elastic_loop(name: str, title: str, scenario_file: Path) -> SeaEntry:
    """A diagram of one series-elastic joint in torque control; see `torque_loop` for the arguments."""
    return DiagramEntry(
        name,
        title,
        "series_elastic",
        scenario_file,
        SeaScenario.load,
        build_sea,
        simulate_sea_loop,
        lambda scenario, _: sliding_sea(scenario),
    )
