"""The whole loop of Faraji et al. (2015) with sensors that fail.

Standing, in the 1 Hz turn, and a contact lost without notice.
"""

import os
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_tc.analysis.sweep import processes, sweep
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.fault_cases import DRIFT, STARTS, FaultCase, cases
from drake_tc.loops.whole_body.running import TsidRecording, simulate_tsid
from drake_tc.loops.whole_body.scenario import SpringDrivesSpec, TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.robot.plant import joint_limits
from drake_tc.sensor_validation.monitor_spec import bias_resolved_after
from drake_tc.tsid.law import Status
from drake_tc.types import FloatArray, TextTable

SCENARIOS = Path(__file__).parents[2] / "coman.scenario.yaml"
FILE = "c_faults"
AFTER = 2.0
"""How long a run goes on after a fault's start [s]."""
FLAGGED_WITHIN = 0.05
"""A fault should be flagged this soon [s]."""
NOTES = (
    "Simulated: models/coman_like as in C.turn1hz; a sensor fails and the run goes on for 2 s. All channels fail where"
    " nothing else is said: all joints' encoders or gauges at once, both F/T sensors.",
    "Off: largest distance of the base, and largest difference of a joint, to the same run without the fault; a motion"
    " that stops where the IMU is lost is off by all that it does not go on.",
    "What stands in: one of the three sensors of a joint by the other two; F/T sensors by their last readings; the IMU"
    " by the feet, whose soles tilt as their load says, and the motion stops.",
    "With both encoders of every joint lost nothing says where the robot is: torques fade from 0.15 s on, it sinks.",
    "What flags: any of the sensor's own, `SENSOR/WHAT` in the signal `flags` of a run.",
)


@dataclass(frozen=True)
class FaultOutcome:
    """What came of a case.

    Attributes:
        fell: When the robot had fallen [s]; None: it stood until the end.
        flagged: From the fault's start to the first flag of its own [s]; infinite without one.
        flag: That flag.
        early: Flags that were up before the fault.
        base, joint: How far the base [m] and a joint [rad] were off the run without the fault.
        desired, torque: Largest commanded torque, and largest joint torque, over its limit [-].
        fallback: Ticks in which the controller had no answer.
        finite: Whether all signals are.
    """

    fell: float | None
    flagged: float
    flag: str
    early: tuple[str, ...]
    base: float
    joint: float
    desired: float
    torque: float
    fallback: int
    finite: bool


def scenario_of(name: str, seed: int) -> TsidScenario:
    """A scenario, for as long as a fault in it is watched."""
    return TsidScenario.load(SCENARIOS, name).changed(seed=seed, duration=STARTS[name] + AFTER)


def run(trial: tuple[FaultCase | str, int], _: int) -> TsidRecording:
    """One case, or a scenario without faults, for `sweep`; with a seed."""
    case, seed = trial
    if isinstance(case, str):
        return simulate_tsid(scenario_of(case, seed))
    return simulate_tsid(scenario_of(case.scenario, seed).changed(faults=case.faults))


def outcome(case: FaultCase, recording: TsidRecording, sound: FloatArray) -> FaultOutcome:
    """What came of a case.

    Args:
        case: Which.
        recording: Of its run.
        sound: (T, nq + nv) states of the run without the fault.
    """
    start, time, model = STARTS[case.scenario], recording.time, recording.law.model
    flags, names = recording["flags"] > 0.0, recording.flag_names
    begins = min(fault.start for faults in case.faults.values() for fault in faults)
    own = [i for i, name in enumerate(names) if name.startswith(case.groups)]
    late = time >= start - 1e-9
    up = np.argwhere(flags[:, own] & late[:, None])
    length = min(len(sound), len(time))
    off = np.abs(recording["state"][:length] - sound[:length])[late[:length]]
    places = slice(4, 7) if model.nq > model.n else slice(0, 0)
    limit = joint_limits(model.robot).effort
    return FaultOutcome(
        recording.fell,
        float(time[up[0, 0]] - start) if up.size else float("inf"),
        names[own[up[0, 1]]] if up.size else "-",
        tuple(names[i] for i in np.flatnonzero(flags[time < begins - 1e-9].any(axis=0))),
        float(np.linalg.norm(off[:, places], axis=1).max()),
        float(off[:, model.positions].max()),
        float((np.abs(recording["torque"][late]) / limit).max()),
        float((np.abs(recording["applied_torque"][late]) / limit).max()),
        int(recording.status(Status.FALLBACK)[late].sum()),
        all(bool(np.isfinite(values).all()) for values in recording.signals.values()),
    )


