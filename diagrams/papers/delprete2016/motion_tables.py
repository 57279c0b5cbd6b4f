"""Del Prete et al. (2016), Tables 2 and 3.

One stair swing under the vendor's servo and under torque control of falling stiffness.
"""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.torque.running import TorqueRecording, simulate_scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import FloatArray, TextTable, text_rows

STIFFNESSES = (1.0, 0.5, 0.25, 0.1)
"""K6 of the paper's four columns."""
FROM, UNTIL = 0.75, 2.6
"""Errors are taken from just before the swing to its rest [s]."""
COMPLETE = "../models/hrp2_like/hrp2_like_leg_identified.yaml"
"""What `close-loop` made of the identification logs: every effect, with its numbers."""
PRINTED = ("r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch", "r_ankle_roll")
"""Joints of the paper's tables; the hip yaw is not among them."""
NOTES = (
    "Simulated: our leg of Table 1's drives, with dead zone, direction-dependent gain and Coulomb friction; a swing of"
    " our own, as the paper prints no trajectory. Absolute errors are therefore not comparable, ratios are.",
    "The controller compensates the linear model of the asymmetric fit (K_tau and K_v alone), as the paper's does; in"
    " the last column the model with every effect that `close-loop` identified (`reproduce A.table1`).",
)


COMPLETE_RATIO = "squared error ratio, K6 = 0.1 with the complete model"


@dataclass(frozen=True)
class Swings:
    """The same swing under every controller.

    Attributes:
        joints: Names.
        servo: Tracking error under the vendor's servo (T, n) [rad].
        torque: K6 to tracking error under torque control (T, n) [rad].
        complete: The same at the lowest K6 with the complete model that `close-loop` identified (T, n) [rad].
    """

    joints: tuple[str, ...]
    servo: FloatArray
    torque: dict[float, FloatArray]
    complete: FloatArray

    def mean_square(self, error: FloatArray) -> FloatArray:
        """(n,) [10^-3 rad^2], the unit of the paper's Table 2."""
        return np.asarray(1e3 * np.mean(error**2, axis=0))

    def largest(self, error: FloatArray) -> FloatArray:
        """(n,) [10^-3 rad], the unit of the paper's Table 3."""
        return np.asarray(1e3 * np.abs(error).max(axis=0))


def swings(seed: int = 0, progress: Progress | None = None) -> Swings:
    """Simulate the servo, the four stiffnesses, and the softest one with the complete model.

    Args:
        seed: Of the sensors' noise.
        progress: Told what is done.
    """
    entry = diagram_entry("hrp2_leg")
    soft = min(STIFFNESSES)
    linear = entry.scenario("stairs_swing").changed(seed=seed)
    runs = {"servo": entry.scenario("stairs_swing_servo").changed(seed=seed)}
    runs |= {f"K6 = {k6:g}": replace(linear, gains=replace(linear.gains, k6=k6)) for k6 in STIFFNESSES}
    runs["complete model"] = replace(runs[f"K6 = {soft:g}"], model=COMPLETE)
    errors: dict[str, FloatArray] = {}
    joints: tuple[str, ...] = ()
    for number, (name, scenario) in enumerate(runs.items()):
        if progress:
            progress(name, number / len(runs))
        recording = simulate_scenario(scenario)
        joints, errors[name] = recording.robot.joints, _evaluated(recording)
    torque = {k6: errors[f"K6 = {k6:g}"] for k6 in STIFFNESSES}
    return Swings(joints, errors["servo"], torque, errors["complete model"])


def _evaluated(recording: TorqueRecording) -> FloatArray:
    """The tracking error over the swing."""
    inside = (recording.time >= FROM) & (recording.time <= UNTIL)
    return np.asarray(recording.tracking_error[inside])


def table2(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.table2: mean squared errors, and their ratios servo/torque."""
    found = swings(seed, progress)
    columns = [found.mean_square(found.servo), *(found.mean_square(found.torque[k]) for k in STIFFNESSES)]
    values = _ratios("squared error ratio", found.joints, columns)
    at_one = [values[f"squared error ratio, K6 = 1, {joint}"] for joint in PRINTED]
    values["joints with a ratio of 3 or more at K6 = 1"] = float(sum(ratio >= 3.0 for ratio in at_one))
    complete = found.mean_square(found.complete)
    values |= {f"{COMPLETE_RATIO}, {joint}": float(columns[0][i] / complete[i]) for i, joint in enumerate(found.joints)}
    values["linear over complete model at K6 = 0.1, geometric mean"] = float(
        np.exp(np.mean(np.log(columns[-1] / complete)))
    )
    columns.append(complete)
    shown = _table("Table 2: mean squared tracking error [10^-3 rad^2]", found.joints, columns, ".4f")
    return Reproduction("A.table2", evaluated(values, expectations("a_table2")), (shown,), NOTES)


def table3(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.table3: largest errors, and their ratios servo/torque."""
    found = swings(seed, progress)
    columns = [found.largest(found.servo), *(found.largest(found.torque[k]) for k in STIFFNESSES)]
    values = _ratios("largest error ratio", found.joints, columns)
    columns.append(found.largest(found.complete))
    shown = _table("Table 3: largest tracking error [10^-3 rad]", found.joints, columns, ".2f")
    return Reproduction("A.table3", evaluated(values, expectations("a_table3")), (shown,), NOTES)


def _ratios(what: str, joints: tuple[str, ...], columns: list[FloatArray]) -> dict[str, float]:
    """Servo over torque, by stiffness and joint."""
    return {
        f"{what}, K6 = {stiffness:g}, {joint}": float(columns[0][i] / column[i])
        for stiffness, column in zip(STIFFNESSES, columns[1:], strict=True)
        for i, joint in enumerate(joints)
    }


def _table(title: str, joints: tuple[str, ...], columns: list[FloatArray], digits: str) -> TextTable:
    headings = ("joint", "servo", *(f"K6 = {stiffness:g}" for stiffness in STIFFNESSES), "0.1, complete model")
    return TextTable(title, headings, text_rows(joints, [column.tolist() for column in columns], digits))
