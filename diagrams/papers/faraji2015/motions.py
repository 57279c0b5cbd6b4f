"""Faraji et al. (2015), the whole loop in motion.

Turns of the trunk at 1 and 0.5 Hz, a genuflection, by either base estimator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt, welch

from drake_tc.control.rotation import rotation_matrix, rotation_vector
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.whole_body.references import task_source
from drake_tc.loops.whole_body.running import TsidRecording, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import FloatArray, TextTable

SCENARIOS = Path(__file__).parents[2] / "coman.scenario.yaml"
OURS, BASELINE, DAMPED = "CoP estimator", "foot centre", "CoP estimator, joint damping"
TRUNK = "torso"
SINCE = 0.5
"""Figures are from here on [s]: the start on soles that are not loaded yet has died away."""
ABOVE_HZ = 5.0
"""What joints do faster than this is no part of the motion."""
SEEDS = 3
"""Base errors are evaluated by the worst of so many."""
EVERY = 10
"""One sample in so many is looked at for the trunk."""
NOTES = (
    "Simulated: the robot of models/coman_like on soft soles, 1e5 N/m in the turns and 3e5 N/m in the genuflection;"
    " series-elastic joints under voltage, 15 ms of loop delay, noisy sensors with biases, 2 to 3 N m of dry friction,"
    " known to the controller. Drives, sensors and robot are models with chosen numbers, no measurement of a real one.",
    "Base errors: both estimators in the same run, the one with ours in the loop; yaw is that of the base. The worst of"
    " three seeds. Ours is told that the floor is level, the soles' stiffness and outline, and how late the IMU is; the"
    " chain is told none of it and does not use the IMU (C.soles has both with less and with more).",
    "Vibration: root mean square of the joints' velocities above 5 Hz, the worst joint, until the end or the fall.",
)
ON_DAMPING = (
    "Joint damping: 2 N m s/rad times the joints' velocities, as the estimator has them, off the torques of legs and"
    " waist; of 1, 2, 4, ... the most with which the turn at 0.5 Hz does not end in a fall. The arms have none: with 2"
    " on all joints the shoulders shake at 1.8 rad/s, 15 ms being long for their inertia."
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


def rmse_values(name: str, errors: BaseErrors) -> dict[str, float]:
    """Values of a reproduction: the errors of an estimate, by name and unit."""
    return {
        f"{name}: base position RMSE [m]": errors.position,
        f"{name}: base velocity RMSE [m/s]": errors.velocity,
        f"{name}: base yaw RMSE [rad]": errors.yaw,
    }


def _both(run: TsidRecording) -> tuple[BaseErrors, BaseErrors]:
    """Of ours and of the chain beside it."""
    return base_errors(run, "estimated_state"), base_errors(run, "beside_state")


def _rms(values: FloatArray) -> float:
    """Of the length of rows, or of numbers."""
    squares = np.square(values).reshape(len(values), -1).sum(axis=1)
    return float(np.sqrt(squares.mean()))


def _yaw(states: FloatArray) -> FloatArray:
    w, x, y, z = states[:, :4].T
    angle: FloatArray = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
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


def trunk_orientations(run: TsidRecording) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Instants (S,) [s] from `SINCE` on, and the trunk's orientations then, desired and true, (S, 3, 3)."""
    law = run.law
    source = task_source(law, TRUNK, run.scenario.motion[TRUNK])
    context, scratch, nq = source.CreateDefaultContext(), law.model.create_scratch(), law.model.nq
    times, desired, true = [], [], []
    for now, state in zip(run.time[::EVERY], run["state"][::EVERY], strict=True):
        if now <= SINCE:
            continue
        context.SetTime(now)
        times.append(now)
        reference = np.asarray(source.get_output_port().Eval(context))
        desired.append(rotation_matrix(reference[:4]))
        true.append(law.model.terms(scratch, state[:nq], state[nq:]).pose(TRUNK)[0])
    return np.array(times), np.array(desired), np.array(true)


def trunk_errors(run: TsidRecording) -> FloatArray:
    """(S,) angle between the desired and the true orientation of the trunk [rad], from `SINCE` on."""
    _, desired, true = trunk_orientations(run)
    return np.array([np.linalg.norm(rotation_vector(w.T @ t)) for w, t in zip(desired, true, strict=True)])


