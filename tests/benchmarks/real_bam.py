"""`bench real-bam`: free runs of servos on a pendulum by `close-loop` alone, each trajectory held out in turn.

The cases are the committed ones of `bench/rigs/bam-xl330-pendulum` (`motor/...`) and `bench/rigs/bam-sts3250-pendulum`
(the same). The error is the mean absolute position error of the free-running Drake diagram on held-out runs, driven by
the goal position alone over the stretch with torque on: of the model before, the model after (equation error) and
the refined model (output error), beside the model that the data set's authors published.

The published models in the terms of `drake_tc.effects`; back-EMF goes into the viscous friction:

    XL330, M1: kt 0.323 V s/rad, R 4.764 ohm, armature 0.00164, friction_base 0.00697, friction_viscous 0.01049
    STS3250, M6: stiffness 67.3 N m/rad, damping 2.345, inertia 0.0010, friction_base 0.199, viscous 0.035,
        Stribeck 0.044, load_external 0.196, load_external_stribeck 0.418, dq_s 0.0587, alpha 1.59
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.errors import FreeRun, position_errors
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import IdentificationError
from drake_tc.logs.files.bam_runs import JOINT
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.real_log_cases import RealLogCase, RealLogSet, case_files, import_set
from tests.benchmarks.real_logs import chosen_sets

XL330, STS3250 = "bam-xl330-pendulum", "bam-sts3250-pendulum"
GAINS = (100, 200, 800)
TRAJECTORIES = ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square")
TO_REACH = 0.045
"""Mean absolute position error [rad] of the XL330 at every gain."""
SUFFIX = "_held_out"

Progress = Callable[[str, float], None]


def _model(drive: Drive, effects: Mapping[str, Mapping[str, float]]) -> ActuatorModel:
    return ActuatorModel(JOINT, drive, tuple(EffectValue(key, values) for key, values in effects.items()))


PUBLISHED = {
    XL330: _model(
        Drive("voltage", 4.764 / 0.323),
        {
            "rotor_inertia": {"rotor_inertia": 0.00164},
            "viscous": {"viscous": 0.01049 + 0.323**2 / 4.764},
            "coulomb": {"coulomb": 0.00697},
        },
    ),
    STS3250: _model(
        Drive("position_servo", 1.0 / 67.3),
        {
            "rotor_inertia": {"rotor_inertia": 0.0010},
            "viscous": {"viscous": 0.035 + 2.345},
            "coulomb": {"coulomb": 0.199},
            "stribeck": {"stribeck": 0.044, "stribeck_velocity": 0.0587, "stribeck_exponent": 1.59},
            "load_dependent_friction": {"load_friction": 0.196},
            "load_stribeck": {"load_stribeck": 0.418, "load_stribeck_velocity": 0.0587},
        },
    ),
}
"""The authors' fits to all of these runs, held-out ones included."""
MODELS = {"published": "published model", "before": "model before", "after": "model after", "refined": "refined model"}


@dataclass(frozen=True)
class HeldOutRun:
    """Mean absolute position error [rad] of a held-out run's free runs, by model; NaN where one has diverged.

    Attributes:
        data_set, folder, trajectory: Which run; the folder names motor and gain.
        errors: By key of `MODELS`. `refined` is the model after where the refinement was not accepted.
        status: What the refinement came to.
    """

    data_set: str
    folder: str
    trajectory: str
    errors: Mapping[str, float]
    status: str


def held_out_runs(
    chosen: RealLogSet, case: RealLogCase, logs: Path, scratch: Path, free_run: FreeRun, executor: Executor | None
) -> Iterator[HeldOutRun]:
    """`close-loop` on one case, and the published model beside it."""
    files = case_files(chosen, case, logs, scratch)
    options = DiagnosisOptions(assess_residual=False)
    result = close_loop(files.rig, files.log, files.holdout, options, free_run, executor=executor)
    joint = result.joints[JOINT]
    rig = load_rig(files.rig)
    published = {run.source: free_run(PUBLISHED[chosen.name], rig, JOINT, run) for run in load_runs(files.holdout, rig)}
    status = "none" if joint.refinement is None else joint.refinement.status
    names = {run.source: run.name for run in load_runs(files.holdout, rig)}
    for path, made in published.items():
        trace = joint.free_run[names[path]]
        found = {name: position_errors(trace, name) for name in ("before", "after", "refined")}
        errors = {name: np.nan if pair is None else pair[1] for name, pair in found.items()}
        if found["refined"] is None:
            errors["refined"] = errors["after"]
        errors["published"] = np.nan if made is None else float(np.mean(np.abs(made[2] - made[1])))
        yield HeldOutRun(chosen.name, Path(str(path)).parent.name, Path(str(path)).stem, errors, status)


def real_bam_rows(
    data: Path,
    free_run: FreeRun,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
    trajectories: Sequence[str] = TRAJECTORIES,
    sets: Sequence[str] = (XL330, STS3250),
) -> list[BenchmarkRow]:
    """The tables: each trajectory held out in turn. A case that `close-loop` refuses is a row with the reason.

    Args:
        data: The folder of public data sets, or the one set's own.
        free_run: Simulates the Drake diagram (`drake_tc.loops.joint_bench.rig_free_run`).
        progress: Told how far it is.
        executor: Runs simulations beside each other.
        trajectories: Which to hold out.
        sets: Which data sets.

    Raises:
        LogError: a data set is not there.
    """
    found: list[HeldOutRun] = []
    refused: list[BenchmarkRow] = []
    for chosen in chosen_sets(sets):
        with TemporaryDirectory() as place:
            logs = import_set(chosen, data, Path(place))
            cases = [c for c in chosen.cases if c.name.removeprefix("motor/").removesuffix(SUFFIX) in trajectories]
            for number, case in enumerate(cases):
                progress(f"{chosen.name}/{case.name}", number / len(cases))
                try:
                    found += held_out_runs(chosen, case, logs, Path(place), free_run, executor)
                except IdentificationError as error:
                    refused.append(BenchmarkRow(f"{chosen.name}/{case.name}/refused", math.nan, note=str(error)))
    return [*_means(found), *_single(found), *refused]


def _means(found: Sequence[HeldOutRun]) -> Iterator[BenchmarkRow]:
    """One row a motor, gain and model: the refined model has to reach the target."""
    for folder in dict.fromkeys(run.folder for run in found):
        mine = [run for run in found if run.folder == folder]
        note = f"mean over held-out {', '.join(run.trajectory for run in mine)}"
        published = float(np.mean([run.errors["published"] for run in mine]))
        expected = TO_REACH if mine[0].data_set == XL330 else published
        for name in MODELS:
            mean = float(np.mean([run.errors[name] for run in mine]))
            goal = expected if name == "refined" else None
            yield BenchmarkRow(f"{folder}/{name}", mean, "rad", goal, "max", note=note)


def _single(found: Sequence[HeldOutRun]) -> Iterator[BenchmarkRow]:
    for run in found:
        for name in MODELS:
            yield BenchmarkRow(f"{run.folder}/{name}/{run.trajectory}", run.errors[name], "rad", note=run.status)
