"""`bench real-robots`: `close-loop` with fitted links against plain least squares, on runs that took no part.

The cases are those of `bench/rigs`. Each joint's held-out error [N m by the declared drive gain] is given four times:
of plain least squares on the same rows in the same filters (`pooled_least_squares`), pooled over the joints and with
the scaled torques of the robot's file; of the declared model of `close-loop`; and of its model after. Least squares has
a constant of each joint and no prior. The goal is stated against the kind of least squares that the set's README has
(`RobotCase.scaled`); the ratio to the other kind is printed too. The README's own figures are told beside them; they
rest on other filters and other rows.

A ratio's 95 % interval is that of resamples of the held-out half seconds, as a pair of errors on the same rows. The
error of the model after over that of the model before is given too, and beside it what the sensors' noise alone would
leave: a share that is far above the noise floor is left for another reason. `each_run_own` is what the model after
would leave if friction, inertia and constant of each held-out run were known: the difference is that of the runs.
`in_view` is pooled least squares that is fitted to the held-out rows themselves.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.config.quoted import did_you_mean
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import ParamsError
from drake_tc.logs.prepare import in_order, load_runs
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.types import FloatArray, IntArray
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.pooled_least_squares import PlainResiduals, least_squares_residuals
from tests.benchmarks.real_log_cases import CaseFiles, case_files, import_set
from tests.benchmarks.real_logs import chosen_sets

IN_VIEW = "fitted in view of the held-out runs"
KINDS = ("pooled", "scaled")
"""Of least squares."""
GOAL = 0.85
"""Largest error of all joints together, over that of least squares."""
PAYLOAD = 2.805
"""Known mass of the load [kg]."""
PAYLOAD_TOLERANCE = 0.03
RESAMPLES = 1000

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class RobotCase:
    """One case of `bench/rigs`.

    Attributes:
        data_set, case: Which.
        published: Held-out residual of each joint in the set's README [N m], where it has one.
        payload: Run with the known load, where the case has one.
        scaled: Whether the README's least squares scales the torques of the robot's file, joint by joint.
    """

    data_set: str
    case: str
    published: tuple[float, ...] = ()
    payload: str = ""
    scaled: bool = False


CASES = (
    RobotCase("ur10e-calibration", "excitation", (2.87, 3.85, 1.52, 0.52, 0.39, 0.45)),
    RobotCase("ur10e-calibration", "unknown_load", payload="exc_0131_load"),
    RobotCase(
        "so101-sage",
        "six_runs_held_out",
        tuple(e / 0.13 for e in (0.0069, 0.0132, 0.0116, 0.0067, 0.0041)),
        scaled=True,
    ),
    RobotCase("so101-sage", "clear_of_table", scaled=True),
    RobotCase(
        "go2-leg-pd",
        "four_legs",
        (0.113, 0.114, 0.304, 0.129, 0.110, 0.231, 0.114, 0.121, 0.460, 0.123, 0.117, 0.307),
    ),
    *(RobotCase("staubli-tx40", f"fifth_{k}_held_out") for k in range(1, 6)),
    *(RobotCase("dfki-double-pendulum", f"design_{d}/third_{k}") for d in ("a0", "c0") for k in range(1, 4)),
)
"""READMEs: UR10e on `exc_40s_12harm` alone; SO-101 by its drive gain of 0.13 rad/(N m); Go2 with a delay of 10 ms."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One joint on the held-out rows: residuals (N,) [N m] of both kinds of least squares, and of the models.

    `own` is that of the model after with each held-out run's own friction, inertia and constant; `in_view` that of
    pooled least squares which is fitted to these rows. `effort` is the RMS of the rows' effort over the drive gain
    [N m]; `found` names the effects. `block` (N,) numbers the rows' half seconds; `floor` is what the sensors' noise
    alone would leave [N m].
    """

    joint: str
    effort: float
    pooled: FloatArray
    scaled: FloatArray
    before: FloatArray
    after: FloatArray
    own: FloatArray
    in_view: FloatArray
    found: tuple[str, ...]
    block: IntArray
    floor: float


def held_out(files: CaseFiles) -> tuple[CloseLoopResult, list[HeldOut]]:
    """Run `close-loop` and least squares on one case.

    Raises:
        DrakeTcError: Input that `close-loop` refuses.
    """
    result = close_loop(files.rig, files.log, files.holdout, DiagnosisOptions(assess_residual=False))
    rig = load_rig(files.rig)
    runs = load_runs([*files.log, *files.holdout], rig)
    count = len(files.log)
    runs = [*in_order(runs[:count], rig), *in_order(runs[count:], rig)]
    plain = least_squares_residuals(result, rig, runs)
    return result, [_joint(result, rig, joint, plain) for joint in rig.joints]


def _joint(result: CloseLoopResult, rig: Rig, joint: str, plain: PlainResiduals) -> HeldOut:
    found, gain = result.joints[joint], rig.drive_gain[joint]
    samples = found.heldout.samples
    shared = tuple(f"{cause.id} of {cause.where}" for cause in result.shared)
    return HeldOut(
        joint=joint,
        effort=rms(samples.reduce(samples.signals.effort)) / gain,
        pooled=plain.pooled[joint] / gain,
        scaled=plain.scaled[joint] / gain,
        before=found.heldout.before / gain,
        after=found.heldout.after / gain,
        own=plain.own[joint] / gain,
        in_view=plain.in_view[joint] / gain,
        found=(*(effect.id for effect in found.effects), *shared),
        block=samples.block,
        floor=found.noise_floor / gain,
    )


def rms(values: FloatArray) -> float:
    """Root mean square of (N,)."""
    return float(np.sqrt(np.mean(values**2)))


def rows(
    data: Path,
    names: Sequence[str] = (),
    progress: Progress = lambda text, share: None,
    cases: Sequence[RobotCase] = CASES,
) -> list[BenchmarkRow]:
    """The table of these data sets; of all where none is named.

    Raises:
        LogError: A set is not in `data`.
        ParamsError: An unknown set.
    """
    known = sorted({case.data_set for case in cases})
    for name in names:
        if name not in known:
            raise ParamsError(f"no data set {name!r} with a robot{did_you_mean(name, known)}; sets: {', '.join(known)}")
    sets = {entry.name: entry for entry in chosen_sets(known)}
    taken = [case for case in cases if not names or case.data_set in names]
    out = []
    for number, case in enumerate(taken):
        progress(f"{case.data_set}/{case.case}", number / len(taken))
        chosen = sets[case.data_set]
        entry = next(each for each in chosen.cases if each.name == case.case)
        with TemporaryDirectory() as folder:
            scratch = Path(folder)
            logs = import_set(chosen, data, scratch)
            result, joints = held_out(case_files(chosen, entry, logs, scratch))
        out += table_rows(case, joints) + payload_rows(case, result)
    progress("done", 1.0)
    return out


def table_rows(case: RobotCase, joints: Sequence[HeldOut]) -> list[BenchmarkRow]:
    """Nine figures a joint, and four of all joints together."""
    begin, kind = f"{case.data_set}/{case.case}", "scaled" if case.scaled else "pooled"
    published: Mapping[str, float] = dict(zip((j.joint for j in joints), case.published, strict=False))
    out = []
    for each in joints:
        after, told = rms(each.after), ""
        if each.joint in published:
            told = f"; README, {kind}, in its own filter: {published[each.joint]:.3g}"
        name = f"{begin}/{each.joint}"
        out += [
            BenchmarkRow(f"{name}/pooled", rms(each.pooled), "N*m", note=f"effort of {each.effort:.3g} N*m{told}"),
            BenchmarkRow(f"{name}/scaled", rms(each.scaled), "N*m"),
            BenchmarkRow(f"{name}/before", rms(each.before), "N*m"),
            BenchmarkRow(f"{name}/after", after, "N*m", note=f"found: {', '.join(each.found) or 'nothing'}"),
            BenchmarkRow(f"{name}/each_run_own", rms(each.own), "N*m", note=IN_VIEW),
            BenchmarkRow(f"{name}/in_view", rms(each.in_view), "N*m", note=IN_VIEW),
            *(_ratio_row(name, each, side, goal=side == kind) for side in KINDS),
            BenchmarkRow(
                f"{name}/over_before", after / rms(each.before), "-", note=f"noise floor: {_floor_share(each)}"
            ),
        ]
    together = [_together(begin, joints, side, goal=side == kind) for side in KINDS]
    return [*out, *together, _mean(begin, joints, kind), _in_view(begin, joints, kind)]


def _ratio_row(name: str, each: HeldOut, side: str, *, goal: bool) -> BenchmarkRow:
    """Error of the model after over that of one kind of least squares."""
    plain: FloatArray = getattr(each, side)
    low, high = ratio_interval(each.after, plain, each.block)
    note = f"over {side} least squares; 95 % of resamples {low:.3f} to {high:.3f}"
    ratio = rms(each.after) / rms(plain)
    return BenchmarkRow(f"{name}/ratio_{side}", ratio, "-", 1.0 if goal else None, "max", note=note)


def _together(begin: str, joints: Sequence[HeldOut], side: str, *, goal: bool) -> BenchmarkRow:
    """The same of the torque of all joints' rows."""
    note = f"over {side} least squares, of the torque of all rows"
    ratio = _of_all_rows(joints, "after", side)
    return BenchmarkRow(f"{begin}/all_joints/ratio_{side}", ratio, "-", GOAL if goal else None, "max", note=note)


