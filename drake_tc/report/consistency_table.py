"""Each parameter by run, gain, load and direction: the rows of the report's table."""

from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.result.joint_result import JointResult, ParameterByCondition
from drake_tc.report.numbers import interval, percent, pretty_unit
from drake_tc.report.words import title_of

BY = {"run": "run", "gain": "gain of the position loop", "load": "size of the load", "direction": "direction of motion"}


@dataclass(frozen=True)
class ConsistencyRow:
    """One parameter in each part of the rows: (part, value, interval) in its unit, and whether it moves."""

    parameter: str
    unit: str
    by: str
    values: Sequence[tuple[str, str, str]]
    change: str
    moves: bool


def consistency_rows(joint: JointResult) -> Sequence[ConsistencyRow]:
    """Parameters that move first, then the others, each group in the model's order."""
    rows = [_row(p) for p in joint.consistency]
    return sorted(rows, key=lambda row: not row.moves)


def _row(p: ParameterByCondition) -> ConsistencyRow:
    name = p.name.replace("_", " ")
    values = [(part, *interval(*each)) for part, each in p.values.items()]
    where = "drive" if p.effect == "drive" else title_of(p.effect)
    return ConsistencyRow(f"{where}: {name}", pretty_unit(p.unit), BY[p.by], values, percent(p.change), p.moves)
