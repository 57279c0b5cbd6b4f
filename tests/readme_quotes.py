"""What the tables of figures quote: rows of the values on record, alone, in groups and as shares."""

from collections.abc import Callable
from functools import cache

from drake_tc.diagrams.papers.delprete2015.torque_safety import wilson
from drake_tc.diagrams.papers.expected_values import expected_file, on_record

TSID, SEA = "drake_tc/tsid/README.md", "diagrams/sea_joint.md"
ANALYSIS, PAPER_C = "drake_tc/analysis/README.md", "diagrams/papers/faraji2015/README.md"
ROBOTS = 20
PERCENT, MILLI = 100.0, 1e3

Values = Callable[[], list[float | None]]


@cache
def recorded(id_: str) -> dict[str, float]:
    return {name: item.reached for name, item in on_record(expected_file(id_)).items()}


def each(id_: str, *names: str, times: float = 1.0) -> list[float | None]:
    """The rows of these names."""
    return [times * recorded(id_)[name] for name in names]


def group(id_: str, begin: str) -> list[float]:
    """All rows whose names begin so."""
    found = [value for name, value in recorded(id_).items() if name.startswith(begin)]
    assert found, f"{id_}: no row on record begins with {begin!r}"
    return found


def crossing(id_: str, begin: str, forms: tuple[str, ...]) -> list[float | None]:
    return each(id_, *(begin + form for form in forms))


def share(begin: str, way: str) -> list[float | None]:
    """Of the hundred controllers of B.test5, and the ends of its 95 % interval [%]."""
    (found,) = crossing("B.test5", begin, (way,))
    return [found, *(PERCENT * end for end in wilson(round(found), 100))]


def share_of_robots(form: str) -> list[float | None]:
    """Of the twenty robots of B.closed_loop that keep every limit, and the ends of the 95 % interval [%]."""
    (found,) = each("B.closed_loop", f"runs that keep every limit, {form}")
    return [found, *(PERCENT * end for end in wilson(round(found / PERCENT * ROBOTS), ROBOTS))]


TURNS = ("C.turn1hz", "C.turn_half_hz")
WAYS = ("forward", "backward", "sideways")
OURS_PUSHED = "whole-body torque control"
IND_RECT_BOX = ("p_ind", "p_rect", "p_box")
WAYS_5 = ("classic, w_f > 0", "p_ind")
ROBUST = ("individual", "rectangle", "box")

Quote = tuple[str, str, int, Values]
"""File, beginning of the row, cell, and the values whose numbers stand in that cell, in order."""
