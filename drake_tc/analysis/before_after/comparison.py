"""What a better model does to the closed loop: the torque loop with the model after as its plant, compensated twice.

    reference (a held-out run's motion) --> torque loop, controller compensates the model BEFORE --> tracking error
                                        --> the same,    controller compensates the model AFTER  --> tracking error

Simulated. Both loops have the same plant, gains K6, K7, Kp (Ks and Kd follow from the controller's own K_tau), filters,
sensors and seed. Margins are those of each joint's linear loop (`JointLoop`) with the model after as the truth. A rig
that names no robot gets one: each of its joints with the pendulum that its load is.

One loop of the comparison before and after: simulated in a process of its own or here, and cut to its motion.
"""

import math
import time as clock
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import ModelFile, load_models
from drake_tc.analysis.before_after.case import LoopCase, loop_case, write_welded_robot
from drake_tc.control.guard import GuardMode, GuardSpec
from drake_tc.control.joint_loop import JointLoop, quick_margins, with_values
from drake_tc.control.stability_margins import Margins
from drake_tc.diagnosis.result.applications import ClosedLoop, JointClosedLoop, LoopFigures
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import DrakeTcError, ParamsError
from drake_tc.loops.recording import Progress
from drake_tc.loops.scenarios import GainSpec
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.sensor_validation.monitor_spec import MonitorSpec
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Trace:
    """A simulated motion of n joints.

    Attributes:
        time: (T,) [s].
        reference, error: (T, n) q_d, q_d - q [rad]; NaN from where a joint ran away.
        ran_away: That it did.
        held: That the guard did not pass the controller's command all the time.
    """

    time: FloatArray
    reference: FloatArray
    error: FloatArray
    ran_away: bool
    held: bool


def simulated(scenarios: Mapping[str, Scenario], progress: Progress, executor: Executor | None) -> dict[str, Trace]:
    """One trace a scenario, beside each other where there is an executor."""
    progress("closed loop, simulating", 0.1)
    if executor is not None:
        futures = {side: executor.submit(track, scenario) for side, scenario in scenarios.items()}
        return {side: future.result() for side, future in futures.items()}
    traces = {}
    for number, (side, scenario) in enumerate(scenarios.items()):
        progress(f"closed loop, simulating {side}", 0.1 + 0.8 * number / len(scenarios))
        traces[side] = track(scenario)
    return traces


def track(scenario: Scenario) -> Trace:
    """Simulate one loop.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed.
    """
    made = simulate_scenario(scenario, allow_runaway=True)
    begin = scenario.motion.times[0]
    n, done = made.size, made.time.size
    ran_away = made.time[-1] < scenario.duration - 1.5 * scenario.dt
    ticks = round(scenario.duration / scenario.dt) + 1 if ran_away else done
    time = np.arange(ticks, dtype=np.float64) * scenario.dt
    reference, error = np.full((ticks, n), np.nan), np.full((ticks, n), np.nan)
    reference[:done] = made["reference"][:, :n]
    error[:done] = made.tracking_error
    kept = time >= begin
    mode = made["mode"][made.time >= begin]
    held = bool((mode != GuardMode.NORMAL).any())
    return Trace(time[kept] - begin, reference[kept], error[kept], bool(ran_away), held)


def remarks(side: str, trace: Trace) -> list[str]:
    """What the reader must know of a trace."""
    words = {"before": "the model before", "after": "the model after"}[side]
    if trace.ran_away:
        until = float(trace.time[int(np.argmin(np.isfinite(trace.error).all(axis=1)))])
        return [f"With {words} compensated, the simulated robot ran away {until:.2f} s into the motion."]
    return [f"With {words} compensated, the guard held back the command for a while."] if trace.held else []


