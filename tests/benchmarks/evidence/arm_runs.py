"""Simulated logs of an arm that follows a designed motion, and of the same arm with growing sinusoids in its place.

Links, friction, rotors and sensors are those of the benchmark `arms`, without any effect. The torques are Drake's
inverse dynamics of the given motion with friction and rotor inertias. Each motion is recorded twice with different
noise, and a Fourier series is held out. That series is also the log from which the design takes the noise. Both
motions have the same length and the same noise.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.interpolate import BPoly

from drake_tc.experiments.design.request import DesignRequest, designed_robot
from drake_tc.experiments.design.robot import RobotDesign, RobotOptions
from drake_tc.experiments.design.robot_search import STEP as DESIGN_STEP
from drake_tc.loops.recording import write_log
from drake_tc.types import FloatArray
from tests.benchmarks.blind_arm.arms import Arm
from tests.benchmarks.blind_arm.cases import rig_file, simulated_arm, sound_case, truth_of, write_files
from tests.benchmarks.blind_arm.recorder import STEP, SimulatedArm, record_motion, record_run

Progress = Callable[[str, float], None]
Motion = tuple[FloatArray, FloatArray, FloatArray]
SECONDS = 30.0
MOTIONS = ("designed", "sinusoids")
TRAINING_RUNS = 2
HELD_OUT = "run_held.npz"


@dataclass(frozen=True, eq=False)
class ArmRuns:
    """The logs of one arm.

    Attributes:
        folders: Motion to the folder of its logs, robot file and rig file.
        truth: Friction, rotor inertias and link parameters of the simulated arm.
        predicted: Parameter to the widths of its 95 % interval that the design predicts, after the designed motion and
            after growing sinusoids [SI].
        seconds: Processor time of the design [s].
    """

    folders: Mapping[str, Path]
    truth: Mapping[str, Any]
    predicted: Mapping[str, tuple[float, float]]
    seconds: float


def arm_runs(arm: Arm, seed: int, folder: Path, progress: Progress) -> ArmRuns:
    """Design a motion of all joints and record it, and growing sinusoids within the same limits.

    Args:
        arm: Which.
        seed: Of the arm's parameters, the noise, the held-out motion and the starts of the design.
        folder: Gets a folder for each of `MOTIONS`.
        progress: Told how far it is.

    Raises:
        ParamsError: No motion keeps the limits, or `example-robot-data` is not installed.
    """
    case = sound_case(arm, seed)
    folders = {name: folder / name for name in MOTIONS}
    robots = {name: write_files(case, each, rig_file(case)) for name, each in folders.items()}
    simulated = simulated_arm(case, robots[MOTIONS[0]], np.random.default_rng(case.seed))
    held = record_run(simulated, TRAINING_RUNS, np.random.default_rng([case.seed, TRAINING_RUNS]), SECONDS)
    for each in folders.values():
        write_log(held, each / HELD_OUT)
    started = process_time()
    first = (folders[MOTIONS[0]] / HELD_OUT,)
    request = DesignRequest(folders[MOTIONS[0]] / "rig.yaml", first, None, "parameters", None, (), {})
    design = designed_robot(request, RobotOptions(SECONDS, seed=seed), progress)
    seconds = process_time() - started
    time, motions = compared_motions(design)
    for name, motion in motions.items():
        for number in range(TRAINING_RUNS):
            rng = np.random.default_rng([case.seed, number])
            write_log(record_motion(simulated, number, rng, time, motion), folders[name] / f"run_{number + 1}.npz")
    return ArmRuns(folders, true_values(simulated), predicted_widths(design), seconds)


def true_values(arm: SimulatedArm) -> dict[str, Any]:
    """Truth as `bench arms` writes it, with `rotor`: joint to rotor inertia [kg m^2]."""
    return truth_of(arm) | {"rotor": {joint: each.rotor_inertia for joint, each in arm.case.joints.items()}}


def compared_motions(design: RobotDesign) -> tuple[FloatArray, dict[str, Motion]]:
    """(time (T,), motion to (q, qdot, qddot), each (T, n)) at the step of the simulation.

    Both have the length of the sinusoids. The designed motion begins at rest with its lead-in, and its end is cut off:
    otherwise it would have more samples than the sinusoids.

    Args:
        design: From `design_robot`.
    """
    length = DESIGN_STEP * (design.sinusoids.shape[1] - 1)
    time = np.arange(round(length / STEP) + 1, dtype=np.float64) * STEP
    made = design.motion(1.0 / STEP)[1]
    q, v, a = np.stack([made[joint][:3, : time.size] for joint in design.joints], axis=-1)
    return time, {MOTIONS[0]: (q, v, a), MOTIONS[1]: resampled(design.sinusoids[:3], DESIGN_STEP, time)}


def resampled(motion: FloatArray, step: float, time: FloatArray) -> Motion:
    """q, qdot, qddot (T, n) of the quintic spline that has the given values at its knots.

    Args:
        motion: (3, K, n) q, qdot, qddot at the knots [rad, rad/s, rad/s^2].
        step: Between the knots [s].
        time: (T,) within the knots [s].
    """
    knots = step * np.arange(motion.shape[1])
    splines = [BPoly.from_derivatives(knots, motion[:, :, i].T) for i in range(motion.shape[2])]
    inside = np.minimum(time, knots[-1])
    q, v, a = (np.stack([spline(inside, order) for spline in splines], axis=-1) for order in range(3))
    return q, v, a


def predicted_widths(design: RobotDesign) -> dict[str, tuple[float, float]]:
    """Parameter to the widths of its 95 % interval, after the designed motion and after the sinusoids [SI].

    The design states them for one run. Those of so many runs as are fitted are narrower by the root of their number.
    """
    both = 2.0 / math.sqrt(TRAINING_RUNS)
    return {each.name.partition(",")[0]: (both * each.after, both * each.default) for each in design.expected}