def watched(trial: tuple[FaultCase, int, FloatArray], _: int) -> FaultOutcome:
    """Run a case against the states of the run without it, for `sweep`."""
    case, seed, sound = trial
    return outcome(case, run((case, seed), 0), sound)


def undisturbed(trial: tuple[str, int], _: int) -> tuple[FloatArray, tuple[str, ...]]:
    """States of a scenario without faults, and the flags that were up all the same, for `sweep`."""
    recording = run(trial, 0)
    up = (recording["flags"] > 0.0).any(axis=0)
    return recording["state"], tuple(recording.flag_names[i] for i in np.flatnonzero(up))


def faults(seed: int = 0, progress: Progress | None = None, executor: Executor | None = None) -> Reproduction:
    """C.faults: what comes of each fault; through any Executor, else all processors here."""
    if executor is None:
        with processes(os.cpu_count() or 1) as pool:
            return faults(seed, progress, pool)
    sound = dict(
        zip(STARTS, sweep(undisturbed, [(name, seed) for name in STARTS], executor=executor, chunk=1), strict=True)
    )
    trials = [(case, seed, sound[case.scenario][0]) for case in cases()]
    found: list[FaultOutcome] = sweep(watched, trials, executor=executor, chunk=1, progress=progress)
    return reproduction(found, {name: flags for name, (_, flags) in sound.items()})


def drift_bound() -> str:
    """A note: how soon any check at all can tell the gyro's drift beside feet that turn."""
    soonest = bias_resolved_after(DRIFT, 1e-3, SpringDrivesSpec().motor_encoder.resolution / np.sqrt(12.0), 1.0)
    return (
        f"Beside feet that turn at 1 Hz, no check can tell a drift of 1 deg/s sooner than after {1e3 * soonest:.0f} ms,"
        " with the encoders' quantisation as the only noise (three deviations of the Cramér-Rao bound,"
        " `drake_tc.sensor_validation.monitor_spec`)."
    )


def reproduction(found: list[FaultOutcome], alarms: Mapping[str, tuple[str, ...]]) -> Reproduction:
    """Rows and table of all cases' outcomes, and of the flags that sound runs had up."""
    pairs = list(zip(cases(), found, strict=True))
    values = {
        "cases that fell": float(sum(one.fell is not None and not case.sinks for case, one in pairs)),
        "cases with anything that is not finite": float(sum(not one.finite for one in found)),
        "flags up in runs without a fault": float(sum(len(flags) for flags in alarms.values())),
        "largest commanded torque, over its limit": round(max(one.desired for one in found), 9),
        "largest torque of a robot that stands, over its limit": max(
            (one.torque for one in found if one.fell is None), default=0.0
        ),
        "largest torque of one that sinks, over its limit": max(one.torque for case, one in pairs if case.sinks),
        "largest distance of the base, standing [m]": max(
            one.base for case, one in pairs if case.scenario == "stand" and not case.sinks
        ),
        "largest distance of the base, turning [m]": max(
            one.base for case, one in pairs if case.scenario == "turn_1hz"
        ),
        f"cases flagged within {1e3 * FLAGGED_WITHIN:.0f} ms": float(
            sum(one.flagged <= FLAGGED_WITHIN for one in found)
        ),
        "cases": float(len(found)),
    }
    for case, one in pairs:
        values[f"{case.label}: fell"] = float(one.fell is not None)
        if np.isfinite(one.flagged):
            values[f"{case.label}: flagged after [s]"] = one.flagged
    rows = tuple(
        (
            case.scenario,
            case.name,
            "stands" if one.fell is None else f"falls at {one.fell:.2f} s",
            f"{1e3 * one.flagged:.0f}" if np.isfinite(one.flagged) else "never",
            one.flag,
            f"{1e3 * one.base:.1f}",
            f"{1e3 * one.joint:.0f}",
            f"{one.desired:.2f}",
            f"{one.torque:.2f}",
        )
        for case, one in pairs
    )
    headings = (
        "scenario",
        "fault",
        "robot",
        "flagged after [ms]",
        "by",
        "base off [mm]",
        "joint off [mrad]",
        "torque asked, of limit",
        "torque, of limit",
    )
    told = [f"without a fault, {name}: {', '.join(flags)}" for name, flags in alarms.items() if flags]
    return Reproduction(
        "C.faults",
        evaluated(values, expectations(FILE)),
        (TextTable("sensors that fail", headings, rows),),
        (*NOTES, drift_bound(), *told),
    )
