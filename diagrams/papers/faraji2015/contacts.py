"""Faraji et al. (2015), the whole loop on other contacts.

On one foot, and on both feet and a hand, pushed for ten seconds.
"""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.analysis.sweep import processes, sweep
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.motions import BaseErrors, base_errors
from drake_tc.estimation.base_kinematics import CONTACT_FLAGS
from drake_tc.loops.scenarios import PushSpec
from drake_tc.loops.whole_body.running import TsidRecording, contact_wrenches, simulate_tsid, task_errors
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid.law import Status
from drake_tc.types import FloatArray, TextTable

SCENARIOS = Path(__file__).parents[2] / "coman.scenario.yaml"
FACTORS = (1.0, 1.5, 2.0, 3.0)
"""On the scenario's pushes; 1 is evaluated, the others show how much larger they may be."""
WORKERS = 2
EVERY = 5
"""One sample in so many is looked at."""
NOTES = (
    "Simulated: the robot of models/coman_like on soft soles of 3e5 N/m; series-elastic joints under voltage, 15 ms of"
    " loop delay, noisy sensors with biases. Drives, sensors and robot are models with chosen numbers.",
    "Pushes at the chest, sin^2 over 0.1 s, 1.5 s apart: forwards, backwards, to the left, to the right, down, and a"
    " torque about the vertical. Forces, heights and the centre of mass are the plant's true ones.",
    "Base errors: both estimators in the same run, the one with ours in the loop. Ours is told that the floor is level,"
    " the soles' stiffness and outline, and how late the IMU is; the chain is told none of it and uses no IMU.",
)


@dataclass(frozen=True)
class Case:
    """A reproduction.

    Attributes:
        id: Of it.
        scenario: Of diagrams/coman.scenario.yaml.
        since: From here on the contacts are as they are to be [s].
        watched: Contact that is lifted, or that leans.
        lifted: Which of both.
    """

    id: str
    scenario: str
    since: float
    watched: str
    lifted: bool


