"""Paper C, the whole loop in motion: turns of the trunk at 1 and 0.5 Hz, a genuflection, by either base estimator."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from drake_tc.diagrams.papers.reproduction import Progress, Reproduction, TextTable, expectations, judged
from drake_tc.diagrams.tsid.references import task_source
from drake_tc.diagrams.tsid.running import TsidRecording, simulate_tsid
from drake_tc.diagrams.tsid.scenario import load_tsid_scenario
from scipy.signal import butter, sosfiltfilt, welch

from drake_tc.control.rotation import rotation_matrix, rotation_vector
from drake_tc.types import FloatArray

SCENARIOS = Path(__file__).parents[1] / "coman.scenario.yaml"
OURS, BASELINE = "CoP estimator", "foot centre"
TRUNK = "torso"
SINCE = 0.5
"""Figures are from here on [s]: the start on soles that are not loaded yet has died away."""
ABOVE_HZ = 5.0
"""What joints do faster than this is no part of the motion."""
EVERY = 10
"""One sample in so many is looked at for the trunk."""
NOTES = (
    "Simulated: the robot of models/coman_like on soft soles, 1e5 N/m in the turns and 3e5 N/m in the genuflection;"
    " series-elastic joints under voltage, 15 ms of loop delay, noisy sensors with biases, 2 to 3 N m of dry friction,"
    " known to the controller. Drives, sensors and robot are models with chosen numbers, no measurement of a real one.",
    "Base errors: both estimators in the same run, the one with ours in the loop; yaw is that of the base.",
    "Vibration: root mean square of the joints' velocities above 5 Hz, the worst joint, until the end or the fall.",
)


@dataclass(frozen=True)
class BaseErrors:
    """Root mean squares: position [m], linear velocity [m/s], yaw [rad]."""

    position: float
    velocity: float
    yaw: float


def base_errors(run: TsidRecording, signal: str) -> BaseErrors:
    """Of an estimate of [q; v] that shows the last tick's sample, against the plant's state at that sample."""
    late, nq = run.time[1:] > SINCE, run.law.model.nq
    found, true = run[signal][1:][late], run["state"][:-1][late]
    wrong = found - true
    yaw = _yaw(found) - _yaw(true)
    return BaseErrors(_rms(wrong[:, 4:7]), _rms(wrong[:, nq + 3 : nq + 6]), _rms(np.arctan2(np.sin(yaw), np.cos(yaw))))


def _rms(values: FloatArray) -> float:
    """Of the length of rows, or of numbers."""
    squares = np.square(values).reshape(len(values), -1).sum(axis=1)
    return float(np.sqrt(squares.mean()))


def _yaw(states: FloatArray) -> FloatArray:
    w, x, y, z = states[:, :4].T
    angle: FloatArray = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return angle


def joint_speeds(run: TsidRecording) -> FloatArray:
    """(T, n) true joint velocities [rad/s], from `SINCE` on."""
    model = run.law.model
    speeds: FloatArray = run["state"][:, model.nq + model.actuated][run.time > SINCE]
    return speeds


def vibration(run: TsidRecording) -> float:
    """Root mean square of the joints' velocities above `ABOVE_HZ`, of the worst joint [rad/s]."""
    filtered = butter(4, ABOVE_HZ, "high", fs=1.0 / run.law.period, output="sos")
    fast = sosfiltfilt(filtered, joint_speeds(run), axis=0)
    return float(np.sqrt(np.square(fast).mean(axis=0)).max())


def trunk_errors(run: TsidRecording) -> FloatArray:
    """(S,) angle between the wanted and the true orientation of the trunk [rad], from `SINCE` on."""
    law = run.law
    source = task_source(law, TRUNK, run.scenario.motion[TRUNK])
    context, scratch, nq = source.CreateDefaultContext(), law.model.create_scratch(), law.model.nq
    found = []
    for now, state in zip(run.time[::EVERY], run["state"][::EVERY], strict=True):
        if now <= SINCE:
            continue
        context.SetTime(now)
        wanted = rotation_matrix(source.get_output_port().Eval(context)[:4])
        true = law.model.terms(scratch, state[:nq], state[nq:]).pose(TRUNK)[0]
        found.append(np.linalg.norm(rotation_vector(wanted.T @ true)))
    return np.array(found)