def turn_gain(run: TsidRecording) -> float:
    """Amplitude of the trunk's turn to and fro over the desired one, once that is full; NaN if it moves otherwise."""
    turn = run.scenario.motion[TRUNK].turn
    if turn is None or turn.times or run.fell is not None:
        return math.nan
    times, *orientations = trunk_orientations(run)
    waves = np.exp(2j * np.pi * turn.frequency_hz * times)
    basis = np.stack([np.ones_like(times), waves.real, waves.imag], axis=1)
    axis = np.array(turn.axis) / np.linalg.norm(turn.axis)
    late = times > turn.begin + turn.rise
    desired, true = (
        np.linalg.lstsq(basis[late], np.array([rotation_vector(R) @ axis for R in all_[late]]), rcond=None)[0]
        for all_ in orientations
    )
    return float(np.hypot(*true[1:]) / np.hypot(*desired[1:]))


def motion(scenario: str, id_: str, seed: int, progress: Progress | None, *, damped: bool) -> Reproduction:
    """One motion of the trunk, by both estimators.

    Args:
        scenario: Of diagrams/coman.scenario.yaml; with "_foot_centre" behind it, that of the baseline.
        id_: Of the reproduction.
        seed: Of the sensors' noise.
        progress: Told which run it is.
        damped: Run that with "_damped" behind it too.
    """
    runs: dict[str, TsidRecording] = {}
    names = {OURS: (scenario, "{estimator: {beside: foot_centre}}"), BASELINE: (f"{scenario}_foot_centre", None)}
    if damped:
        names[DAMPED] = (f"{scenario}_damped", None)
    for number, (name, (which, text)) in enumerate(names.items()):
        if progress:
            progress(name, number / len(names))
        runs[name] = simulate_tsid(TsidScenario.load(SCENARIOS, which, text).changed(seed=seed))
    others = [TsidScenario.load(SCENARIOS, *names[OURS]).changed(seed=seed + more) for more in range(1, SEEDS)]
    compared = [_both(run) for run in (runs[OURS], *(simulate_tsid(scenario) for scenario in others))]
    ours, chain = compared[0]
    shaking = {name: vibration(run) for name, run in runs.items()}
    tracking = {name: trunk_errors(run) for name, run in runs.items()}
    values = {f"{name}: fell": float(run.fell is not None) for name, run in runs.items()}
    values |= {f"{name}: falls at [s]": run.fell for name, run in runs.items() if run.fell is not None}
    values |= {
        f"{OURS}: largest error of the trunk [rad]": float(tracking[OURS].max()),
        f"{OURS}: vibration above 5 Hz [rad/s]": shaking[OURS],
        "vibration above 5 Hz, foot centre over ours": shaking[BASELINE] / shaking[OURS],
        "base position error, ours over foot centre": max(own.position / chain.position for own, chain in compared),
        "base velocity error, ours over foot centre": max(own.velocity / chain.velocity for own, chain in compared),
        "base yaw error, ours over foot centre": max(own.yaw / chain.yaw for own, chain in compared),
    }
    values |= rmse_values(OURS, ours) | rmse_values(f"{BASELINE}, in the same run", chain)
    if damped:
        values |= {
            "trunk RMS, joint damping over none": _rms(tracking[DAMPED]) / _rms(tracking[OURS]),
            "vibration above 5 Hz, joint damping over none": shaking[DAMPED] / shaking[OURS],
            "amplitude of the turn over the desired, no damping": turn_gain(runs[OURS]),
            "amplitude of the turn over the desired, joint damping": turn_gain(runs[DAMPED]),
        }
    table = TextTable(
        "the whole loop by estimator and joint damping",
        ("in the loop", "ends at [s]", "fell", "trunk, RMS [mrad]", "vibration > 5 Hz [rad/s]"),
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
    notes = (*NOTES, ON_DAMPING) if damped else NOTES
    return Reproduction(id_, evaluated(values, expectations(file)), (table,), notes, {file: _spectra(runs)})


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
    return motion("turn_1hz", "C.turn1hz", seed, progress, damped=True)


def turn_half_hz(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.turn_half_hz: the trunk turns about the vertical, 0.7 rad at 0.5 Hz."""
    return motion("turn_half_hz", "C.turn_half_hz", seed, progress, damped=True)


def genuflection(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.genuflection: the trunk pitches by 0.8 rad in 0.7 s and back."""
    return motion("genuflection", "C.genuflection", seed, progress, damped=False)