TAIL = 0.1
"""Rest after the motion [s]."""
SETTINGS = ((1.0, 2.0), (1.0, 1.0), (0.5, 1.0), (0.5, 0.5), (0.25, 0.5), (0.1, 0.5), (0.1, 0.2))
"""(K6, Kp) from stiff to soft: each joint takes the first whose loop, with the model after, is sound."""
K7 = 0.01
"""[s]."""
SOUND = 3.0
"""Largest sensitivity peak of a sound loop."""
RESOLUTION = 0.5
"""The plant's step times the stiff servo's eigenfrequency, at most [rad]."""
MOST_SUBSTEPS = 5
MOST_POINTS = 1500
"""Samples of a trace that are kept for plots."""
_THRESHOLDS = (
    *("encoder_frozen", "encoder_stuck", "imu_frozen", "wrench_frozen", "encoder_jump", "encoder_acceleration"),
    *("gyro_jump", "accel_jump", "force_jump", "moment_jump", "still_gyro", "still_accel", "unexpected_force"),
    *("unexpected_moment", "torque"),
)
_NEVER: Any = dict.fromkeys(_THRESHOLDS, math.inf)
UNWATCHED = MonitorSpec(**_NEVER)
"""Nothing fails here, and a joint that hangs in its friction is to be seen, not held."""

SIDES = ("before", "after")