def motion(scenario: str, id_: str, seed: int, progress: Progress | None) -> Reproduction:
    """One motion of the trunk, by both estimators.

    Args:
        scenario: Of diagrams/coman.scenario.yaml; with "_foot_centre" behind it, that of the baseline.
        id_: Of the reproduction.
        seed: Of the sensors' noise.
        progress: Told which run it is.
    """
    runs: dict[str, TsidRecording] = {}
    names = {OURS: (scenario, "{estimator: {beside: foot_centre}}"), BASELINE: (f"{scenario}_foot_centre", None)}
    for number, (name, (which, text)) in enumerate(names.items()):
        if progress:
            progress(name, number / len(names))
        runs[name] = simulate_tsid(load_tsid_scenario(SCENARIOS, which, text).changed(seed=seed))
    ours, theirs = (base_errors(runs[OURS], signal) for signal in ("estimated_state", "beside_state"))
    shaking = {name: vibration(run) for name, run in runs.items()}
    tracking = {name: trunk_errors(run) for name, run in runs.items()}
    values = {f"{name}: fell": float(run.fell is not None) for name, run in runs.items()}
    values |= {
        f"{OURS}: largest error of the trunk [rad]": float(tracking[OURS].max()),
        f"{OURS}: vibration above 5 Hz [rad/s]": shaking[OURS],
        "vibration above 5 Hz, foot centre over ours": shaking[BASELINE] / shaking[OURS],
        "base position error, ours over foot centre": ours.position / theirs.position,
        "base velocity error, ours over foot centre": ours.velocity / theirs.velocity,
        "base yaw error, ours over foot centre": ours.yaw / theirs.yaw,
        f"{OURS}: base position RMSE [m]": ours.position,
        f"{OURS}: base velocity RMSE [m/s]": ours.velocity,
        f"{OURS}: base yaw RMSE [rad]": ours.yaw,
    }
    table = TextTable(
        "the whole loop by estimator",
        ("estimator in the loop", "ends at [s]", "fell", "trunk, RMS [mrad]", "vibration > 5 Hz [rad/s]"),
        tuple(
            (
                name,
                f"{run.time[-1]:.2f}",
                "-" if run.fell is None else f"{run.fell:.2f} s",
                f"{1e3 * _rms(tracking[name]):.1f}",
                f"{shaking[name]:.3f}",
            )
            for name, run in runs.items()
        ),
    )
    file = id_.lower().replace(".", "_")
    return Reproduction(id_, judged(values, expectations(file)), (table,), NOTES, {file: _spectra(runs)})


def _spectra(runs: Mapping[str, TsidRecording]) -> Any:
    """Draws the mean spectrum of the joints' velocities by run."""

    def draw(figure: Any) -> None:
        axis = figure.subplots()
        for name, run in runs.items():
            speeds = joint_speeds(run)
            frequency, density = welch(speeds, 1.0 / run.law.period, nperseg=min(1024, len(speeds)), axis=0)
            axis.loglog(frequency[1:], np.sqrt(density.mean(axis=1))[1:], label=name)
        axis.set_xlabel("frequency [Hz]")
        axis.set_ylabel("joint velocities [rad/s/√Hz]")
        axis.set_xlim(0.5, 200.0)
        axis.legend()

    return draw


def turn_1hz(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.turn1hz: the trunk turns about the vertical, 0.5 rad at 1 Hz."""
    return motion("turn_1hz", "C.turn1hz", seed, progress)


def turn_half_hz(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.turn_half_hz: the trunk turns about the vertical, 0.7 rad at 0.5 Hz."""
    return motion("turn_half_hz", "C.turn_half_hz", seed, progress)


def genuflection(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.genuflection: the trunk pitches by 0.8 rad in 0.7 s and back."""
    return motion("genuflection", "C.genuflection", seed, progress)
