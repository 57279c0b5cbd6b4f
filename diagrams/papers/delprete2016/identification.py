"""The identification experiment of Del Prete et al. (2016) (section 3.4) on the simulated leg, and its two linear fits.

Under the vendor's servo the leg moves in growing sinusoids, and holds a posture while hands push its foot. A third run
sways slowly under the same pushes: at rest friction hides any torque within its band, in slow motion it is known.
Sensors are realistic; joint torques come from the F/T sensor, the IMU and the encoders, off line and without delay.
Two more runs, of other frequencies, pushes and noise, are held out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.estimation.off_line import OffLineFilter, SensorLog, estimate_log, wrench_bias
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.identification.actuator import ratio_interval
from drake_tc.identification.asymmetric import asymmetric_least_squares
from drake_tc.identification.identify import prepare
from drake_tc.identification.regression import least_squares
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig
from drake_tc.loops.recording import write_log, write_rig
from drake_tc.loops.scenarios import PushSpec, SinusoidSpec
from drake_tc.loops.torque.running import TorqueRecording, log_columns, rig_of, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario, sensor_suite
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress
from drake_tc.types import FloatArray

Penalty = Literal["symmetric", "asymmetric"]
FILTER = OffLineFilter.of(41)
"""Of the torque estimate [samples]; longer windows smear the reversals, shorter ones let noise through."""
UNTOUCHED = slice(100, 400)
"""Samples before any push and any large motion: the F/T sensors' bias is read there."""
WEIGHT = 100.0
"""Of over-estimated effort in the asymmetric fit (the paper's w)."""
LINEAR = ("K_tau", "K_v")
TRAIN = ("motion", "sway")
SWAY_RATE, SWAY_SIZE = 0.3, 0.06
"""While the foot is pushed: share of the motion run's frequencies, and amplitude [rad]."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """What was recorded.

    Attributes:
        still: Log files of the paper's own experiment: growing sinusoids, pushes on a held posture.
        train: Log files that the complete model is fitted to: growing sinusoids, pushes on a swaying leg.
        held: Log files that take no part in any fit.
        unscaled: As `train`, with the F/T sensors' scale error, which only a simulation knows, undone: a control.
        rig: Rig file, with the rotor inertias as known values.
        joints: In the robot's order.
        truth: Joint to the simulated actuator.
        torque_share: Joint to RMS error of its torque estimate over the torque's range, all runs.
        seed: Of the sensors' noise.
    """

    still: tuple[Path, ...]
    train: tuple[Path, ...]
    held: tuple[Path, ...]
    unscaled: tuple[Path, ...]
    rig: Path
    joints: tuple[str, ...]
    truth: Mapping[str, ActuatorModel]
    torque_share: Mapping[str, float]
    seed: int


def experiment_scenarios(seed: int) -> dict[str, Scenario]:
    """The runs by name; those whose name starts with "held" are held out."""
    entry = diagram_entry("hrp2_leg")
    motion, pushes = (entry.scenario(name) for name in ("identify_motion", "identify_pushes"))
    sway = replace(pushes, motion=replace(pushes.motion, sinusoids=_sway(motion)))
    runs = {"motion": motion, "pushes": pushes, "sway": sway}
    runs |= {"held_motion": _other_motion(motion), "held_sway": _turned(sway)}
    return {
        name: replace(run, seed=1000 * seed + number, log_truth=True) for number, (name, run) in enumerate(runs.items())
    }


def _sway(motion: Scenario) -> dict[str, SinusoidSpec]:
    """Slow sinusoids of every joint: under a push at rest, friction may hide any torque within its band."""
    return {
        joint: SinusoidSpec(SWAY_RATE * spec.frequency_hz, SWAY_SIZE) for joint, spec in motion.motion.sinusoids.items()
    }


def _other_motion(scenario: Scenario) -> Scenario:
    """The same with frequencies a sixth higher and amplitudes a tenth lower."""
    changed = {
        joint: SinusoidSpec(s.frequency_hz * 7.0 / 6.0, 0.9 * s.start, 0.9 * s.growth)
        for joint, s in scenario.motion.sinusoids.items()
    }
    return replace(scenario, motion=replace(scenario.motion, sinusoids=changed))


def _turned(scenario: Scenario) -> Scenario:
    """The same pushes the other way round, a tenth weaker."""
    return replace(scenario, pushes=tuple(_reversed(push) for push in scenario.pushes))


def _reversed(push: PushSpec) -> PushSpec:
    force, torque = (tuple(-0.9 * value for value in vector) for vector in (push.force, push.torque))
    return replace(push, force=force, torque=torque)


def record_experiment(folder: Path, progress: Progress | None = None, seed: int = 0) -> Experiment:
    """Simulate the runs, estimate their torques, and write logs and rig file into `folder`.

    Args:
        folder: Where to; must exist.
        progress: Told which run and which share of all of them.
        seed: Of the sensors' noise.

    Raises:
        DrakeTcError: see `simulate_scenario`, `estimate_log`, `write_log`.
    """
    scenarios = experiment_scenarios(seed)
    files: dict[str, Path] = {}
    squares: list[FloatArray] = []
    peaks: list[FloatArray] = []
    for number, (name, scenario) in enumerate(scenarios.items()):
        if progress:
            progress(f"recording {name}", number / len(scenarios))
        recording = simulate_scenario(scenario)
        torque = off_line_torque(recording, scenario.dt)
        error = torque - recording["joint_torque"]
        squares.append(np.mean(error**2, axis=0))
        peaks.append(np.stack([recording["joint_torque"].min(axis=0), recording["joint_torque"].max(axis=0)]))
        files[name] = write_log(log_columns(recording, torque), folder / f"{name}.npz")
        if name in TRAIN:
            scale = np.asarray(sensor_suite(scenario).force.scale, dtype=np.float64)
            unscaled = off_line_torque(recording, scenario.dt, scale)
            control = f"{name}_unscaled"
            files[control] = write_log(log_columns(recording, unscaled), folder / f"{control}.npz")
    rig = write_rig(rig_of(recording), folder / "rig.yaml")
    span = np.max(peaks, axis=0)[1] - np.min(peaks, axis=0)[0]
    share = np.sqrt(np.mean(squares, axis=0)) / span
    return Experiment(
        still=(files["motion"], files["pushes"]),
        train=(files[TRAIN[0]], files[TRAIN[1]]),
        held=(files["held_motion"], files["held_sway"]),
        unscaled=(files[f"{TRAIN[0]}_unscaled"], files[f"{TRAIN[1]}_unscaled"]),
        rig=rig,
        joints=recording.robot.joints,
        truth=recording.models,
        torque_share=dict(zip(recording.robot.joints, map(float, share), strict=True)),
        seed=seed,
    )


def off_line_torque(recording: TorqueRecording, dt: float, scale: float | FloatArray = 1.0) -> FloatArray:
    """(T, n) joint torques [N m] from what the robot's own sensors saw, at their own time, F/T bias taken off.

    Args:
        recording: A run that begins untouched.
        dt: Sampling period [s].
        scale: Of the F/T readings, to be divided by.
    """
    model = TorqueModel(recording.robot)
    wrench = np.asarray(recording["force_torque"] / scale)
    log = SensorLog(recording["encoder"], recording["imu"], wrench, dt)
    bias = wrench_bias(model, log, UNTOUCHED, FILTER)
    return estimate_log(model, log, FILTER, bias).torque


def linear_models(experiment: Experiment, penalty: Penalty) -> dict[str, ActuatorModel]:
    """The paper's model effort = K_tau tau + K_v qdot of every joint, by one of its two penalties.

    Source: Del Prete et al., 2016, section 3.

    As in the paper there is no Coulomb column and no rotor inertia, although the simulated joints have both, a dead
    zone and a switch besides: what the two columns cannot say ends up in their coefficients.

    Args:
        experiment: Its runs as in the paper are fitted.
        penalty: "symmetric" (least squares) or "asymmetric" (over-estimation costs `WEIGHT` times more).

    Raises:
        IdentificationError: runs that do not tell the two apart.
    """
    rig = parse_rig({"joints": list(experiment.joints), "drive": "position_servo", "load": "torque"})
    runs = load_runs(experiment.still, rig)
    return {joint: _linear_model(runs, rig, joint, penalty) for joint in experiment.joints}


def _linear_model(runs: list[Run], rig: Rig, joint: str, penalty: Penalty) -> ActuatorModel:
    samples = prepare(runs, rig, joint)
    columns = np.stack([samples.torque, samples.velocity], axis=1)
    if penalty == "symmetric":
        linear = least_squares(columns, samples.effort, names=LINEAR, lengths=samples.lengths)
        value, interval, covariance = linear.parameters, linear.intervals, linear.hac_covariance
    else:
        fit = asymmetric_least_squares(columns, samples.effort, names=LINEAR, weight=WEIGHT, lengths=samples.lengths)
        value, covariance = fit.parameters, fit.hac_covariance
        interval = {name: (float(low), float(high)) for name, (low, high) in zip(LINEAR, fit.ci95, strict=True)}
    correlation = float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]))
    gain = value["K_tau"]
    spread = ratio_interval(interval["K_v"], value["K_v"], interval["K_tau"], gain, correlation)
    viscous = EffectValue("viscous", {"viscous": value["K_v"] / gain}, {"viscous": spread})
    return ActuatorModel(joint, Drive("position_servo", gain), (viscous,))
