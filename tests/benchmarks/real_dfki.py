"""`bench real-dfki`: what `close-loop` leaves of a quasi-direct-drive pendulum's torque on runs that took no part.

The cases are those of `bench/rigs/dfki-simple-pendulum`. The error is given twice: over the whole band of the filters,
and inside the band in which the model explains the torque of the training runs (`diagnosis.residual.band`). The second
one has to be reached: above that band the recorded torque is the answer of the controller to the encoder's errors, and
no motion of the pendulum tells of it.

`run_fits` asks whether the runs agree: the declared model is fitted to each run alone and to the other runs, through
filters that pass half the power at 4.7 Hz. A run that is predicted well by its own fit only has other coefficients.
`one_effect_more` asks whether the library has a cause that the other runs know: each effect at each point of its shape
grid is fitted to the other runs beside an encoder that errs 12 times a turn, and the best one is chosen in view of the
run that it predicts.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit, predict
from drake_tc.effects.library import effect, looked_for
from drake_tc.errors import LogError
from drake_tc.logs.channels import at_common_period
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.importers.dfki import TORQUE_PER_AMPERE, convert
from tests.benchmarks.real_log_cases import import_set
from tests.benchmarks.real_log_claims import CaseClaims, RunFigures
from tests.benchmarks.real_logs import chosen_sets, run_case

DATA_SET = "dfki-simple-pendulum"
GOOD = {
    "ddp": ("control_method_ddp__data_measured", None),
    "direct_collocation": ("control_method_direct_collocation__data_measured", None),
    "energy_shaping": ("control_method_energy_shaping__data_measured", 7.0),
    "sac": ("control_method_sac__data_measured", 7.0),
}
"""Runs that nobody touches; the last two only until the first push by hand [s]."""
CASES = (
    *(f"{name}_alone_held_out" for name in GOOD),
    "optimal_control_held_out",
    "energy_shaping_held_out",
)
"""Each good run predicted from the other three, and the two cases with two held-out runs."""
GOAL = 0.15
RIPPLE = Term(effect("encoder_ripple"), {"cycles_per_turn": 12.0})
"""What `close-loop` names in these cases: a wave that passes twice in a motor turn of a gear of ratio 6."""
WIDTH = 0.16
"""Of the kernel of `run_fits` [s]; all signals pass it twice."""


@dataclass(frozen=True)
class RunFit:
    """The declared model on one run.

    Attributes:
        own, others: RMS [N m of reported torque] on the run, fitted to it and fitted to the other runs.
        own_share, others_share: Torque at the joint over reported torque, of both fits.
        floor: What the sensors' noise alone leaves [N m of reported torque].
    """

    own: float
    others: float
    own_share: float
    others_share: float
    floor: float


def good_runs(data: Path) -> tuple[dict[str, Run], Rig]:
    """The good runs by short name, and their rig.

    Raises:
        LogError: the set is not in `data`.
    """
    with TemporaryDirectory() as scratch:
        convert(data / DATA_SET, Path(scratch))
        folder = Path(scratch) / "simple"
        rig = load_rig(folder / "rig.yaml")
        runs = {}
        for name, (file, end) in GOOD.items():
            run = load_runs([folder / f"{file}.parquet"], rig)[0]
            if end is not None:
                segment = run.segment.copy()
                segment[run.time - run.time[0] > end] = -1
                run = replace(run, segment=segment)
            runs[name] = run
    return runs, rig


def claims(data: Path, names: tuple[str, ...] = CASES) -> dict[str, CaseClaims]:
    """What `close-loop` claims in each of the cases, by case.

    Raises:
        LogError: The set is not in `data`, or `close-loop` refuses a case.
    """
    (chosen,) = chosen_sets([DATA_SET])
    cases = {case.name: case for case in chosen.cases}
    out = {}
    with TemporaryDirectory() as scratch:
        logs = import_set(chosen, data, Path(scratch))
        for name in names:
            out[name] = run_case(chosen, cases[name], logs, Path(scratch))
            if out[name].refusal:
                raise LogError(f"{DATA_SET}/{name}: close-loop refuses the case: {out[name].refusal}")
    return out


def rows(data: Path) -> list[BenchmarkRow]:
    """The table: error [N m of reported torque] on each held-out run, over all frequencies and inside the band."""
    fits = [row for name, each in run_fits(data).items() for row in _fit_rows(name, each)]
    for name, (plain, best) in one_effect_more(data).items():
        fits.append(
            BenchmarkRow(
                f"{name}/with_ripple", plain[0], "N*m", note=f"fitted to the others through {WIDTH:g} s, twice"
            )
        )
        fits.append(
            BenchmarkRow(f"{name}/one_effect_more", best[0], "N*m", note=f"chosen in view of this run: {best[1]}")
        )
    return [row for name, case in claims(data).items() for row in _case_rows(name, case)] + fits


def run_fits(data: Path) -> dict[str, RunFit]:
    """The declared model fitted to each good run, and to the other three, and evaluated on that run."""
    runs, rig = good_runs(data)
    (joint,) = rig.joints
    declared = [Term(effect("viscous")), Term(effect("coulomb"))]
    out = {}
    for name, run in runs.items():
        evaluated = Columns(build_samples([run], rig, joint, WIDTH))
        others = at_common_period([each for other, each in runs.items() if other != name])
        fits = [fit(c, declared) for c in (evaluated, Columns(build_samples(others, rig, joint, WIDTH)))]
        own, of_others = (float(np.sqrt(np.mean(predict(evaluated, f) ** 2))) * TORQUE_PER_AMPERE for f in fits)
        floor = fits[0].gain * evaluated.samples.floor.torque(*(float(x) for x in fits[0].beta[:2])) * TORQUE_PER_AMPERE
        own_share, others_share = (1.0 / (f.gain * TORQUE_PER_AMPERE) for f in fits)
        out[name] = RunFit(own, of_others, own_share, others_share, floor)
    return out


def one_effect_more(data: Path) -> dict[str, list[tuple[float, str]]]:
    """By good run: RMS [N m of reported torque] that fits to the other runs leave on it, and the effect that they have
    beyond friction and the encoder's wave; "" for the fit without one, which comes first, then the best one.
    """
    runs, rig = good_runs(data)
    (joint,) = rig.joints
    declared = [Term(effect("viscous")), Term(effect("coulomb"))]
    out = {}
    for name, run in runs.items():
        others = at_common_period([each for other, each in runs.items() if other != name])
        sides = [Columns(build_samples(each, rig, joint, WIDTH)) for each in (others, [run])]
        plain = fit(sides[0], declared)
        train, evaluated = (c.with_model(plain.terms, plain.beta, servo=False) for c in sides)
        context = context_of(train.samples, rig, joint)

        def left(added: list[Term], train: Columns = train, evaluated: Columns = evaluated) -> float:
            found = fit(train, [*declared, RIPPLE, *added])
            residual = evaluated.target - evaluated.design(found.terms) @ found.beta
            return float(np.sqrt(np.mean(residual**2))) * found.gain * TORQUE_PER_AMPERE

        usable = [
            e for e in looked_for(context, None) if e.id not in ("viscous", "coulomb") and not e.unavailable(context)
        ]
        tried = [(left([Term(e, shape)]), e.id) for e in usable for shape in e.shape_grid(context)]
        out[name] = [(left([]), ""), min(each for each in tried if np.isfinite(each[0]))]
    return out


def _fit_rows(name: str, fits: RunFit) -> Iterator[BenchmarkRow]:
    note = f"declared model through {WIDTH:g} s, twice"
    yield BenchmarkRow(f"{name}/own_fit", fits.own, "N*m", note=note)
    yield BenchmarkRow(f"{name}/fit_of_others", fits.others, "N*m", note=note)
    yield BenchmarkRow(f"{name}/own_floor", fits.floor, "N*m", note="what the sensors' noise alone leaves")
    yield BenchmarkRow(f"{name}/own_share", fits.own_share, "-", note="torque at the joint over reported torque")
    yield BenchmarkRow(f"{name}/others_share", fits.others_share, "-", note="the same of the other runs")


def short_name(run: str) -> str:
    """Name of a run without what all file names of the set share."""
    return run.removeprefix("control_method_").split("__")[0]


def _case_rows(name: str, case: CaseClaims) -> Iterator[BenchmarkRow]:
    (joint,) = case.joints
    found = ", ".join(str(effect["id"]) for effect in joint.effects) or "nothing"
    for run in joint.heldout:
        begin = f"{name}/{short_name(run.name)}"
        yield BenchmarkRow(f"{begin}/before", run.before * TORQUE_PER_AMPERE, "N*m")
        yield BenchmarkRow(f"{begin}/whole", run.after * TORQUE_PER_AMPERE, "N*m", note=f"found: {found}")
        yield _band_row(begin, run)
        yield BenchmarkRow(f"{begin}/floor", joint.floor * TORQUE_PER_AMPERE, "N*m", note="of the whole band")
        yield BenchmarkRow(f"{begin}/band", run.band_hz, "Hz", note="chosen by the training runs; 0: there is none")


def _band_row(begin: str, run: RunFigures) -> BenchmarkRow:
    """The error inside the band; without a band the whole error counts."""
    error = run.after if np.isnan(run.in_band) else run.in_band
    return BenchmarkRow(f"{begin}/in_band", error * TORQUE_PER_AMPERE, "N*m", GOAL, "max")