ONE_FOOT = Case("C.one_foot", "one_foot", 2.5, "right_sole", lifted=True)
THREE_CONTACTS = Case("C.three_contacts", "three_contacts", 0.4, "left_palm", lifted=False)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run came to, from `Case.since` on.

    Attributes:
        time: (S,) [s].
        com: (S,) distance of the centre of mass from where it is desired [m].
        load: (S,) normal force at the watched contact [N]. least: That of the feet that stand, at worst [N].
        height: Of the watched contact's frame, the least [m].
        moved: Farthest that it got from where it was first [m].
        tilt: Largest angle between the sole of a foot that stands and the floor [rad].
        share: Largest torque over its joint's limit [-].
        fallbacks, slips: Ticks in which the controller found no answer; the estimator saw a contact slip.
        fell: When [s]; None: it stands.
        errors: Of the base by ours and by the chain from the foot's centre, where that was run beside.
    """

    time: FloatArray
    com: FloatArray
    load: FloatArray
    least: float
    height: float
    moved: float
    tilt: float
    share: float
    fallbacks: int
    slips: int
    fell: float | None
    errors: tuple[BaseErrors, BaseErrors] | None


def harder(scenario: TsidScenario, factor: float) -> TsidScenario:
    """Its pushes times a factor."""

    def times(push: PushSpec) -> PushSpec:
        force, torque = (tuple(factor * x for x in values) for values in (push.force, push.torque))
        return replace(push, force=force, torque=torque)

    return scenario.changed(pushes=tuple(times(push) for push in scenario.pushes))


def outcome(case: Case, run: TsidRecording) -> Outcome:
    """Figures of a run."""
    model, watched = run.law.model, [contact.name for contact in run.law.model.contacts].index(case.watched)
    late, scratch = run.time[::EVERY] >= case.since, model.create_scratch()
    time, states = run.time[::EVERY][late], run["state"][::EVERY][late]
    normals = _normals(run)[late]
    places, tilts = [], [0.0]
    soles = [contact.name for contact in model.contacts if contact.kind == "surface"]
    standing = [name for name in soles if not (case.lifted and name == case.watched)]
    for state in states:
        terms = model.terms(scratch, state[: model.nq], state[model.nq :])
        places.append(terms.pose(case.watched)[1])
        tilts += [float(np.arccos(min(terms.pose(name)[0][2, 2], 1.0))) for name in standing]
    found = np.array(places)
    feet = [number for number, contact in enumerate(model.contacts) if contact.name in standing]
    beside = "beside_state" in run.signals
    return Outcome(
        time,
        np.linalg.norm(task_errors(run, EVERY)["com"], axis=1)[late],
        normals[:, watched],
        float(normals[:, feet].min()),
        float(found[:, 2].min()),
        float(np.linalg.norm(found - found[0], axis=1).max()),
        max(tilts),
        float((np.abs(run["applied_torque"]) / joint_limits(model.robot).effort).max()),
        int((run.status(Status.FALLBACK) > 0.0).sum()),
        _slips(run),
        run.fell,
        (base_errors(run, "estimated_state"), base_errors(run, "beside_state")) if beside else None,
    )


def _normals(run: TsidRecording) -> FloatArray:
    """(S, contacts) true normal forces [N]."""
    ends = np.cumsum([0, *(contact.size for contact in run.law.model.contacts)])[:-1]
    normals: FloatArray = contact_wrenches(run, EVERY)[:, ends + 2]
    return normals


def _slips(run: TsidRecording) -> int:
    """Ticks in which the estimator saw any contact slip; flags of contacts come last in its status."""
    k, size = len(run.law.model.contacts), len(CONTACT_FLAGS)
    flags = run["estimator_status"][:, -k * size :].reshape(-1, k, size)
    return int((flags[:, :, CONTACT_FLAGS.index("slip")] > 0.0).any(axis=1).sum())


def trial(point: tuple[Case, float, int], seed: int) -> Outcome:
    """A case under pushes times a factor, with the noise of one seed for all; for `sweep`."""
    case, factor, noise = point
    beside = "{estimator: {beside: foot_centre}}" if factor == FACTORS[0] else None
    scenario = TsidScenario.load(SCENARIOS, case.scenario, beside).changed(seed=noise)
    return outcome(case, simulate_tsid(harder(scenario, factor)))


def contacts(case: Case, seed: int, progress: Progress | None, executor: Executor | None = None) -> Reproduction:
    """A case under its pushes, and under larger ones; through any Executor, else two processes."""
    if executor is None:
        with processes(WORKERS) as pool:
            return contacts(case, seed, progress, pool)
    points = [(case, factor, seed) for factor in FACTORS]
    found: list[Outcome] = sweep(trial, points, executor=executor, chunk=1, seed=seed, progress=progress)
    return reproduction(case, dict(zip(FACTORS, found, strict=True)))


def reproduction(case: Case, found: Mapping[float, Outcome]) -> Reproduction:
    """Rows of the first outcome, a table of all."""
    run = found[FACTORS[0]]
    values = {
        "fell": float(run.fell is not None),
        "time on these contacts [s]": float(run.time[-1] - run.time[0]) if run.time.size else 0.0,
        "centre of mass, largest error [m]": float(run.com.max()),
        "centre of mass, error at the end [m]": float(run.com[-1]),
        "foot that stands, least normal force [N]": run.least,
        "ticks without an answer": float(run.fallbacks),
        "largest share of a torque limit": run.share,
    }
    if case.lifted:
        values |= {
            "lifted foot, least height [m]": run.height,
            "lifted foot, largest force [N]": float(np.abs(run.load).max()),
        }
    else:
        values |= {"hand, least normal force [N]": float(run.load.min()), "hand, moved by [m]": run.moved}
    values |= {
        "foot that stands, largest tilt [rad]": run.tilt,
        "ticks with a slip seen by the estimator": float(run.slips),
        "largest factor on the pushes that is survived": _survived(found),
    }
    if run.errors is not None:
        ours, theirs = run.errors
        values |= {
            "base position RMSE [m]": ours.position,
            "base velocity RMSE [m/s]": ours.velocity,
            "base yaw RMSE [rad]": ours.yaw,
            "base position error, ours over foot centre": ours.position / theirs.position,
            "base velocity error, ours over foot centre": ours.velocity / theirs.velocity,
            "base yaw error, ours over foot centre": ours.yaw / theirs.yaw,
        }
    file = case.id.lower().replace(".", "_")
    figures = {file: _drawing(case, found)}
    return Reproduction(case.id, evaluated(values, expectations(file)), (_table(case, found),), NOTES, figures)


def _survived(found: Mapping[float, Outcome]) -> float:
    """The largest factor up to which all runs stand; 0: none does."""
    least = min((factor for factor, run in found.items() if run.fell is not None), default=np.inf)
    return max((factor for factor in found if factor < least), default=0.0)


def _table(case: Case, found: Mapping[float, Outcome]) -> TextTable:
    """One row a factor."""
    pushes = TsidScenario.load(SCENARIOS, case.scenario).pushes
    lines = []
    for factor, run in found.items():
        last = [push for push in pushes if run.fell is not None and push.begin < run.fell]
        after = _named(last[-1]) if last else "-"
        impulses = " ".join(f"{factor * _impulse(push):.3g}" for push in pushes)
        state = "stands" if run.fell is None else f"falls at {run.fell:.1f} s"
        last_column = f"{run.tilt:.2f}" if case.lifted else f"{run.load.min():.1f}"
        lines.append((f"{factor:g}", impulses, state, after, f"{1e3 * run.com.max():.0f}", last_column))
    heading = "largest tilt of the foot [rad]" if case.lifted else "least force at the hand [N]"
    return TextTable(
        "how large the pushes may be",
        ("factor", "impulses [N s; N m s]", "what it does", "after the push", "centre of mass off by [mm]", heading),
        tuple(lines),
    )


def _impulse(push: PushSpec) -> float:
    """[N s], of a push without force [N m s]."""
    force = float(np.linalg.norm(push.force))
    impulse: float = 0.5 * push.duration * (force or float(np.linalg.norm(push.torque)))
    return impulse


def _named(push: PushSpec) -> str:
    x, y, z = push.force
    named = {"forwards": x, "backwards": -x, "left": y, "right": -y, "down": -z}
    return max(named, key=lambda name: named[name]) if any(push.force) else "turn"


def _drawing(case: Case, found: Mapping[float, Outcome]) -> Any:
    """Draws the centre of mass's error by factor, and a hand's load."""

    def draw(figure: Any) -> None:
        axes = np.atleast_1d(figure.subplots(1 if case.lifted else 2, 1, sharex=True))
        for factor, run in found.items():
            axes[0].plot(run.time, 1e3 * run.com, label=f"pushes times {factor:g}")
            if not case.lifted:
                axes[1].plot(run.time, run.load)
                axes[1].set_ylabel(f"normal force at {case.watched} [N]")
        axes[0].set_ylim(0.0, 100.0)
        axes[0].set_ylabel("centre of mass off by [mm]")
        axes[0].legend()
        axes[-1].set_xlabel("time [s]")

    return draw


def one_foot(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.one_foot: over the left foot, the right one lifted and held up, under pushes."""
    return contacts(ONE_FOOT, seed, progress)


def three_contacts(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.three_contacts: both feet on the floor and a hand against a wall, under pushes."""
    return contacts(THREE_CONTACTS, seed, progress)
