"""Position errors of the free runs, by run and by model, as a reader sees them."""

from dataclasses import dataclass

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.refinement_json import MODELS, position_errors
from drake_tc.report.numbers import scale_for


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
    rows = []
    for run, trace in traces.items():
        role = "held-out" if run in joint.heldout.samples.runs else "training"
        errors = [position_errors(trace, name) for name in models]
        rms, absolute = (
            tuple("–" if e is None else scale_for(e[which], "rad").quantity(e[which]) for e in errors)
            for which in (0, 1)
        )
        rows.append((run, role, rms, absolute))
    return FreeRunTable(models, tuple(rows))
