"""Beyond Del Prete et al. (2016), its open problems.

The estimates' delay predicted away, a disturbance observer, a floating base.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.control.guard import GuardMode
from drake_tc.diagrams.papers.delprete2016.motion_tables import COMPLETE
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.estimation.disturbance_observer import ObserverSpec
from drake_tc.loops.scenarios import ModelFactors
from drake_tc.loops.torque.running import TorqueRecording, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import BoolArray, FloatArray, TextTable, text_rows

SOFT, STIFF = 0.1, 1.0
"""K6 of the paper's softest and stiffest column."""
FROM: Mapping[str, float] = {"stairs_swing": 0.75, "brisk_swing": 0.25, "suspended_swing": 0.75}
"""Motion to when its errors begin to count [s]: just before the swing."""
WRONG = (0.8, 1.2)
"""Factors on K_tau and on K_v of the controller's model."""
LATE = 0.005
"""Error of the delay [s]."""
ROTORS = (0.5, 2.0)
"""Factors on the rotor inertia that the observer reckons with."""
TOUCHING = 0.65
"""The force error counts from here on, when its reference has risen [s]."""
SETTLED = 0.3
"""The flags of sensors that are late count from here on [s]: at the start they have no reading."""
NOTES = (
    "Simulated, as A.table2: the same leg, swing, gains (Kp = 2, K7 = 0.01) and linear model of the asymmetric fit;"
    " `with` has predictor and observer (scenario predicted_swing), `without` neither. Ratios are servo over torque"
    " control, of squared errors; gains without over with, of RMS errors.",
    "The linear model has no rotor inertia. The observer needs it within a factor of two and takes it from the motors'"
    " data sheets, here the simulated drives' own; the variants `rotors` show what an error of that size costs.",
    "Wrong delay: the observer has the filtered, delayed torque estimate and reckons with one that is 5 ms older or"
    " younger than it is. Late sensors: encoders"
    " (the position in command = q + y included), IMU and F/T sensors all 5 ms later than the controller knows.",
    "Suspended: the waist hangs in springs and swings by 0.3 rad. `taken as fixed` is the same controller without the"
    " IMU, its base assumed to stand still. The torque error is that of the loop's estimate, its delay taken out, and"
    " relative to the torque's range, as in A.torque_estimate: the swinging waist makes that several times larger.",
)


@dataclass(frozen=True)
class Run:
    """What one simulation comes to.

    Attributes:
        joints: Names.
        rms: (n,) tracking error [rad]; NaN where the joints ran away.
        torque: (n,) RMS error of the estimated torque [N m], its delay taken out; zeros where no truth was recorded.
        width: (n,) range of the true torque [N m], likewise.
        alarms: Ticks with a flag up or the guard out of its normal mode.
    """

    joints: tuple[str, ...]
    rms: FloatArray
    torque: FloatArray
    width: FloatArray
    alarms: int


def run(scenario: Scenario, motion: str, begin: float = 0.0) -> Run:
    """Simulate.

    Args:
        scenario: What.
        motion: Key of `FROM`.
        begin: Flags count from here on [s]; the guard's mode from when errors do.
    """
    recording = simulate_scenario(scenario, allow_runaway=True)
    late = recording.time >= FROM[motion]
    error = np.sqrt(np.mean(recording.tracking_error[late] ** 2, axis=0)) if late.any() else np.full(1, np.nan)
    if recording.time[-1] < scenario.duration - scenario.dt:
        error = np.full(recording.size, np.nan)
    flags = recording.signals.get("flags", np.zeros((recording.time.size, 1)))[recording.time >= begin]
    off = recording["mode"][late, 0] != GuardMode.NORMAL
    alarms = int((flags > 0.0).any(axis=1).sum() + off.sum())
    return Run(recording.robot.joints, error, *_torque_error(recording, scenario, late), alarms)


def _torque_error(recording: TorqueRecording, scenario: Scenario, late: BoolArray) -> tuple[FloatArray, FloatArray]:
    """(RMS error of the estimated torque, range of the true one) [N m]."""
    if "estimated_torque" not in recording.signals or "joint_torque" not in recording.signals:
        return np.zeros(recording.size), np.zeros(recording.size)
    ticks = round(0.5 * (scenario.filters.window - 1)) + 1
    error = recording["estimated_torque"][ticks:] - recording["joint_torque"][:-ticks]
    root = np.sqrt(np.mean(error[late[:-ticks]] ** 2, axis=0))
    return np.asarray(root), np.asarray(np.ptp(recording["joint_torque"][late], axis=0))


def plain(scenario: Scenario) -> Scenario:
    """Without predictor and observer."""
    return replace(scenario, predictor=None, observer=None)


