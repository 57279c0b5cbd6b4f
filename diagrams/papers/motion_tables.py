"""Paper A, Tables 2 and 3: one stair swing under the vendor's servo and under torque control of falling stiffness."""

from dataclasses import dataclass, replace

import numpy as np
from drake_tc.diagrams.papers.reproduction import Progress, Reproduction, TextTable, expectations, judged, text_rows
from drake_tc.diagrams.recording import Recording
from drake_tc.diagrams.registry import diagram_entry
from drake_tc.diagrams.running import simulate_scenario

from drake_tc.types import FloatArray

STIFFNESSES = (1.0, 0.5, 0.25, 0.1)
"""K6 of the paper's four columns."""
FROM, UNTIL = 0.75, 2.6
"""Errors are taken from just before the swing to its rest [s]."""
PRINTED = ("r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch", "r_ankle_roll")
"""Joints of the paper's tables; the hip yaw is not among them."""
NOTES = (
    "Simulated: our leg of Table 1's drives, with dead zone, direction-dependent gain and Coulomb friction; a swing of"
    " our own, as the paper prints no trajectory. Absolute errors are therefore not comparable, ratios are.",
    "The controller compensates the linear model of the asymmetric fit (K_tau and K_v alone), as the paper's does.",
)


@dataclass(frozen=True)
class Swings:
    """The same swing under every controller.

    Attributes:
        joints: Names.
        servo: Tracking error under the vendor's servo (T, n) [rad].
        torque: K6 to tracking error under torque control (T, n) [rad].
    """

    joints: tuple[str, ...]
    servo: FloatArray
    torque: dict[float, FloatArray]

    def mean_square(self, error: FloatArray) -> FloatArray:
        """(n,) [10^-3 rad^2], the unit of the paper's Table 2."""
        return np.asarray(1e3 * np.mean(error**2, axis=0))

    def largest(self, error: FloatArray) -> FloatArray:
        """(n,) [10^-3 rad], the unit of the paper's Table 3."""
        return np.asarray(1e3 * np.abs(error).max(axis=0))


def swings(seed: int = 0, progress: Progress | None = None, model: str | None = None) -> Swings:
    """Simulate the servo and the four stiffnesses.

    Args:
        seed: Of the sensors' noise.
        progress: Told what is done.
        model: Model file for the controller; None takes the scenario's.
    """
    entry = diagram_entry("hrp2_leg")
    errors: list[FloatArray] = []
    runs = ["stairs_swing_servo", *["stairs_swing"] * len(STIFFNESSES)]
    joints: tuple[str, ...] = ()
    for number, name in enumerate(runs):
        scenario = entry.scenario(name).changed(seed=seed, model=model)
        if number:
            scenario = replace(scenario, gains=replace(scenario.gains, k6=STIFFNESSES[number - 1]))
        if progress:
            progress(name if not number else f"K6 = {scenario.gains.k6:g}", number / len(runs))
        recording = simulate_scenario(scenario)
        joints = recording.robot.joints
        errors.append(_judged(recording))
    return Swings(joints, errors[0], dict(zip(STIFFNESSES, errors[1:], strict=True)))


def _judged(recording: Recording) -> FloatArray:
    """The tracking error over the swing."""
    inside = (recording.time >= FROM) & (recording.time <= UNTIL)
    return recording.tracking_error[inside]


def table2(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.table2: mean squared errors, and their ratios servo/torque."""
    found = swings(seed, progress)
    columns = [found.mean_square(found.servo), *(found.mean_square(found.torque[k]) for k in STIFFNESSES)]
    values = _ratios("squared error ratio", found.joints, columns)
    at_one = [values[f"squared error ratio, K6 = 1, {joint}"] for joint in PRINTED]
    values["joints with a ratio of 3 or more at K6 = 1"] = float(sum(ratio >= 3.0 for ratio in at_one))
    shown = _table("Table 2: mean squared tracking error [10^-3 rad^2]", found.joints, columns, ".4f")
    return Reproduction("A.table2", judged(values, expectations("a_table2")), (shown,), NOTES)


def table3(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.table3: largest errors, and their ratios servo/torque."""
    found = swings(seed, progress)
    columns = [found.largest(found.servo), *(found.largest(found.torque[k]) for k in STIFFNESSES)]
    values = _ratios("largest error ratio", found.joints, columns)
    shown = _table("Table 3: largest tracking error [10^-3 rad]", found.joints, columns, ".2f")
    return Reproduction("A.table3", judged(values, expectations("a_table3")), (shown,), NOTES)


def _ratios(what: str, joints: tuple[str, ...], columns: list[FloatArray]) -> dict[str, float]:
    """Servo over torque, by stiffness and joint."""
    return {
        f"{what}, K6 = {stiffness:g}, {joint}": float(columns[0][i] / column[i])
        for stiffness, column in zip(STIFFNESSES, columns[1:], strict=True)
        for i, joint in enumerate(joints)
    }


def _table(title: str, joints: tuple[str, ...], columns: list[FloatArray], digits: str) -> TextTable:
    headings = ("joint", "servo", *(f"K6 = {stiffness:g}" for stiffness in STIFFNESSES))
    return TextTable(title, headings, text_rows(joints, [column.tolist() for column in columns], digits))
