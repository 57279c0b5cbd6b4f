"""Del Prete et al. (2016), sections 3.2.3 and 5.2.

Which fits' feedforward runs away; predicted by the linear loop, and simulated.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.diagrams.papers.delprete2016.contact_stability import ContactBorder, contact_border
from drake_tc.diagrams.papers.delprete2016.piecewise_loop import Reversal, reversals
from drake_tc.diagrams.papers.delprete2016.sliding_prediction import floating, predicted
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.scenarios import PushSpec
from drake_tc.loops.torque.references import posture
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import loop_robot
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.robot.plant import make_plant
from drake_tc.types import FloatArray, TextTable

MODELS = ("symmetric", "asymmetric")
PUSHES: Mapping[str, float] = {
    "r_hip_yaw": 20.0,
    "r_hip_roll": 40.0,
    "r_hip_pitch": 25.0,
    "r_knee": 40.0,
    "r_ankle_pitch": 12.0,
    "r_ankle_roll": 6.0,
}
"""Joint to the largest torque of its push [N m]: enough to pass the speed where an over-estimated friction wins, within
the speeds that the identification saw."""
BEGIN, LASTS, WATCHED = 0.7, 0.6, 0.4
"""The push begins and lasts [s]; the speed is looked at when it ends and `WATCHED` later."""
WAYS: Mapping[str, float] = {"forward": 1.0, "backward": -1.0}
MOVING = 0.1
"""A joint that floats on the piecewise model moves on its own if its RMS speed late is above [rad/s]."""
NOTES = (
    "Simulated. The joint under test has no feedback at all (Kp = 0, K6 = 0): gravity and friction feedforward alone,"
    " from the 40 ms old estimate; the others are held. It is pushed and let go; growth is its speed 0.4 s later over"
    " its speed at release.",
    "Predicted growth: from the eigenvalue of the linear loop in sliding and the constant drag of dry friction and dead"
    " zone, which make a critical speed: an over-compensated joint runs away from above it and stops from below it.",
    "Backwards the drive's gain is lower (velocity-sign switch), so the same fit compensates less. Where the"
    " asymmetric fit over-estimates, which the table shows, what keeps the joint stable is its release below the"
    " critical speed: the linear verdict alone (spectral radius > 1) would call it unstable. Pushed hard enough,"
    " such a joint passes the critical speed and runs away.",
    "Mean of both directions: the drive's gain without its switch, which is what the paper's linear model knows of.",
    "The fault monitor stops a runaway soon after: that is what ends the symmetric curves.",
    "Piecewise: one joint, the others locked, is let go at 0.05 rad/s, well within what dry friction stops, on the"
    " piecewise feedforward and on the asymmetric one; its spectral radius is that of the loop at the reversal, with"
    " the slope of the smoothed switch tanh(v/0.01 rad/s).",
    "Kf: whole leg with its foot on the box, drives in sliding; with dry friction at rest the border lies higher.",
)


@dataclass(frozen=True)
class Released:
    """A joint after its push.

    Attributes:
        time: (T,) [s].
        speed: (T,) |qdot| [rad/s].
    """

    time: FloatArray
    speed: FloatArray

    @property
    def at_release(self) -> float:
        """Speed when the push ends [rad/s]."""
        return float(np.interp(BEGIN + LASTS, self.time, self.speed))

    @property
    def growth(self) -> float:
        """Speed `WATCHED` seconds after release over that at release [-]."""
        return float(np.interp(BEGIN + LASTS + WATCHED, self.time, self.speed)) / self.at_release


def pushed(joint: str, model: str, seed: int = 0, direction: float = 1.0) -> Released:
    """Push one joint that floats on its feedforward.

    Args:
        joint: Which.
        model: "symmetric" or "asymmetric": which fit the feedforward comes from.
        seed: Of the sensors' noise.
        direction: Of the push, 1 or -1.
    """
    scenario = floating(joint, model).changed(seed=seed)
    scenario = replace(scenario, duration=BEGIN + LASTS + WATCHED + 0.3, pushes=(_push(scenario, joint, direction),))
    recording = simulate_scenario(scenario, allow_runaway=True)
    return Released(recording.time, np.abs(recording.velocity[:, recording.robot.joints.index(joint)]))


def _push(scenario: Scenario, joint: str, direction: float = 1.0) -> PushSpec:
    """A torque about the joint's axis, as it stands at the start."""
    robot = loop_robot(scenario)
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    for name, position in zip(robot.joints, posture(scenario.motion, robot), strict=True):
        plant.GetJointByName(name).set_angle(context, position)
    moving = plant.GetJointByName(joint)
    rotation = moving.frame_on_child().CalcPoseInWorld(context).rotation().matrix()
    torque = direction * PUSHES[joint] * rotation @ moving.revolute_axis()
    return PushSpec(moving.child_body().name(), BEGIN, LASTS, torque=tuple(torque.tolist()))


Runs = Mapping[tuple[str, str, str], Released]