def stiff(scenario: Scenario, k6: float) -> Scenario:
    """With another K6."""
    return replace(scenario, gains=replace(scenario.gains, k6=k6))


def scenarios(seed: int) -> Iterator[tuple[str, str, Scenario]]:
    """(name, motion, scenario) of every run."""
    entry = diagram_entry("hrp2_leg")
    swing = entry.scenario("predicted_swing").changed(seed=seed)
    brisk = entry.scenario("brisk_swing").changed(seed=seed)
    brisk = replace(brisk, predictor=swing.predictor, observer=swing.observer, rotor_inertia=swing.rotor_inertia)
    for name, motion, scenario in (
        ("", "stairs_swing", swing),
        (f"seed {seed + 1}, ", "stairs_swing", swing.changed(seed=seed + 1)),
        (f"seed {seed + 2}, ", "stairs_swing", swing.changed(seed=seed + 2)),
        ("brisk swing, ", "brisk_swing", brisk),
    ):
        yield f"{name}servo", motion, plain(replace(scenario, controller="servo"))
        for k6 in (SOFT, STIFF):
            yield f"{name}without, K6 = {k6:g}", motion, stiff(plain(scenario), k6)
            yield f"{name}with, K6 = {k6:g}", motion, stiff(scenario, k6)
    soft = stiff(swing, SOFT)
    yield "predictor alone", "stairs_swing", replace(soft, observer=None)
    yield "observer alone", "stairs_swing", replace(soft, predictor=None)
    yield "complete model", "stairs_swing", replace(soft, model=COMPLETE, rotor_inertia={})
    for name, changed in variants(soft):
        yield name, "stairs_swing", changed
    for factor in WRONG:
        both = ModelFactors(factor, factor)
        yield f"K_tau and K_v x {factor:g}, K6 = 1", "stairs_swing", replace(stiff(swing, STIFF), model_factors=both)
    yield from suspended(seed)


def variants(soft: Scenario) -> Iterator[tuple[str, Scenario]]:
    """(name, scenario) of the controllers and sensors that are not what they are thought to be."""
    for k_tau in WRONG:
        for k_v in WRONG:
            yield f"K_tau x {k_tau:g}, K_v x {k_v:g}", replace(soft, model_factors=ModelFactors(k_tau, k_v))
    yield "filtered torque", replace(soft, observer=ObserverSpec(torque="filtered"))
    own = 0.5 * (soft.filters.window - 1) * soft.dt
    for name, delay in (("older", own + LATE), ("younger", own - LATE)):
        yield f"delay reckoned 5 ms {name}", replace(soft, observer=ObserverSpec(torque="filtered", delay=delay))
    late = {sensor: {"latency": LATE} for sensor in ("encoder", "gyro", "accel", "force", "torque")}
    yield "sensors 5 ms late", replace(soft, sensors={"preset": "realistic", **late})
    for factor in ROTORS:
        rotors = {joint: factor * inertia for joint, inertia in soft.rotor_inertia.items()}
        yield f"rotors x {factor:g}", replace(soft, rotor_inertia=rotors)


def suspended(seed: int) -> Iterator[tuple[str, str, Scenario]]:
    """(name, motion, scenario) of the leg under a swinging waist."""
    entry = diagram_entry("hrp2_leg")
    hung = entry.scenario("suspended_swing").changed(seed=seed, log_truth=True)
    yield "suspended, servo", "suspended_swing", entry.scenario("suspended_swing_servo").changed(seed=seed)
    for k6 in (SOFT, STIFF):
        yield f"suspended, K6 = {k6:g}", "suspended_swing", stiff(hung, k6)
    blind = replace(stiff(hung, SOFT), base_from="fixed", angular_acceleration="zero")
    yield "suspended, taken as fixed", "suspended_swing", blind
    standing = entry.scenario("predicted_swing").changed(seed=seed, log_truth=True)
    yield "standing, K6 = 0.1", "stairs_swing", stiff(standing, SOFT)


def touched(seed: int) -> dict[str, float]:
    """(with, without) to the RMS error of the vertical force [N], the foot on a rigid object."""
    swing = diagram_entry("hrp2_leg").scenario("predicted_swing")
    force = stiff(diagram_entry("hrp2_leg_contact").scenario("brisk_force_sine").changed(seed=seed), SOFT)
    both = replace(force, predictor=swing.predictor, observer=swing.observer, rotor_inertia=swing.rotor_inertia)
    errors = {}
    for name, scenario in (("with", both), ("without", force)):
        recording = simulate_scenario(scenario, allow_runaway=True)
        error = (recording["force_reference"] - recording["contact_wrench"])[recording.time >= TOUCHING, 2]
        errors[name] = float(np.sqrt(np.mean(error**2)))
    return errors