def compare_loops(
    result: CloseLoopResult,
    seed: int = 0,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> ClosedLoop:
    """The closed loop before and after of what `close_loop` found; where it cannot be made, a note says why.

    Args:
        result: Of `close_loop`.
        seed: Of the sensors' noise.
        progress: Told how far it is.
        executor: Runs the two simulations beside each other; None runs them here.
    """
    begin = clock.perf_counter()
    progress("closed loop", 0.0)
    with TemporaryDirectory() as name:
        folder = Path(name)
        try:
            found = run_case(loop_case(result, folder, seed), folder, progress, executor)
        except (DrakeTcError, RuntimeError) as error:
            found = ClosedLoop({}, notes=(f"No closed loop was made: {' '.join(str(error).split())}.",))
    return replace(found, seconds=clock.perf_counter() - begin)


def run_case(
    case: LoopCase,
    folder: Path,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> ClosedLoop:
    """Simulate both loops and take both loops' margins.

    Args:
        case: What is compared.
        folder: For the model files.
        progress: Told how far it is.
        executor: Runs the simulations beside each other; None runs them here.

    Raises:
        ParamsError: a robot that the loop cannot take.
    """
    robot = load_robot(case.robot)
    notes: list[str] = []
    if not robot.fixed_base:
        case = replace(case, robot=write_welded_robot(robot, folder))
        notes.append("The base floats, and nothing says what carries it: in the simulation it is held still.")
    scenarios = _scenarios(case, robot, folder)
    gains = chosen_gains(joint_loops(scenarios["after"]))
    scenarios = {side: replace(scenario, gains=gains) for side, scenario in scenarios.items()}
    loops = {side: joint_loops(scenario) for side, scenario in scenarios.items()}
    changed = {name: bool(case.shared) or case.before[name] != model for name, model in case.after.items()}
    sides = SIDES if any(changed.values()) else SIDES[1:]
    drives = sorted({model.drive.kind for model in case.after.values()} - {"position_servo"})
    traces: dict[str, Trace] = {}
    if drives:
        notes.append(
            f"Tracking was not simulated: the loop commands position servos, and this rig has a {drives[0]} drive."
        )
    else:
        fine = scenarios["after"].dt / _substeps(loops["after"], scenarios["after"].dt)
        traces = simulated({side: scenarios[side].changed(plant_step=fine) for side in sides}, progress, executor)
        notes += [note for side, trace in traces.items() for note in remarks(side, trace)]
        traces.setdefault("before", traces["after"])
    progress("closed loop, margins", 0.9)
    return ClosedLoop(
        joints={
            name: JointClosedLoop(
                **_joint(robot.joints.index(name), {side: loops[side][name] for side in SIDES}, traces),
                changed=changed[name],
                gains=dict(gains.by_joint[name]),
            )
            for name in case.after
        },
        plant=case.plant,
        controller=_words(scenarios["after"]),
        run=case.motion.run,
        start=case.motion.start,
        end=case.motion.end,
        time=_thinned(traces["after"].time) if traces else None,
        changed=any(changed.values()),
        notes=(*notes, *case.notes),
    )


def _scenarios(case: LoopCase, robot: Robot, folder: Path) -> dict[str, Scenario]:
    """Both loops as scenarios; joints beyond the rig take the robot file's actuators, in plant and controller."""
    rest = {joint for joint in robot.joints if joint not in case.after}
    others: dict[str, ActuatorModel] = {}
    if rest:
        known = load_models(robot.actuators) if robot.actuators is not None else {}
        others = {joint: model for joint, model in known.items() if joint in rest}
        missing = sorted(rest - set(others))
        if missing:
            raise ParamsError(
                f"joint {missing[0]!r} of {case.robot.name} is neither in the rig nor in the robot's actuator file"
            )
    files = {side: folder / f"{side}.yaml" for side in SIDES}
    for side, models in zip(SIDES, (case.before, case.after), strict=True):
        shared = case.shared if side == "after" else ()
        ModelFile({**others, **models}, shared=shared, links=case.links).save(files[side])
    both = Scenario(
        robot=str(case.robot.resolve()),
        actuators=str(files["after"]),
        duration=case.motion.finish + TAIL,
        seed=case.seed,
        base_from="imu" if robot.imu else "fixed",
        motion=case.motion.spec,
        guard=GuardSpec(offset_limit=case.offset),
        monitor=UNWATCHED,
        joint_stops="none",
        source=str(folder),
    )
    return {side: replace(both, model=str(path)) for side, path in files.items()}


def chosen_gains(loops: Mapping[str, JointLoop]) -> GainSpec:
    """Per joint the first of `SETTINGS` that keeps the sensitivity peak within `SOUND`, or the soundest."""
    chosen = {}
    for joint, loop in loops.items():
        peaks = [_peak(loop, k6, kp) for k6, kp in SETTINGS]
        first = next((i for i, peak in enumerate(peaks) if peak <= SOUND), int(np.argmin(peaks)))
        chosen[joint] = {"k6": SETTINGS[first][0], "kp": SETTINGS[first][1], "k7": K7}
    return GainSpec(by_joint=chosen)


def _peak(loop: JointLoop, k6: float, kp: float) -> float:
    found = quick_margins(with_values(loop, {"kp": kp, "k6": k6, "k7": K7}))
    return math.inf if found is None else found.sensitivity_peak


def _substeps(loops: Mapping[str, JointLoop], dt: float) -> int:
    """Steps of the plant a tick, so that each servo's stiffness on its joint's inertia is resolved."""
    fastest = max(math.sqrt(1.0 / (loop.k_tau * loop.inertia)) for loop in loops.values())
    return min(MOST_SUBSTEPS, max(1, math.ceil(dt * fastest / RESOLUTION)))


def _joint(at: int, loops: Mapping[str, JointLoop], traces: Mapping[str, Trace]) -> dict[str, Any]:
    """Figures and errors of the joint at this place."""
    nothing = np.zeros(0)
    errors = {side: traces[side].error[:, at] if traces else nothing for side in SIDES}
    return {
        "before": _figures(loops["before"], errors["before"]),
        "after": _figures(loops["after"], errors["after"]),
        "reference": _thinned(_whole(traces, at)) if traces else nothing,
        "error_before": _thinned(errors["before"]),
        "error_after": _thinned(errors["after"]),
    }


def _whole(traces: Mapping[str, Trace], at: int) -> FloatArray:
    """The reference from the trace that knows more of it."""
    rows = [trace.reference[:, at] for trace in traces.values()]
    return max(rows, key=lambda row: int(np.isfinite(row).sum()))


def _thinned(values: FloatArray) -> FloatArray:
    return np.asarray(values[:: max(1, math.ceil(values.size / MOST_POINTS))])


def _figures(loop: JointLoop, error: FloatArray) -> LoopFigures:
    found = quick_margins(loop)
    margins = Margins(*[math.nan] * 6) if found is None else found
    sound = error.size > 0 and bool(np.isfinite(error).all())
    return LoopFigures(
        rms_error=float(np.sqrt(np.mean(error**2))) if sound else math.nan,
        largest_error=float(np.abs(error).max()) if sound else math.nan,
        spectral_radius=loop.spectral_radius(),
        gain_margin=margins.gain_margin,
        phase_margin=margins.phase_margin,
        delay_margin=margins.delay_margin,
        sensitivity_peak=margins.sensitivity_peak,
    )


def _words(scenario: Scenario) -> str:
    return (
        f"Windows of {scenario.filters.window} samples at {1.0 / scenario.dt:g} Hz; sensors: {scenario.sensors};"
        " friction compensated with the estimated velocity"
    )
