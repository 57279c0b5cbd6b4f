"""What a tick of robust TSID computes, stage by stage, for block graphs."""

from collections.abc import Mapping, Sequence

from drake_tc.inner_stages import InnerStage
from drake_tc.tsid.law import Law


def inner_blocks(law: Law, references: Mapping[str, str], outputs: Sequence[str]) -> tuple[InnerStage, ...]:
    """Terms of the dynamics, rows of every task and limit, the reduction to joint torques, and the program.

    Args:
        law: What the controller solves.
        references: Task to the name of its input port.
        outputs: Names of the controller's output ports.
    """
    terms = InnerStage(
        "terms",
        "Kinematics and dynamics",
        {"state": "estimated_state", "contacts": "active_contacts"},
        {"terms": "M, h, J, dJ v"},
    )
    source = {"terms": "terms.terms"}
    tasks = [
        InnerStage(
            f"task {task.name}", type(task).__name__, {"reference": references[task.name], **source}, {"rows": "A, a"}
        )
        for task in law.tasks
    ]
    limits = [
        InnerStage(f"limit {limit.name}", type(limit).__name__, source, {"rows": "B, bounds"}) for limit in law.limits
    ]
    rows = {stage.name: f"{stage.name}.rows" for stage in (*tasks, *limits)}
    reduction = InnerStage("reduction", "To joint torques", source | rows, {"program": "D, d, G, bounds"})
    form = law.formulation
    chosen = "Strict priorities" if law.priorities else f"{form.measure}, {form.use}".replace("_", " ")
    program = InnerStage("program", chosen, {"program": "reduction.program"}, dict.fromkeys(outputs, "vector"))
    return (terms, *tasks, *limits, reduction, program)
