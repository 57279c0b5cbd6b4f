"""Which stage of the control loop a system belongs to: by its module, its name, or its neighbours."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drake_tc.errors import ParamsError
from drake_tc.report.block_graph.data import STAGES

BY_CLASS: Mapping[str, str] = {
    "FaultMonitor": "supervision",
    "StoppingReference": "reference",
    "TrajectorySource": "reference",
    "VectorLogSink": "logging",
    "SceneGraph": "plant",
}
BY_MODULE: Mapping[str, str] = {
    "drake_tc.control": "control",
    "drake_tc.tsid": "control",
    "drake_tc.actuation": "actuation",
    "drake_tc.sensing": "sensing",
    "drake_tc.filtering": "filtering",
    "drake_tc.sensor_validation": "sensing",
    "drake_tc.estimation": "estimation",
    "pydrake.multibody.plant": "plant",
    "pydrake.systems.sensors": "sensing",
    "pydrake.systems.controllers": "control",
    "pydrake.visualization": "logging",
    "pydrake.geometry": "logging",
}
"""The longest module that a system's class lives in, or under, decides."""

_WORDS: Mapping[str, str] = {
    **dict.fromkeys(("reference", "trajectory", "command", "planner", "desired", "setpoint"), "reference"),
    **dict.fromkeys(("control", "controller", "guard", "servo", "pid", "feedforward"), "control"),
    **dict.fromkeys(("actuator", "actuation", "motor", "drive"), "actuation"),
    **dict.fromkeys(("plant",), "plant"),
    **dict.fromkeys(("sensor", "encoder", "imu", "gyro", "gyroscope", "accelerometer", "camera"), "sensing"),
    **dict.fromkeys(("filter", "smoother"), "filtering"),
    **dict.fromkeys(("estimator", "observer", "estimation", "estimate"), "estimation"),
    **dict.fromkeys(("monitor", "supervisor", "supervision", "watchdog"), "supervision"),
    **dict.fromkeys(("log", "logger", "logging", "sink", "recorder", "visualizer", "meshcat"), "logging"),
}
"""The last known word of a name decides: a `torque_sensor_filter` is a filter."""


@dataclass(frozen=True)
class Candidate:
    """What the choice looks at: path, own name, class and its module, how many ports it has, stages of its parts."""

    path: str
    name: str
    kind: str
    module: str
    is_source: bool
    is_sink: bool
    parts: tuple[str, ...] = ()


def stage_of_words(name: str) -> str | None:
    """The stage that a snake_case or CamelCase name speaks of; None where it speaks of none."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)
    for word in reversed([w.lower() for w in words]):
        for form in (word, word.removesuffix("s")):
            if form in _WORDS:
                return _WORDS[form]
    return None


def certain_stage(system: Candidate) -> str | None:
    """The stage that class, module or name settle; None where only the neighbours can tell."""
    if system.kind in BY_CLASS:
        return BY_CLASS[system.kind]
    homes = [home for home in BY_MODULE if f"{system.module}.".startswith(f"{home}.")]
    if homes:
        return BY_MODULE[max(homes, key=len)]
    named = stage_of_words(system.name)
    if not system.module.startswith("pydrake."):
        named = stage_of_words(system.kind) or named
    return named or _majority(part for part in system.parts if part != "logging")


PASSING = ("Multiplexer", "Demultiplexer", "Selector")
"""Classes that only put signals together or take them apart."""


def assign_stages(
    systems: Sequence[Candidate], links: Iterable[tuple[str, str]], chosen: Mapping[str, str]
) -> dict[str, str]:
    """The stage of every system.

    Class, module and name come first. What they leave open takes the stage that all its consumers share (a multiplexer
    that only logs read is one of them), else the one most of its sources have; then a source is a reference, a sink a
    log, and anything else control.

    Args:
        systems: In the diagram's order.
        links: (source path, target path) of the connections.
        chosen: Path, name or class to stage; comes before everything.

    Raises:
        ParamsError: `chosen` names no stage, or nothing in the diagram.
    """
    _check(systems, chosen)
    stages: dict[str, str] = {}
    for system in systems:
        keys = (system.path, system.name, system.kind)
        stage = next((chosen[key] for key in keys if key in chosen), None) or certain_stage(system)
        if stage is not None:
            stages[system.path] = stage
    pairs = list(links)
    for _ in systems:
        known = dict(stages)
        for system in systems:
            if system.path not in stages and (near := _from_neighbours(system, pairs, known)):
                stages[system.path] = near
        if len(stages) in (len(known), len(systems)):
            break
    for system in systems:
        fallback = "reference" if system.is_source else "logging" if system.is_sink else "control"
        stages.setdefault(system.path, fallback)
    return stages


def _from_neighbours(system: Candidate, links: list[tuple[str, str]], known: Mapping[str, str]) -> str | None:
    read = [known.get(t) for s, t in links if s == system.path]
    if system.kind in PASSING and read and set(read) == {"logging"}:
        return "logging"
    after = [known[t] for s, t in links if s == system.path and known.get(t, "logging") != "logging"]
    if len(set(after)) == 1 and not (system.is_source and after[0] == "control"):
        return after[0]
    return _majority(known[s] for s, t in links if t == system.path and s in known)


def _majority(stages: Iterable[str]) -> str | None:
    counts = Counter(stages)
    return max(STAGES, key=lambda s: counts[s]) if counts else None


def _check(systems: Sequence[Candidate], chosen: Mapping[str, str]) -> None:
    here = {key for s in systems for key in (s.path, s.name, s.kind)}
    for key, stage in chosen.items():
        if stage not in STAGES:
            raise ParamsError(f"block {key!r}: no stage {stage!r}; stages: {', '.join(STAGES)}")
        if key not in here:
            raise ParamsError(f"no block {key!r} to put into {stage}; blocks: {', '.join(s.path for s in systems)}")
