"""Paper A, section 5.2: the symmetric fit's feedforward runs away, the asymmetric fit's does not."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from drake_tc.diagrams.loop_parts import loop_robot
from drake_tc.diagrams.papers.reproduction import Progress, Reproduction, TextTable, expectations, judged
from drake_tc.diagrams.references import posture
from drake_tc.diagrams.registry import diagram_entry
from drake_tc.diagrams.running import simulate_scenario
from drake_tc.diagrams.scenario import Scenario
from drake_tc.diagrams.scenario_parts import PushSpec

from drake_tc.robot.plant import make_plant
from drake_tc.types import FloatArray

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
NOTES = (
    "Simulated. The joint under test has no feedback at all (Kp = 0, K6 = 0): gravity and friction feedforward alone,"
    " from the 40 ms old estimate; the others are held. It is pushed and let go; growth is its speed 0.4 s later over"
    " its speed at release.",
    "Stable within the speeds that the logs held: pushed twice as hard, ankle roll and hip yaw leave them, and there"
    " the asymmetric model's feedforward over-estimates too (the drive's gain is larger in one direction).",
    "The fault monitor stops a runaway soon after: that is what ends the symmetric curves.",
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


def pushed(joint: str, model: str, seed: int = 0) -> Released:
    """Push one joint that floats on its feedforward.

    Args:
        joint: Which.
        model: "symmetric" or "asymmetric": which fit the feedforward comes from.
        seed: Of the sensors' noise.
    """
    scenario = diagram_entry("hrp2_leg").scenario("float").changed(seed=seed)
    free = {joint: {"k6": 0.0, "k7": 0.0, "kp": 0.0}}
    scenario = replace(
        scenario,
        duration=BEGIN + LASTS + WATCHED + 0.3,
        model=f"../models/hrp2_like/hrp2_like_leg_{model}.yaml",
        gains=replace(scenario.gains, by_joint=free),
        pushes=(_push(scenario, joint),),
    )
    recording = simulate_scenario(scenario, allow_runaway=True)
    return Released(recording.time, np.abs(recording.velocity[:, recording.robot.joints.index(joint)]))


def _push(scenario: Scenario, joint: str) -> PushSpec:
    """A torque about the joint's axis, as it stands at the start."""
    robot = loop_robot(scenario)
    plant: Any = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    for name, position in zip(robot.joints, posture(scenario.motion, robot), strict=True):
        plant.GetJointByName(name).set_angle(context, position)
    moving = plant.GetJointByName(joint)
    rotation = moving.frame_on_child().CalcPoseInWorld(context).rotation().matrix()
    torque = PUSHES[joint] * rotation @ moving.revolute_axis()
    return PushSpec(moving.child_body().name(), BEGIN, LASTS, torque=tuple(torque.tolist()))


def stability(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.stability, in simulation: every joint, both fits."""
    runs: dict[tuple[str, str], Released] = {}
    for number, joint in enumerate(PUSHES):
        for model in MODELS:
            if progress:
                progress(f"{joint}, {model} fit", number / len(PUSHES))
            runs[joint, model] = pushed(joint, model, seed)
    values = {f"growth, {model} fit, {joint}": run.growth for (joint, model), run in runs.items()}
    rows = tuple(
        (joint, *(f"{number:.2f}" for model in MODELS for number in _figures(runs[joint, model]))) for joint in PUSHES
    )
    headings = ("joint", *(f"{what}, {model}" for model in MODELS for what in ("released at [rad/s]", "growth")))

    def draw(figure: Any) -> None:
        axes = figure.subplots(2, 3, sharex=True).ravel()
        for axis, joint in zip(axes, PUSHES, strict=True):
            for model in MODELS:
                axis.plot(runs[joint, model].time, runs[joint, model].speed, label=f"{model} fit")
            axis.axvspan(BEGIN, BEGIN + LASTS, color="0.9")
            axis.set_title(joint, fontsize="small")
        axes[0].legend(fontsize="small")
        figure.supxlabel("time [s], push shaded")
        figure.supylabel("speed [rad/s]")

    table = TextTable("a pushed joint on its feedforward alone", headings, rows)
    return Reproduction(
        "A.stability", judged(values, expectations("a_stability")), (table,), NOTES, {"stability": draw}
    )


def _figures(run: Released) -> tuple[float, float]:
    return run.at_release, run.growth
