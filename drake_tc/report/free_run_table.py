"""Position errors of the free runs, by run and by model, as a reader sees them."""

import math
from dataclasses import dataclass

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.run_errors import MODELS, position_errors
from drake_tc.report.numbers import scale_for
from drake_tc.report.words import natural


@dataclass(frozen=True)
class FreeRunTable:
    """Text of the table.

    Attributes:
        models: Those of `MODELS` that were simulated.
        rows: (run, "training" or "held-out", RMS position errors, mean absolute position errors), both by model.
    """

    models: tuple[str, ...]
    rows: tuple[tuple[str, str, tuple[str, ...], tuple[str, ...]], ...]


def free_run_table(joint: JointResult) -> FreeRunTable:
    """The table of one joint; no rows where no free run was made."""
    traces = joint.free_run
    models = tuple(name for name in MODELS if any(name in trace for trace in traces.values()))
    held = set(joint.heldout.samples.runs)
    runs = sorted(traces, key=lambda run: (run in held, natural(run)))
    errors = {run: [position_errors(traces[run], name) for name in models] for run in runs}
    sizes = [value for found in errors.values() for pair in found if pair is not None for value in pair]
    scale = scale_for(max((value for value in sizes if math.isfinite(value)), default=0.0), joint.units.position)
    rows = []
    for run in runs:
        rms, absolute = (tuple("–" if e is None else scale.quantity(e[which]) for e in errors[run]) for which in (0, 1))
        rows.append((run, "held-out" if run in held else "training", rms, absolute))
    return FreeRunTable(models, tuple(rows))