def stability(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.stability, in simulation: every joint, both fits, both directions; the piecewise model; force control."""
    cases = [(joint, model, way) for joint in PUSHES for model in MODELS for way in WAYS]
    runs: dict[tuple[str, str, str], Released] = {}
    for number, (joint, model, way) in enumerate(cases):
        if progress:
            progress(f"{joint}, {model} fit, {way}", 0.5 * number / len(cases))
        runs[joint, model, way] = pushed(joint, model, seed, WAYS[way])
    if progress:
        progress("piecewise model", 0.5)
    turned = reversals(tuple(PUSHES), seed)
    if progress:
        progress("force control", 0.8)
    border = contact_border()
    values = figures(runs) | _piecewise_figures(turned) | _contact_figures(border)
    tables = (_table(runs), _piecewise_table(turned))
    return Reproduction(
        "A.stability",
        evaluated(values, expectations("a_stability")),
        tables,
        NOTES,
        {"stability": lambda figure: _draw(figure, runs)},
    )


def figures(runs: Runs) -> dict[str, float]:
    """Figures of the pushes by name: simulated growth, spectral radius, predicted growth, and how they agree."""
    values = {
        f"growth, {model} fit, {joint}": run.growth for (joint, model, way), run in runs.items() if way == "forward"
    }
    alike, errors = [], []
    for (joint, model, way), run in runs.items():
        foreseen = predicted(joint, model, WAYS[way])
        growth = foreseen.growth(run.at_release, WATCHED)
        values[f"spectral radius, {model} fit, {joint}, {way}"] = foreseen.spectral_radius
        values[f"predicted growth, {model} fit, {joint}, {way}"] = growth
        if way == "backward":
            values[f"growth, {model} fit, {joint}, backward"] = run.growth
        alike.append((growth > 1.0) == (run.growth > 1.0))
        if growth > 1.0:
            errors.append(abs(growth / run.growth - 1.0))
    for joint in PUSHES:
        for model in MODELS:
            mean = predicted(joint, model, 0.0)
            values[f"spectral radius, {model} fit, {joint}, mean of both directions"] = mean.spectral_radius
    values["pushes that prediction and simulation judge alike"] = float(sum(alike))
    values["largest error of a predicted runaway's growth"] = 100.0 * max(errors, default=float("nan"))
    return values


def _piecewise_figures(turned: Mapping[str, Reversal]) -> dict[str, float]:
    values: dict[str, float] = {}
    both = 0
    for joint, run in turned.items():
        values[f"spectral radius, piecewise model at a reversal, {joint}"] = run.spectral_radius
        values[f"late speed on the piecewise model, {joint}"] = run.late_speed
        both += run.spectral_radius > 1.0 and run.late_speed > MOVING
    values["joints unstable on the piecewise model, in both"] = float(both)
    values["largest late speed on the asymmetric model"] = max(run.late_other_speed for run in turned.values())
    return values


def _contact_figures(border: ContactBorder) -> dict[str, float]:
    return {
        "Kf at the border of force control, predicted": border.predicted,
        "Kf at the border of force control, simulated": border.simulated,
        "frequency at that border, predicted": border.frequency_hz,
        "predicted over simulated Kf": border.predicted / border.simulated,
    }


def _table(runs: Runs) -> TextTable:
    rows = []
    for (joint, model, way), run in runs.items():
        foreseen = predicted(joint, model, WAYS[way])
        growth = foreseen.growth(run.at_release, WATCHED)
        critical = f"{foreseen.critical_speed:.2f}" if foreseen.critical_speed > 0.0 else "none"
        numbers = (f"{run.at_release:.2f}", f"{foreseen.spectral_radius:.5f}", critical)
        rows.append((f"{joint}, {model}, {way}", *numbers, f"{growth:.2f}", f"{run.growth:.2f}"))
    headings = (
        "push",
        "released at [rad/s]",
        "spectral radius",
        "critical speed [rad/s]",
        "growth, predicted",
        "simulated",
    )
    return TextTable("a pushed joint on its feedforward alone", headings, tuple(rows))


def _piecewise_table(turned: Mapping[str, Reversal]) -> TextTable:
    rows = tuple(
        (
            joint,
            f"{1e3 * run.step:.2f}",
            f"{1e3 * run.friction:.2f}",
            f"{run.spectral_radius:.3f}",
            f"{run.late_speed:.3f}",
            f"{run.late_other_speed:.4f}",
        )
        for joint, run in turned.items()
    )
    headings = (
        "joint",
        "half step [mrad]",
        "friction there [mrad]",
        "spectral radius",
        "late speed [rad/s]",
        "linear fit",
    )
    return TextTable("a joint let go on the piecewise model", headings, rows)


def _draw(figure: Any, runs: Runs) -> None:
    axes = figure.subplots(2, 3, sharex=True).ravel()
    for axis, joint in zip(axes, PUSHES, strict=True):
        for model in MODELS:
            run = runs[joint, model, "forward"]
            axis.plot(run.time, run.speed, label=f"{model} fit")
            critical = predicted(joint, model, 1.0).critical_speed
            if 0.0 < critical < 1.5 * run.speed.max():
                axis.axhline(critical, ls=":", color=axis.lines[-1].get_color())
        axis.axvspan(BEGIN, BEGIN + LASTS, color="0.9")
        axis.set_title(joint, fontsize="small")
    axes[0].legend(fontsize="small")
    figure.supxlabel("time [s], push shaded; dotted: critical speed")
    figure.supylabel("speed [rad/s]")
