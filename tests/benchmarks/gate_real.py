"""The gate's part on public logs: `close_loop` alone against least squares and the published model, held out.

Every error is the RMS over the rows of the held-out runs that `close_loop` evaluates, in the drive's effort. The models
to compare with are judged on the same rows, through the same filters:

    least squares   y = k tau + J a + F_v v + F_c sign(v) + c, all five from the pooled training rows
    robots          plain least squares of all joints, pooled and scaled (`pooled_least_squares`)
    published       the model that the set's authors published, where `PUBLISHED` or `flexible_fits` has it

A set's ratio is the error after over that of the best of these, each pooled over all cases of the set; of a robot the
geometric mean over its joints.
"""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.estimation.robot_loads import robot_logs
from drake_tc.logs.prepare import in_order, load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.report.data_files import result_json
from drake_tc.types import FloatArray
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.flexible_fits import LINEAR, log_rows
from tests.benchmarks.flexible_fits import PUBLISHED as PUBLISHED_FIT
from tests.benchmarks.pooled_least_squares import least_squares_residuals
from tests.benchmarks.real_bam import PUBLISHED, STS3250, XL330
from tests.benchmarks.real_log_cases import CaseFiles, RealLogCase, RealLogSet, case_files, import_set
from tests.benchmarks.real_log_claims import CaseClaims, claims_of
from tests.benchmarks.real_logs import chosen_sets, run_case
from tests.benchmarks.real_tmotor import DATA_SET as TMOTOR

GOAL, HALF = 0.85, 0.5
"""Ratio that is to be reached on this share of the sets."""
CLAIMS = 0.98
PLAIN = ("viscous", "coulomb", "rotor_inertia")


@dataclass(frozen=True)
class GateSet:
    """The cases of one data set.

    Attributes:
        name: Of the set.
        cases: Beginnings of the names of its cases, each of which holds out other runs.
        rig: Rig file in place of that of the cases: what a user declares who knows no more than the set's README.
        small: Number of cases of the small gate; 0 leaves the set out.
    """

    name: str
    cases: tuple[str, ...]
    rig: str = ""
    small: int = 0


SETS = (
    GateSet(XL330, ("motor/",), "rig_voltage.yaml", small=2),
    GateSet(STS3250, ("motor/",), "rig.yaml", small=1),
    GateSet(
        "dfki-simple-pendulum",
        tuple(f"{run}_alone" for run in ("ddp", "direct_collocation", "energy_shaping", "sac")),
        small=1,
    ),
    GateSet("dfki-double-pendulum", ("design_",)),
    GateSet("go2-leg-pd", ("four_legs",)),
    GateSet("so101-sage", ("six_runs_held_out", "clear_of_table")),
    GateSet("staubli-tx40", ("fifth_",)),
    GateSet("tiago-arm", ("wrist/fifth_",)),
    GateSet(TMOTOR, tuple(f"early/{run}_held_out" for run in ("test_1", "high_speed", "opposing_motor")), small=2),
    GateSet("ur10e-calibration", ("excitation",)),
)
"""The other sets hold no logs that `close_loop` can judge: `uart-servo-backlash` moves for 0.8 s, at 10 Hz."""


@dataclass
class SetErrors:
    """Sums over the held-out rows of a set's cases, by joint and then by model: of squares [effort^2], and of rows.

    `failures` are the cases without a result, with the reason; `found` the effects that were named.
    """

    squares: dict[str, dict[str, float]] = field(default_factory=dict)
    rows: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    found: list[str] = field(default_factory=list)

    def add(self, joint: str, residuals: Mapping[str, FloatArray]) -> None:
        """Residuals (N,) of each model on one case's held-out rows."""
        sums = self.squares.setdefault(joint, {})
        for model, residual in residuals.items():
            sums[model] = sums.get(model, 0.0) + float(np.sum(residual**2))
        self.rows[joint] = self.rows.get(joint, 0) + next(iter(residuals.values())).size

    def ratio(self, model: str, over: str) -> float:
        """Geometric mean over the joints of the ratio of two RMS errors."""
        ratios = [sums[model] / sums[over] for sums in self.squares.values()]
        return float(np.exp(0.5 * np.mean(np.log(ratios)))) if ratios else float("nan")

    def best(self) -> str:
        """The model with the smallest error among those to compare with."""
        models = [m for m in next(iter(self.squares.values())) if m not in ("before", "after")]
        return min(models, key=lambda m: self.ratio(m, models[0]))

    def rms(self, joint: str, model: str) -> float:
        """RMS [effort]."""
        return float(np.sqrt(self.squares[joint][model] / self.rows[joint]))


