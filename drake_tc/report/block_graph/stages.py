"""Which stage of the control loop a system belongs to: by its tag, its class, or its neighbours; never by its name."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drake_tc.errors import ParamsError
from drake_tc.report.block_graph.view import STAGES

TAG = "graph_stage"
"""Attribute by which a system names its stage: `graph_stage = "control"` in the class."""
FORWARD = ("reference", "control", "actuation", "plant")
"""Stages of the forward path, in the order of the signals."""

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
"""The last known word of the name of a class decides: a `TorqueSensorFilter` is a filter."""


@dataclass(frozen=True)
class Candidate:
    """What the choice looks at.

    Attributes:
        path: Path of the system.
        name: Its name, by which `stages` of a block graph may choose it.
        kind: Its class.
        module: Module of the class.
        is_source: It has no inputs.
        is_sink: It has no outputs.
        tag: Stage that it names itself; None: it names none.
        parts: Stages of the systems inside a nested diagram.
    """

    path: str
    name: str
    kind: str
    module: str
    is_source: bool
    is_sink: bool
    tag: str | None = None
    parts: tuple[str, ...] = ()


def _stage_of_class(kind: str) -> str | None:
    """The stage that the CamelCase name of a class speaks of; None where it speaks of none."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", kind)
    for word in reversed([w.lower() for w in words]):
        for form in (word, word.removesuffix("s")):
            if form in _WORDS:
                return _WORDS[form]
    return None


def certain_stage(system: Candidate) -> str | None:
    """The stage that the tag, the class or its module settle; None where the neighbours have a say.

    Raises:
        ParamsError: the tag is no stage.
    """
    if system.tag is not None:
        _check_stage(system.path, system.tag)
        return system.tag
    if system.kind in BY_CLASS:
        return BY_CLASS[system.kind]
    homes = [home for home in BY_MODULE if f"{system.module}.".startswith(f"{home}.")]
    if homes:
        return BY_MODULE[max(homes, key=len)]
    return _majority(part for part in system.parts if part != "logging")


PASSING = ("Multiplexer", "Demultiplexer", "Selector")
"""Classes that only put signals together or take them apart."""


def assign_stages(
    systems: Sequence[Candidate], links: Iterable[tuple[str, str]], chosen: Mapping[str, str]
) -> dict[str, str]:
    """The stage of every system.

    Tag, class and module come first, then the words in the name of a class that is not Drake's, unless they speak of
    the feedback path and the system passes signals along the forward path (an `OffsetFilter` between controller and
    guard is control). What is still open takes the stage that all its consumers share (a multiplexer that only logs
    read is one of them), else the one most of its sources have; then a source is a reference, a sink a log, and
    anything else control. The name of a system has no influence.

    Args:
        systems: In the diagram's order.
        links: (source path, target path) of the connections.
        chosen: Path, name or class to stage; comes before everything.

    Raises:
        ParamsError: `chosen` or a tag names no stage, or `chosen` names nothing in the diagram.
    """
    _check(systems, chosen)
    stages: dict[str, str] = {}
    for system in systems:
        keys = (system.path, system.name, system.kind)
        stage = next((chosen[key] for key in keys if key in chosen), None) or certain_stage(system)
        if stage is not None:
            stages[system.path] = stage
    pairs = list(links)
    stages |= _from_words(systems, pairs, stages)
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


def _from_words(
    systems: Sequence[Candidate], links: list[tuple[str, str]], certain: Mapping[str, str]
) -> dict[str, str]:
    """Stages by the names of classes, but for systems of the forward path whose class speaks of another one."""
    words = {s.path: _stage_of_class(s.kind) for s in systems if s.path not in certain}
    own = {s.path for s in systems if not s.module.startswith("pydrake.")}
    spoken = {path: stage for path, stage in words.items() if stage is not None and path in own}
    known = {**spoken, **certain}
    return {path: stage for path, stage in spoken.items() if stage in FORWARD or not _is_forward(path, links, known)}


def _is_forward(path: str, links: list[tuple[str, str]], known: Mapping[str, str]) -> bool:
    """Whether a system reads and feeds stages of the forward path alone, none before one that it reads."""
    before = [known.get(s) for s, t in links if t == path]
    after = [stage for s, t in links if s == path if (stage := known.get(t)) != "logging"]
    if not before or not after or not {*before, *after} <= {*FORWARD}:
        return False
    order = [FORWARD.index(str(stage)) for stage in (*before, *after)]
    return max(order[: len(before)]) <= min(order[len(before) :])


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
        _check_stage(key, stage)
        if key not in here:
            raise ParamsError(f"no block {key!r} to put into {stage}; blocks: {', '.join(s.path for s in systems)}")


def _check_stage(key: str, stage: str) -> None:
    if stage not in STAGES:
        raise ParamsError(f"block {key!r}: no stage {stage!r}; stages: {', '.join(STAGES)}")