def _in_view(begin: str, joints: Sequence[HeldOut], side: str) -> BenchmarkRow:
    note = f"of pooled least squares {IN_VIEW}, over {side} least squares"
    return BenchmarkRow(f"{begin}/all_joints/in_view", _of_all_rows(joints, "in_view", side), "-", note=note)


def _of_all_rows(joints: Sequence[HeldOut], name: str, over: str) -> float:
    """Ratio of two RMS errors of the torque of all joints' rows."""
    squares = [sum(float(np.sum(getattr(each, side) ** 2)) for each in joints) for side in (name, over)]
    return float(np.sqrt(squares[0] / squares[1]))


def _mean(begin: str, joints: Sequence[HeldOut], side: str) -> BenchmarkRow:
    ratios = [rms(each.after) / rms(getattr(each, side)) for each in joints]
    note = f"geometric mean of the joints' ratios to {side} least squares"
    return BenchmarkRow(f"{begin}/all_joints/mean_ratio", float(np.exp(np.mean(np.log(ratios)))), "-", note=note)


def ratio_interval(after: FloatArray, plain: FloatArray, block: IntArray, seed: int = 0) -> tuple[float, float]:
    """95 % interval of the ratio of two RMS errors (N,) on the same rows, whose blocks (N,) are resampled."""
    number = np.unique(block, return_inverse=True)[1]
    squares = np.stack([np.bincount(number, error**2) for error in (after, plain)])
    draws = np.random.default_rng(seed).integers(0, squares.shape[1], (RESAMPLES, squares.shape[1]))
    sums = squares[:, draws].sum(axis=2)
    low, high = np.quantile(np.sqrt(sums[0] / sums[1]), [0.025, 0.975])
    return float(low), float(high)


def _floor_share(each: HeldOut) -> str:
    return f"{each.floor / rms(each.before):.2f} of the model before"


def payload_rows(case: RobotCase, result: CloseLoopResult) -> list[BenchmarkRow]:
    """The mass of the known load, where the case has one."""
    if not case.payload or result.links is None:
        return []
    mass = result.links.payloads[case.payload]["m"]
    note = f"95 % interval {mass.ci95[0]:.3g} to {mass.ci95[1]:.3g} kg"
    within = PAYLOAD_TOLERANCE * PAYLOAD
    return [BenchmarkRow(f"{case.data_set}/{case.case}/payload", mass.value, "kg", PAYLOAD, "within", within, note)]
