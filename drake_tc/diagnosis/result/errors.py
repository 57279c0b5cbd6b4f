"""Errors of the model equation and of the free runs: by run, of whole joints, and of the whole robot."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.notes import FreeRunDiverges, FreeRunObstacle, NoFreeRun, Note, RunsWithoutMotion
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult, Refinement, RunErrors
from drake_tc.diagnosis.result.models import model_of
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

MODELS = ("before", "after", "refined")
"""Models whose free runs there may be."""
FreeRun = Callable[[ActuatorModel, Rig, str, Run], tuple[FloatArray, FloatArray, FloatArray] | None]
"""(model, rig, joint, run) -> (time, recorded, simulated position), or None where it cannot run."""


def run_errors(splits: Sequence[DataSplit]) -> Iterator[RunErrors]:
    """Errors of every run, training runs first."""
    for split, heldout in zip(splits, (False, True), strict=True):
        for number, name in enumerate(split.samples.runs):
            mine = split.samples.run == number
            if mine.any():
                before, after = split.before[mine], split.after[mine]
                absolute = [float(np.mean(np.abs(x))) for x in (before, after)]
                yield RunErrors(name, heldout, int(mine.sum()), rms(before), rms(after), *absolute)


def mean_absolute_errors(joint: JointResult) -> dict[str, dict[str, float | None]]:
    """Mean absolute errors of the models before and after, under the names that their RMS has in `Errors`."""
    out: dict[str, dict[str, float | None]] = {}
    for name in ("before", "after"):
        traces = [trace for trace in joint.free_run.values() if name in trace]
        free = float(np.mean(np.concatenate([np.abs(t[name] - t["recorded"]) for t in traces]))) if traces else np.nan
        out[name] = {
            "train": float(np.mean(np.abs(getattr(joint.train, name)))),
            "heldout": float(np.mean(np.abs(getattr(joint.heldout, name)))),
            "free_run_heldout": free if np.isfinite(free) else None,
        }
    return out


def position_errors(trace: Mapping[str, FloatArray], name: str) -> tuple[float, float] | None:
    """(RMS, mean absolute) position error [rad] of the free run `name`; None without it, NaN where it has diverged."""
    if name not in trace:
        return None
    error = trace[name] - trace["recorded"]
    return rms(error), float(np.mean(np.abs(error)))


def without_rows(parts: Sequence[Samples]) -> tuple[RunsWithoutMotion, ...]:
    """A note on the runs that say nothing; of one that is held out, no verdict is about it."""
    silent = [
        name for samples in parts for number, name in enumerate(samples.runs) if not (samples.run == number).any()
    ]
    if not silent:
        return ()
    return (RunsWithoutMotion(tuple(silent), parts[0].kernel.actual_width_s),)


def with_free_runs(
    result: JointResult,
    rig: Rig,
    held: Sequence[Run],
    free_run: FreeRun,
    executor: Executor | None,
    before: Sequence[Run] | None = None,
) -> JointResult:
    """The result with its free runs and their RMS errors [rad]; a run that diverges counts as no figure at all.

    `before`: the same runs with the loads that the model before was fitted to, where they differ.
    """
    models = {"before": model_of(result, final=False), "after": model_of(result, final=True)}
    if result.refinement is not None and result.refinement.model is not None:
        models["refined"] = result.refinement.model
    sides = {"before": held if before is None else before}
    jobs = [(name, sides.get(name, held)[number]) for number in range(len(held)) for name in models]
    if executor is None:
        made = [free_run(models[name], rig, result.joint, run) for name, run in jobs]
    else:
        futures = [executor.submit(free_run, models[name], rig, result.joint, run) for name, run in jobs]
        made = [future.result() for future in futures]
    traces: dict[str, dict[str, FloatArray]] = {}
    squares: dict[str, list[FloatArray]] = {name: [] for name in models}
    for (name, run), trace in zip(jobs, made, strict=True):
        if trace is None:
            continue
        time, recorded, simulated = trace
        traces.setdefault(run.name, {"time": time, "recorded": recorded})[name] = simulated
        squares[name].append((simulated - recorded) ** 2)
    notes: tuple[Note, ...] = _diverged(traces) if traces else (NoFreeRun(_why_none(result, models["after"])),)
    figures = {name: _rms(parts) for name, parts in squares.items()}
    refinement = _with_figure(result.refinement, figures.get("refined"), figures["after"])
    if refinement is not None and not refinement.accepted:
        traces = {run: {name: trace[name] for name in trace if name != "refined"} for run, trace in traces.items()}
    return replace(
        result,
        before=replace(result.before, free_run_heldout=figures["before"]),
        after=replace(result.after, free_run_heldout=figures["after"]),
        refinement=refinement,
        free_run=traces,
        load_notes=(*result.load_notes, *notes),
        notes=(*result.notes, *notes),
    )


def _with_figure(refinement: Refinement | None, error: float | None, after: float | None) -> Refinement | None:
    """The refinement with its error on the held-out runs [rad]; without its model where that is larger than before."""
    if refinement is None:
        return None
    judged = replace(refinement, free_run_heldout=error)
    worse = error is not None and after is not None and error > after
    return replace(judged, status="worse_held_out", model=None) if worse and refinement.accepted else judged


def _why_none(result: JointResult, model: ActuatorModel) -> FreeRunObstacle:
    """Why a joint has no free run."""
    if result.load is not None:
        return "load_beyond_gear" if model.inertia > 0.0 else "no_fitted_inertia"
    return "nothing_to_simulate" if model.inertia > 0.0 else "no_inertia"


def _diverged(traces: Mapping[str, Mapping[str, FloatArray]]) -> tuple[FreeRunDiverges, ...]:
    """Names the models whose free runs leave the finite numbers, which is why they have no error."""
    lost = {
        model: [run for run, trace in traces.items() if model in trace and not np.isfinite(trace[model]).all()]
        for model in MODELS
    }
    return tuple(FreeRunDiverges(model, tuple(runs)) for model, runs in lost.items() if runs)


def _rms(parts: Sequence[FloatArray]) -> float | None:
    if not parts:
        return None
    value = float(np.sqrt(np.mean(np.concatenate(parts))))
    return value if np.isfinite(value) else None


def robot_gains(joints: Mapping[str, JointResult], sigma: Mapping[str, float]) -> dict[tuple[str, str], float]:
    """Held-out gain of the whole robot by joint and effect key, told as that of a shared cause.

    1 - sqrt(S/S_0), S the sum over the joints of their held-out squares over sigma_j^2, S_0 the same without the
    effect.

    Args:
        joints: Results.
        sigma: By joint, RMS residual of the shared fit [N m].
    """
    squares = {}
    for name, joint in joints.items():
        stiffness = max(float(joint.final.beta[0]), 1e-12)
        squares[name] = float(np.sum((joint.heldout.after * stiffness) ** 2)) / sigma[name] ** 2
    total = max(sum(squares.values()), 1e-300)

    def excess(gain: float) -> float:  # by how much the squared error grows without an effect, relative
        return 1.0 / max(1.0 - gain, 1e-6) ** 2 - 1.0

    return {
        (name, effect.key): 1.0 - 1.0 / float(np.sqrt(1.0 + squares[name] * excess(effect.heldout_gain) / total))
        for name, joint in joints.items()
        for effect in joint.effects
    }
