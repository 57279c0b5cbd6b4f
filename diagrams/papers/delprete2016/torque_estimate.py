"""How good the estimated joint torques are with realistic sensors, and which imperfection costs what."""

import numpy as np

from drake_tc.diagrams.papers.delprete2016.error_budget import Run, error_budget
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.loops.torque.running import TorqueRecording, estimated, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.sensing.suite import SensorSuiteSpec
from drake_tc.types import FloatArray, TextTable, text_rows

MOTIONS = {"identify_motion": (1.0, 13.5), "stairs_swing": (0.75, 2.3)}
"""Scenario to the span in which it is evaluated [s]."""
NOTES = (
    "Simulated sensors of a humanoid's class. RMS error over the span, divided by the span of the true torque in it.",
    "Windows of 41 samples around each instant, F/T sensors zeroed at the start: what identification uses. In the loop"
    " the windows are 80 samples and lie behind, so the estimate is 40 ms old; its row takes that delay out.",
    "Where a joint reverses, dry friction that the linear model does not compensate makes the torque jump and ring; the"
    " window smooths that, with perfect sensors as well.",
)


def torque_estimate(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.torque_estimate: error of the estimated torque against the plant's own reaction torques."""
    values: dict[str, float] = {}
    tables = []
    for number, (name, span) in enumerate(MOTIONS.items()):
        if progress:
            progress(name, number / (1 + len(MOTIONS)))
        scenario = diagram_entry("hrp2_leg").scenario(name).changed(seed=seed, log_truth=True)
        recording = simulate_scenario(scenario)
        joints = recording.robot.joints
        inside = (recording.time >= span[0]) & (recording.time <= span[1])
        truth = recording["joint_torque"][inside]
        width = np.ptp(truth, axis=0)
        error = _rms(estimated(recording).torque[inside] - truth)
        columns = [width, error, 100.0 * error / width]
        headings = ["joint", "torque range [N m]", "rms error [N m]", "of the range [%]"]
        if "estimated_torque" in recording.signals:
            columns.append(100.0 * _rms(_in_the_loop(recording, scenario)[inside] - truth) / width)
            headings.append("in the loop, delay out [%]")
        tables.append(TextTable(name, tuple(headings), text_rows(joints, [c.tolist() for c in columns])))
        values |= {
            f"{name}: rms error, {j}": float(100.0 * e / w) for j, e, w in zip(joints, error, width, strict=True)
        }
    if progress:
        progress("error budget", len(MOTIONS) / (1 + len(MOTIONS)))
    tables.append(_budget(seed))
    return Reproduction("A.torque_estimate", evaluated(values, expectations("a_torque_estimate")), tuple(tables), NOTES)


def _rms(error: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _in_the_loop(recording: TorqueRecording, scenario: Scenario) -> FloatArray:
    """The loop's estimate moved back by the filters' delay and the one tick that a state costs (T, n) [N m]."""
    late = round(0.5 * (scenario.filters.window - 1)) + 1
    moved = np.roll(recording["estimated_torque"], -late, axis=0)
    moved[-late:] = recording["estimated_torque"][-1]
    return np.asarray(moved)


def _budget(seed: int) -> TextTable:
    """The error budget of the swing, contribution by contribution."""
    scenario = diagram_entry("hrp2_leg").scenario("stairs_swing")
    truth = simulate_scenario(scenario.changed(sensors="perfect", log_truth=True))
    model = TorqueModel(truth.robot, angular_acceleration="zero")
    run = Run(truth["encoder"], truth["imu"], truth["force_torque"], truth["joint_torque"], scenario.dt)
    neglected = TorqueModel(truth.robot, angular_acceleration="gyro")
    budget = error_budget(model, run, SensorSuiteSpec.realistic(), neglected=neglected, seed=seed)
    rows = [(name, *(f"{value:.3f}" for value in error)) for name, error in budget.rows()]
    title = "stairs_swing: error budget, causal 80-sample windows, F/T not zeroed [N m]"
    return TextTable(title, ("imperfection", *budget.joints), tuple(rows))
