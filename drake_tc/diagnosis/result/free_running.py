"""Free-run errors on held-out runs: the Drake diagram of each model, driven by the recorded command alone."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.diagnosis.notes import FreeRunDiverges, FreeRunObstacle, NoFreeRun, Note
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import model_of
from drake_tc.diagnosis.result.refinement import Refinement
from drake_tc.diagnosis.result.run_errors import MODELS
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

FreeRun = Callable[[ActuatorModel, Rig, str, Run], tuple[FloatArray, FloatArray, FloatArray] | None]
"""(model, rig, joint, run) -> (time, recorded, simulated position), or None where it cannot run."""


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