def real_rows(data: Path, size: str, progress: Callable[[str, float], None]) -> list[BenchmarkRow]:
    """Ratios of each set, the share of sets with a small one, and the share of cases whose claims hold."""
    out: list[BenchmarkRow] = []
    ratios: list[float] = []
    claims: list[CaseClaims] = []
    taken = [each for each in SETS if size == "full" or each.small]
    for number, each in enumerate(taken):
        progress(each.name, number / len(taken))
        if not (data / each.name).is_dir():
            out.append(
                BenchmarkRow(f"{each.name}: after over the best", np.nan, "-", note=f"skipped: not in {data}", n=0)
            )
            continue
        errors, checked = set_errors(data, each, small=size == "small")
        claims += checked
        out += _rows_of(each.name, errors)
        ratios.append(out[-1].value)
    small = [ratio <= GOAL for ratio in ratios]
    out.append(BenchmarkRow.share(f"sets at {GOAL} or less of the best", small, "min", HALF))
    held = [not claim.failures for claim in claims if not claim.refusal]
    return [*out, BenchmarkRow.share("cases whose claims hold", held, "min", CLAIMS)]


def _rows_of(name: str, errors: SetErrors) -> list[BenchmarkRow]:
    """Errors of a single joint, and the ratio; the ratio last."""
    failed = "; ".join(errors.failures)
    if not errors.squares:
        return [BenchmarkRow(f"{name}: after over the best", np.inf, "-", 1.0, "max", note=failed)]
    out = []
    if len(errors.squares) == 1:
        (joint,) = errors.squares
        out = [
            BenchmarkRow(f"{name}: {model}", errors.rms(joint, model), "effort", n=errors.rows[joint])
            for model in errors.squares[joint]
        ]
    best = errors.best()
    ratio = np.inf if failed else errors.ratio("after", best)
    found = ", ".join(dict.fromkeys(errors.found)) or "nothing"
    note = failed or f"best: {best}; named: {found}"
    return [*out, BenchmarkRow(f"{name}: after over the best", ratio, "-", 1.0, "max", note=note)]


def set_errors(data: Path, gate_set: GateSet, *, small: bool) -> tuple[SetErrors, list[CaseClaims]]:
    """Held-out errors of all cases of a set, and what `close_loop` claims of them.

    The small gate checks the claims on all held-out runs together, the full one on each alone too.
    """
    (chosen,) = chosen_sets([gate_set.name])
    cases = [case for case in chosen.cases if case.name.startswith(gate_set.cases)]
    cases = [replace(case, rig=gate_set.rig, rig_in_data=False) if gate_set.rig else case for case in cases]
    errors, claims = SetErrors(), []
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        logs = import_set(chosen, data, scratch)
        for case in cases[: gate_set.small] if small else cases:
            try:
                claims.append(_one_case(chosen, case, logs, scratch, errors, small=small))
            except Exception as error:  # one case must not end the gate
                errors.failures.append(f"{case.name}: {type(error).__name__}: {error}")
    return errors, claims


