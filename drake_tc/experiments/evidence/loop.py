"""The loop closed on simulated joints: first logs that leave two effects open, a designed experiment.

For each pair of effects and each of the two as the truth, a joint is drawn and simulated by the independent simulator
with short, slow first runs. A diagnosis of these is followed by one more run of 30 s within the same limits: the
designed motion, or a growing sinusoid. That run is fitted and a first run is held out: fitted together, the first runs
would be asked to predict what only the new one shows. Both are evaluated by the same rule: the true effect is named,
the other one is not, and the report does not list the two as indistinguishable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.benchmarks.blind.joints import draw_joint
from drake_tc.benchmarks.blind.reference import LOG_PERIOD
from drake_tc.benchmarks.blind.spec import Drive, RigSpec, Sensors
from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.effects.library import effect
from drake_tc.errors import DrakeTcError
from drake_tc.experiments.causes import cause_of, cause_values
from drake_tc.experiments.design.goal import Goal
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.run import DEFAULT_HZ, DesignOptions, design_joint
from drake_tc.experiments.rehearsal.twin import SimulatedJoint
from drake_tc.experiments.rehearsal.twin_runs import TwinRun, integrated, on_clock
from drake_tc.experiments.sizes import sizes_found
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig
from drake_tc.report.figure_row import FigureRow
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
JOINT = "joint"
LIMITS = JointLimits((-0.8, 0.8), 3.0, 25.0, torque=150.0, bandwidth_hz=4.0)
FIRST_SECONDS, LAST_SECONDS = 12.0, 30.0


@dataclass(frozen=True)
class Pair:
    """Two effects with sizes at which each matters as much as the other, and the drive of the joint."""

    first: tuple[str, float]
    second: tuple[str, float]
    drive: Drive = "position_servo"


PAIRS: tuple[Pair, ...] = (
    Pair(("delay", 4e-3), ("current_lag", 4e-3), "voltage"),
    Pair(("torque_sensor_bias", 0.8), ("asymmetric_friction", 0.8)),
    Pair(("elasticity", 6e-5), ("torque_sensor_gain", 0.2)),
    Pair(("load_dependent_friction", 0.12), ("stribeck", 1.5)),
    Pair(("quadratic_viscous", 2.5), ("thermal_friction", 0.02), "voltage"),
    Pair(("cable_spring", 3.0), ("payload", 1.5)),
)
"""Pairs that the first logs often do not tell apart."""


@dataclass(frozen=True)
class LoopCase:
    """How one case came out.

    Attributes:
        truth, other: The effects. seed: Of the case.
        first: Whether the first logs alone tell them apart. designed, default: with one more run.
        refusal: Why the case could not be run; empty where it could.
    """

    truth: str
    other: str
    seed: int
    first: bool
    designed: bool
    default: bool
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class _Open:
    """A case on its way: the joint, its first runs and what they told."""

    truth: str
    other: str
    seed: int
    simulated: SimulatedJoint
    spec: RigSpec
    rig: Rig
    first: tuple[Run, ...] = ()
    told: bool = False
    later: tuple[TwinRun, ...] = ()
    refusal: str = ""


def run_cases(pairs: Sequence[Pair], seed: int, progress: Progress = lambda text, share: None) -> list[LoopCase]:
    """Every pair with each of its effects as the truth; simulations run together, in one time loop each.

    Args:
        pairs: Of effects.
        seed: Of the joints, the first motions and the noise.
        progress: Told how far it is.

    Raises:
        SimulationError: A joint ran away.
    """
    cases = [_drawn(pair, swapped, seed) for pair in pairs for swapped in (False, True)]
    runs = [_first_runs(np.random.default_rng([seed, 3, i])) for i in range(len(cases))]
    records = integrated([c.spec for c in cases for _ in range(3)], [run for each in runs for run in each])
    for i, case in enumerate(cases):
        made = [
            case.simulated.measured(records[3 * i + k], runs[i][k], np.random.default_rng([seed, i, k, 5]))
            for k in range(3)
        ]
        cases[i] = _designed(replace(case, first=tuple(made)))
        progress(f"designed {case.truth} against {case.other}", 0.6 * (i + 1) / len(cases))
    ready = [case for case in cases if not case.refusal]
    later = [run for c in ready for run in c.later]
    records = integrated([c.spec for c in ready for _ in c.later], later) if later else []
    out = [LoopCase(c.truth, c.other, c.seed, False, False, False, c.refusal) for c in cases if c.refusal]
    for i, case in enumerate(ready):
        answers = []
        for k, run in enumerate(case.later):
            more = case.simulated.measured(records[2 * i + k], run, np.random.default_rng([seed, i, k, 6]))
            answers.append(_told(case.rig, [more], case.first[-1:], case.truth, case.other)[0])
        out.append(LoopCase(case.truth, case.other, seed, case.told, answers[0], answers[1]))
        progress(f"answered {case.truth} against {case.other}", 0.6 + 0.4 * (i + 1) / len(ready))
    return out


def _drawn(pair: Pair, swapped: bool, seed: int) -> _Open:
    (truth, size), (other, _) = (pair.second, pair.first) if swapped else (pair.first, pair.second)
    rng = np.random.default_rng([seed, *truth.encode()])
    spec = _spec(pair.drive, rng)
    simulated = SimulatedJoint(JOINT, spec, recorded=frozenset({"temperature"}))
    causes = {cause_of(truth).name: cause_values(truth, size, spec.joint, None, rng)}
    rig = parse_rig({"joint": JOINT, "drive": pair.drive, "declared": {"rotor_inertia": spec.joint.rotor_inertia}})
    return _Open(truth, other, seed, simulated, simulated.with_causes(causes, seed), rig)


def _designed(case: _Open) -> _Open:
    """What the first runs tell, and the two further runs: the designed motion and the growing sinusoid."""
    train = case.first[:-1]
    told, sizes = _told(case.rig, train, case.first[-1:], case.truth, case.other)
    try:
        joint, _, prepared = joint_from_logs(case.rig, train, JOINT)
        wide = replace(joint.context, position_span=LIMITS.position, max_speed=LIMITS.velocity)
        goal = Goal("tell", (case.truth, case.other), sizes)
        options = DesignOptions(duration=LAST_SECONDS, seed=case.seed)
        design = design_joint(replace(joint, context=wide), LIMITS, goal, options, prepared)
    except DrakeTcError as error:
        return replace(case, told=told, refusal=str(error))
    proof = next((proof for truth, _, proof in design.contained if effect(truth).id == case.truth), "")
    if proof:
        return replace(case, told=told, refusal=f"{case.other} contains {case.truth}: {proof}")
    time, motion = design.motion(1.0 / LOG_PERIOD)
    later = (_run("designed", time, motion[0]), _run("default", time, _default(time)))
    return replace(case, told=told, later=later)


def _spec(drive: Drive, rng: np.random.Generator) -> RigSpec:
    joint = draw_joint(rng, drive, soft=True)
    return RigSpec("loop", "single", "loop", "", joint, 0, sensors=Sensors(torque_noise=0.25))


def _first_runs(rng: np.random.Generator) -> list[TwinRun]:
    """Two slow runs over half of the range, and one that is held out."""
    time = _clock(FIRST_SECONDS)
    limits = MotionLimits((-0.45, 0.45), 0.8, 2.5)
    out = []
    for name in ("first", "second", "held_out"):
        frequency = float(rng.uniform(0.2, 0.3))
        motion = growing_sinusoid(time, frequency, 0.1, 0.3 / FIRST_SECONDS, limits)
        out.append(_run(name, time, motion.position))
    return out


def _default(time: FloatArray) -> FloatArray:
    """The growing sinusoid of the same length and limits."""
    limits = MotionLimits(LIMITS.position, LIMITS.velocity, LIMITS.acceleration)
    grid: FloatArray = np.asarray(time - time[0], dtype=np.float64)
    half = LIMITS.position[1]
    return growing_sinusoid(grid, DEFAULT_HZ, 0.05 * half, 0.95 * half / float(grid[-1]), limits).position


def _run(name: str, time: FloatArray, reference: FloatArray) -> TwinRun:
    return TwinRun(name, on_clock(time, reference, np.zeros_like(reference)), time)


def _clock(seconds: float) -> FloatArray:
    return np.asarray(np.arange(round(seconds / LOG_PERIOD) + 1) * LOG_PERIOD, dtype=np.float64)


def _told(rig: Rig, train: Sequence[Run], held: Sequence[Run], truth: str, other: str) -> tuple[bool, dict[str, float]]:
    """Whether a diagnosis names the true effect, not the other one, and does not call the two indistinguishable.

    Also the sizes of those of the two that it names, from which a design starts.
    """
    try:
        found = diagnose_joint(train, held, rig, JOINT, DiagnosisOptions(assess_residual=False))
    except DrakeTcError:
        return False, {}
    named = {e.id for e in found.effects}
    tied = any({truth, other} == set(pair) for pair in found.indistinguishable)
    parameters = {e.id: {name: each.value for name, each in e.parameters.items()} for e in found.effects}
    sizes = {key: value for key, value in sizes_found(parameters).items() if key in (truth, other)}
    return truth in named and other not in named and not tied, sizes


def decided_rows(cases: Sequence[LoopCase]) -> list[FigureRow]:
    """Of the cases that the first logs did not decide: shares decided by the designed run and by the default one."""
    open_cases = [c for c in cases if not c.first and not c.refusal]
    return [
        FigureRow("cases", len(cases), "-"),
        FigureRow("open after the first logs", len(open_cases), "-"),
        FigureRow.share("designed", [c.designed for c in open_cases], "min", 0.9),
        FigureRow.share("growing sinusoid", [c.default for c in open_cases], "max", 0.5),
    ]
