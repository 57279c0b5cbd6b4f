"""Del Prete et al. (2016), Figs. 5 and 6.

A force sine on a rigid object, and what the command is made of in motion and in force.
"""

from typing import Any

import numpy as np

from drake_tc.control.torque_control import COMPONENTS
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.torque.running import TorqueRecording, estimated, simulate_scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import BoolArray, FloatArray, TextTable, text_rows

SETTLED = 3.0
"""The sine is evaluated from here on [s]: half a period after the force has risen."""
AXES = ("fx", "fy", "fz")
FIG5_NOTES = (
    "Simulated: foot on a rigid box, K6 = 0.1, Kf = 1, Kp = 2 as in the paper; an integral of the torque error"
    " (Ki = 5/s) takes out the gears' dry friction, which the paper's linear model does not hold.",
    "Forces are those on the foot, from the F/T log without filter delay; shares are of the sine's amplitude.",
)
FIG6_NOTES = (
    "Joint by joint: the RMS of each component of the command over the swing, and over the settled force sine.",
)


def fig5(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.fig5: how well the vertical force follows its sine, and what leaks to the other axes."""
    recording = _run("hrp2_leg_contact", "force_sine", seed, progress)
    late = recording.time >= SETTLED
    time, desired = recording.time[late], recording["force_reference"][late, :3]
    force = estimated(recording).contact_wrench[late, :3]
    amplitude = 0.5 * float(np.ptp(desired[:, 2]))
    error = force - desired
    values = {
        "overshoot of fz beyond its peaks": float(
            max(force[:, 2].max() - desired[:, 2].max(), desired[:, 2].min() - force[:, 2].min()) / amplitude
        ),
        "coupling to fx": float(np.abs(error[:, 0]).max() / amplitude),
        "coupling to fy": float(np.abs(error[:, 1]).max() / amplitude),
        "delay of fz": _delay(time, desired[:, 2], force[:, 2]),
        "rms error of fz": float(np.sqrt(np.mean(error[:, 2] ** 2)) / amplitude),
    }

    def draw(figure: Any) -> None:
        axes = figure.subplots(3, 1, sharex=True)
        for i, (name, axis) in enumerate(zip(AXES, axes, strict=True)):
            axis.plot(time, desired[:, i], "--", color="0.4", label="reference")
            axis.plot(time, force[:, i], label="on the foot")
            axis.set_ylabel(f"{name} [N]")
        axes[0].legend(loc="upper right")
        axes[-1].set_xlabel("time [s]")

    return Reproduction("A.fig5", evaluated(values, expectations("a_fig5")), (), FIG5_NOTES, {"fig5": draw})


def _delay(time: FloatArray, desired: FloatArray, force: FloatArray) -> float:
    """Lag [s] of `force` behind `desired`, whose cross-correlation is largest within half a second."""
    tick = time[1] - time[0]
    reach = round(0.5 / tick)
    a, b = desired[reach:-reach] - desired.mean(), force - force.mean()
    lags = np.arange(-reach, reach + 1)
    products = [float(a @ b[reach + lag : reach + lag + a.size]) for lag in lags]
    return float(lags[int(np.argmax(products))] * tick)


def fig6(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.fig6: the six components of the command, in motion and in force control."""
    motion = _run("hrp2_leg", "stairs_swing", seed, progress, 0.0)
    force = _run("hrp2_leg_contact", "force_sine", seed, progress, 0.4)
    joints = motion.robot.joints
    in_motion = _shares(motion, (motion.time > 0.8) & (motion.time < 2.0))
    in_force = _shares(force, force.time >= SETTLED)
    friction, torque = COMPONENTS.index("feedforward_friction"), COMPONENTS.index("feedforward_torque")
    knee, ankle = joints.index("r_knee"), joints.index("r_ankle_pitch")
    values = {
        "joints whose largest component in motion is friction feedforward": float(
            np.sum(np.argmax(in_motion, axis=0) == friction)
        ),
        "knee in force control: torque feedforward over the next largest": _lead(in_force[:, knee], torque),
        "knee in motion: friction feedforward over the next largest": _lead(in_motion[:, knee], friction),
        "ankle pitch in motion: friction feedforward over the next largest": _lead(in_motion[:, ankle], friction),
    }
    tables = tuple(
        TextTable(title, ("component [mrad]", *joints), text_rows(COMPONENTS, (1e3 * shares).T.tolist(), ".3f"))
        for title, shares in (("in motion, K6 = 1", in_motion), ("in force control, K6 = 0.1", in_force))
    )
    figures = {"fig6_motion": _drawing(motion, knee), "fig6_force": _drawing(force, knee)}
    return Reproduction("A.fig6", evaluated(values, expectations("a_fig6")), tables, FIG6_NOTES, figures)


def _run(diagram: str, name: str, seed: int, progress: Progress | None, share: float = 0.0) -> TorqueRecording:
    if progress:
        progress(name, share)
    return simulate_scenario(diagram_entry(diagram).scenario(name).changed(seed=seed, log_components=True))


def _components(recording: TorqueRecording) -> FloatArray:
    """(T, 6, n) in effort [rad]."""
    return np.asarray(recording["components"].reshape(-1, len(COMPONENTS), recording.size))


def _shares(recording: TorqueRecording, inside: BoolArray) -> FloatArray:
    """(6, n) RMS of each component [rad]."""
    return np.asarray(np.sqrt(np.mean(_components(recording)[inside] ** 2, axis=0)))


def _lead(shares: FloatArray, which: int) -> float:
    """One component over the largest of the others [-]."""
    return float(shares[which] / np.delete(shares, which).max())


def _drawing(recording: TorqueRecording, joint: int) -> Any:
    def draw(figure: Any) -> None:
        axis = figure.subplots()
        for i, name in enumerate(COMPONENTS):
            axis.plot(recording.time, 1e3 * _components(recording)[:, i, joint], label=name.replace("_", " "))
        axis.set_xlabel("time [s]")
        axis.set_ylabel(f"{recording.robot.joints[joint]}: part of the command [mrad]")
        axis.legend(loc="best", fontsize="small")

    return draw
