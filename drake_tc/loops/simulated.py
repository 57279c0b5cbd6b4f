"""What a command shows and writes of a run, whatever the diagram, and what a plot of the run shows over time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.loops.motion import Motion, motion_html, torque_motion, tsid_motion
from drake_tc.loops.recording import Progress
from drake_tc.loops.series_elastic.loop import SeaRecording, simulate_sea, summarise_sea, write_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.loops.torque.default_gains import weak_joints
from drake_tc.loops.torque.running import TorqueRecording, simulate_scenario, summarise, write_results
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import LoopDesign
from drake_tc.loops.whole_body.running import TsidRecording, simulate_tsid, summarise_tsid, task_errors, write_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.law import Status
from drake_tc.types import BoolArray, FloatArray, TextTable

EVERY = 10
"""Ticks between two points of a task's error."""


@dataclass(frozen=True, eq=False)
class TimePanel:
    """Lines over time in one frame.

    Attributes:
        title: Of the frame.
        unit: Of the values.
        time: (T,) [s].
        lines: Name to values (T,).
        dashed: Name to values (T,) of what the line of that name should be.
    """

    title: str
    unit: str
    time: FloatArray
    lines: Mapping[str, FloatArray]
    dashed: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class RunPlot:
    """One page of a run.

    Attributes:
        title: What was run.
        panels: From the top to the bottom.
        time: (T,) of the flags [s].
        flags: Name to (T,) whether it was up, of those that were up at all.
    """

    title: str
    panels: tuple[TimePanel, ...]
    time: FloatArray
    flags: Mapping[str, BoolArray]


def torque_plot(recording: TorqueRecording) -> RunPlot:
    """Positions and their references, tracking errors, and torques of the drives, by joint."""
    joints, time = recording.robot.joints, recording.time
    reference = recording["reference"][:, : recording.size]
    return RunPlot(
        recording.robot.name,
        (
            TimePanel(
                "position (dashed: reference)",
                "rad",
                time,
                _lines(joints, recording.position),
                _lines(joints, reference),
            ),
            TimePanel("tracking error", "mrad", time, _lines(joints, 1e3 * recording.tracking_error), {}),
            TimePanel("torque of the drives", "N m", time, _lines(joints, recording["actuation"]), {}),
        ),
        time,
        recording.flags,
    )


def tsid_plot(recording: TsidRecording) -> RunPlot:
    """Errors of the tasks, torques as a share of their limits, and the probability that all limits are kept."""
    robot, time = recording.law.model.robot, recording.time
    errors = task_errors(recording, EVERY)
    share = 100.0 * recording["torque"] / joint_limits(robot).effort
    return RunPlot(
        robot.name,
        (
            TimePanel(
                "error of the tasks",
                "mm",
                time[::EVERY],
                {name: 1e3 * np.linalg.norm(error, axis=1) for name, error in errors.items()},
                {},
            ),
            TimePanel("torque over its limit", "%", time, _lines(robot.joints, share), {}),
            TimePanel("probability that all limits are kept", "-", time, {"p_ind": recording.status(Status.P_IND)}, {}),
        ),
        time,
        recording.flags | {"fallback": recording.status(Status.FALLBACK) > 0.0},
    )


def sea_plot(recording: SeaRecording) -> RunPlot:
    """Torque of the spring and its reference, the error, and the voltage."""
    joint, time = recording.scenario.joint, recording.time
    return RunPlot(
        joint,
        (
            TimePanel(
                "torque of the spring (dashed: reference)",
                "N m",
                time,
                {joint: recording["spring_torque"]},
                {joint: recording["reference_torque"]},
            ),
            TimePanel("torque error", "N m", time, {joint: recording.torque_error}, {}),
            TimePanel("voltage", "V", time, {joint: recording["voltage"]}, {}),
        ),
        time,
        recording.flags,
    )


def _lines(names: tuple[str, ...], values: FloatArray) -> dict[str, FloatArray]:
    """Columns of values (T, n) by name."""
    return {name: values[:, i] for i, name in enumerate(names)}


Tell = Callable[[str], None]


@dataclass(frozen=True)
class Simulated:
    """A run as commands take it.

    Attributes:
        summary: Plain data: "robot", "duration", "real_time_factor", "joints", "faults" and more.
        table: For people.
        lines: Below the table.
        write: Folder, ending of the log and whom to tell why something is left out, to the files written.
        plot: What a plot of the run shows.
        motion: How the robot moved; None where there is no robot file.
        page: The text of an HTML file that plays the motion; None where there is nothing to show.
    """

    summary: dict[str, Any]
    table: TextTable
    lines: tuple[str, ...]
    write: Callable[[Path, str, Tell], list[Path]]
    plot: Callable[[], RunPlot]
    motion: Callable[[], Motion] | None = None
    page: Callable[[], str] | None = None