def _one_case(
    chosen: RealLogSet,
    case: RealLogCase,
    logs: Path,
    scratch: Path,
    errors: SetErrors,
    *,
    small: bool,
) -> CaseClaims:
    files = case_files(chosen, case, logs, scratch)
    result = close_loop(files.rig, files.log, files.holdout, DiagnosisOptions(assess_residual=False))
    for joint, residuals in held_out_residuals(files, result, PUBLISHED.get(chosen.name)).items():
        if chosen.name == TMOTOR:
            residuals["published"] = _published_fit(result.joints[joint])
        errors.add(joint, residuals)
    errors.found += [e.id for joint in result.joints.values() for e in joint.effects] + [c.id for c in result.shared]
    if small:
        report = result_json(result)
        return claims_of(f"{chosen.name}/{case.name}", report, {"all held-out runs": report})
    return run_case(chosen, case, logs, scratch)


def held_out_residuals(
    files: CaseFiles, result: CloseLoopResult, published: ActuatorModel | None = None
) -> dict[str, dict[str, FloatArray]]:
    """By joint and model, the residual (N,) [effort] of the held-out rows.

    Args:
        files: That `close_loop` was given. result: Of it.
        published: Model of the rig's only joint.
    """
    out = {}
    for joint, found in result.joints.items():
        held = found.heldout
        out[joint] = {"before": held.before / held.weight, "after": held.after / held.weight}
        if not found.links_fitted:
            out[joint]["least squares"] = least_squares(found.train, held)
        if published is not None:
            out[joint]["published"] = model_residual(published, held)
    rig = load_rig(files.rig)
    runs = load_runs([*files.log, *files.holdout], rig)
    logs = robot_logs(rig, runs)
    if logs is not None and logs.links is not None:
        count = len(files.log)
        plain = least_squares_residuals(result, rig, [*in_order(runs[:count], rig), *in_order(runs[count:], rig)])
        for joint in out:
            out[joint].pop("least squares", None)
            out[joint] |= {"pooled least squares": plain.pooled[joint], "scaled least squares": plain.scaled[joint]}
    return out


def least_squares(train: DataSplit, held: DataSplit) -> FloatArray:
    """Residual (N,) [effort] of the held-out rows: gain, inertia, viscous and Coulomb friction, offset."""
    (y, x), (y_held, x_held) = (_plain_columns(split) for split in (train, held))
    size = np.sqrt(np.mean(x**2, axis=0))
    size[size == 0.0] = 1.0
    estimate = np.linalg.lstsq(x / size, y, rcond=None)[0] / size
    return np.asarray(y_held - x_held @ estimate)


def _plain_columns(split: DataSplit) -> tuple[FloatArray, FloatArray]:
    """(N,) effort and (N, 5) load torque, inertia, viscous and Coulomb friction, 1 of the rows."""
    columns = Columns(split.samples)
    design = columns.design([Term(effect(name)) for name in PLAIN])
    return design[:, 0], np.column_stack([columns.target, design[:, 1:], np.ones(len(design))])


def model_residual(model: ActuatorModel, held: DataSplit) -> FloatArray:
    """Residual (N,) [effort] of the rows under a given model: K (tau + J a + sum theta phi) - y."""
    terms, beta = [], [1.0 / model.drive.gain]
    for value in model.effects:
        known = effect(value.key)
        shapes = {shape.name: value.parameters[shape.name] for shape in known.shapes}
        terms.append(Term(known, shapes))
        beta += [value.parameters[parameter.name] for parameter in known.coefficients]
    columns = Columns(held.samples)
    return np.asarray(model.drive.gain * (columns.target - columns.design(terms) @ np.array(beta)))


def _published_fit(found: JointResult) -> FloatArray:
    """Residual (N,) [effort] of the published form of the AK80-9's model, fitted to the training rows."""
    train, held = (log_rows(split.samples) for split in (found.train, found.heldout))
    kept = list(LINEAR[PUBLISHED_FIT])
    estimate = np.linalg.lstsq(train.columns[:, kept], train.torque, rcond=None)[0]
    return np.asarray(found.final.gain * (held.torque - held.columns[:, kept] @ estimate))