def beyond(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """A.beyond, in simulation."""
    listed = list(scenarios(seed))
    runs: dict[str, Run] = {}
    for number, (name, motion, scenario) in enumerate(listed):
        if progress:
            progress(name, number / len(listed))
        runs[name] = run(scenario, motion, SETTLED if name == "sensors 5 ms late" else 0.0)
    values = figures(runs, seed, [name for name, _ in variants(stiff(listed[0][2], SOFT))])
    force = touched(seed)
    values["force error without over with, K6 = 0.1"] = force["without"] / force["with"]
    return Reproduction("A.beyond", evaluated(values, expectations("a_beyond")), _tables(runs), NOTES)


def figures(runs: Mapping[str, Run], seed: int, wrong: list[str]) -> dict[str, float]:
    """Name to value of every row."""
    joints, servo = runs["servo"].joints, runs["servo"].rms
    ratio = (servo / runs["with, K6 = 0.1"].rms) ** 2
    gain = runs["without, K6 = 1"].rms / runs["with, K6 = 1"].rms
    values = {f"squared error ratio, K6 = 0.1, {joint}": float(x) for joint, x in zip(joints, ratio, strict=True)}
    values |= {f"without over with, K6 = 1, {joint}": float(x) for joint, x in zip(joints, gain, strict=True)}
    for where, number in ((f"seed {seed + 1}, ", "second seed"), (f"seed {seed + 2}, ", "third seed"), *_BRISK):
        own = (runs[f"{where}servo"].rms / runs[f"{where}with, K6 = 0.1"].rms) ** 2
        better = runs[f"{where}without, K6 = 1"].rms / runs[f"{where}with, K6 = 1"].rms
        values[f"worst ratio, K6 = 0.1, {number}"] = float(own.min())
        values[f"worst gain, K6 = 1, {number}"] = float(better.min())
    for name in [*wrong, "complete model"]:
        values[f"worst ratio, K6 = 0.1, {name}"] = float(((servo / runs[name].rms) ** 2).min())
    for factor in WRONG:
        name = f"K_tau and K_v x {factor:g}, K6 = 1"
        values[f"worst gain, {name}"] = float((runs["without, K6 = 1"].rms / runs[name].rms).min())
    hung = runs["suspended, servo"].rms
    for k6 in (SOFT, STIFF):
        worst = ((hung / runs[f"suspended, K6 = {k6:g}"].rms) ** 2).min()
        values[f"suspended, worst ratio, K6 = {k6:g}"] = float(worst)
    soft, blind = runs["suspended, K6 = 0.1"], runs["suspended, taken as fixed"]
    standing = runs["standing, K6 = 0.1"]
    share = (soft.torque / soft.width) / (standing.torque / standing.width)
    values["suspended, torque error of its range over that of the fixed base, worst joint"] = float(share.max())
    values["suspended, torque error over that of the fixed base, worst joint"] = float(
        (soft.torque / standing.torque).max()
    )
    values["suspended, tracking error taken as fixed over floating, geometric mean"] = float(
        np.exp(np.mean(np.log(blind.rms / soft.rms)))
    )
    values["suspended, torque error taken as fixed over floating, geometric mean"] = float(
        np.exp(np.mean(np.log(blind.torque / soft.torque)))
    )
    values["ticks with a flag or with the guard out of its normal mode"] = float(sum(r.alarms for r in runs.values()))
    return values


_BRISK = (("brisk swing, ", "brisk swing"),)


def _tables(runs: Mapping[str, Run]) -> tuple[TextTable, ...]:
    joints = runs["servo"].joints
    chosen = [name for name in runs if not name.startswith(("seed", "brisk", "suspended", "standing"))]
    rows = tuple((name, *(f"{1e3 * x:.3f}" for x in runs[name].rms)) for name in chosen)
    swing = TextTable("RMS tracking error of the swing [10^-3 rad]", ("", *joints), rows)
    hung = [name for name in runs if name.startswith("suspended")]
    columns = [1e3 * runs[name].rms for name in hung]
    columns += [
        runs[name].torque for name in ("suspended, K6 = 0.1", "suspended, taken as fixed", "standing, K6 = 0.1")
    ]
    short = [name.removeprefix("suspended, ") for name in hung]
    headings = ("joint", *(f"{s} [mrad]" for s in short), "torque error [N m]", "taken as fixed", "fixed base")
    table = TextTable("suspended: RMS errors", headings, text_rows(joints, [c.tolist() for c in columns]))
    return swing, table