def simulate_torque_loop(scenario: Scenario, progress: Progress | None = None, meshcat: bool = False) -> Simulated:
    """The torque loop of Del Prete et al. (2016): tracking by joint.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed, or the state left all bounds.
    """
    recording = simulate_scenario(scenario, progress, meshcat=meshcat)
    summary = summarise(recording)
    rows = tuple(
        (row["joint"], f"{1e3 * row['rms_error']:.3f}", f"{1e3 * row['max_error']:.2f}", f"{row['max_torque']:.1f}")
        for row in summary["joints"]
    )
    table = TextTable("", ("joint", "rms error [mrad]", "max error [mrad]", "max torque [N m]"), rows)
    return Simulated(
        summary,
        table,
        (
            f"Errors are those from {summary['errors_from']:g} s on; torques are those of the whole run.",
            _speed(summary),
            *_raised("fault", summary["faults"]),
            *weak_joints(LoopDesign.of_scenario(scenario)),
        ),
        partial(write_results, recording),
        partial(torque_plot, recording),
        lambda: torque_motion(recording, scenario),
        lambda: motion_html(torque_motion(recording, scenario)),
    )


def simulate_tsid_loop(scenario: TsidScenario, progress: Progress | None = None, meshcat: bool = False) -> Simulated:
    """Robust TSID: torques by joint, the centre of mass, probabilities, limits that gave way.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the plant's solver failed.
    """
    recording = simulate_tsid(scenario, progress, meshcat=meshcat)
    summary = summarise_tsid(recording)
    rows = tuple((row["joint"], f"{row['max_torque']:.1f}", f"{100.0 * row['share']:.1f}") for row in summary["joints"])
    p_ind = summary["p_ind"]
    lines = [
        *(
            f"task {row['task']}: rms error {1e3 * row['rms_error']:.2f} mm, max {1e3 * row['max_error']:.2f} mm"
            for row in summary["tasks"]
        ),
        f"p_ind: median {p_ind['median']:.4f}, lowest {p_ind['min']:.4f}",
        _speed(summary),
    ]
    if summary["fell"] is not None:
        lines.append(f"the robot fell by {summary['fell']:.2f} s")
    lines += [
        f"gave way: {fault['name']} from {fault['first']:.3f} s, {fault['ticks']} ticks" for fault in summary["faults"]
    ]
    lines += _raised("flag", summary["flags"])
    table = TextTable("", ("joint", "max torque [N m]", "of its limit [%]"), rows)
    return Simulated(
        summary,
        table,
        tuple(lines),
        partial(write_tsid, recording),
        partial(tsid_plot, recording),
        lambda: tsid_motion(recording),
        lambda: motion_html(tsid_motion(recording)),
    )


def simulate_sea_loop(scenario: SeaScenario, progress: Progress | None = None, meshcat: bool = False) -> Simulated:
    """One series-elastic joint: its torque error, with and without the loop's delay, and the largest voltage.

    The joint has no shape that could be shown.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the motor ran away.
    """
    recording = simulate_sea(scenario, progress)
    summary = summarise_sea(recording)
    row = summary["joints"][0]
    names = ("rms_error", "rms_error_but_for_delay", "max_error", "max_torque", "max_voltage")
    headings = ("joint", "rms error [N m]", "but for the delay", "max error", "max torque", "max voltage [V]")
    table = TextTable("", headings, ((row["joint"], *(f"{row[name]:.3f}" for name in names)),))
    left_out = f"Errors are those from {summary['errors_from']:g} s on; torque and voltage are those of the whole run."
    lines = (left_out, _speed(summary), *_raised("fault", summary["faults"]))
    return Simulated(summary, table, lines, partial(write_sea, recording), partial(sea_plot, recording))


def speed_line(duration: float, real_time_factor: float) -> str:
    """How fast a run was, in words; a run slower than real time keeps two digits.

    Args:
        duration: Simulated time [s].
        real_time_factor: Simulated time over elapsed time.
    """
    factor = f"{real_time_factor:.1f}" if real_time_factor >= 1.0 else f"{real_time_factor:.2g}"
    return f"{duration:g} s simulated at {factor} x real time"


def _speed(summary: dict[str, Any]) -> str:
    return speed_line(summary["duration"], summary["real_time_factor"])


def _raised(word: str, flags: Sequence[dict[str, Any]]) -> list[str]:
    return [f"{word}: {flag['name']} from {flag['first']:.3f} s" for flag in flags]
