"""Strict priorities from YAML: `priority` of each task, and of robustness in `formulation`."""

from collections.abc import Mapping, Sequence
from typing import Any

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.tsid.priorities import Priorities

KEY = "priority"
_BY_WEIGHT = ("use", "weight", "minimum")
"""Keys of a formulation that choose how much robustness may cost; a level of its own says that already."""


def read_priorities(
    tasks: Sequence[tuple[str, Any]], formulation: Mapping[str, Any], measure: str
) -> Priorities | None:
    """None where no `priority` is given anywhere; else tasks without one are on level 1.

    Args:
        tasks: Name and entry of each.
        formulation: Entry.
        measure: Of the formulation: "individual" has a level of its own, by default below all tasks.

    Raises:
        ParamsError: a level that is no whole number from 1 on, robustness on a level of tasks, or keys of the
            formulation that do not go with levels.
    """
    given = {name: entry[KEY] for name, entry in tasks if isinstance(entry, dict) and KEY in entry}
    if not given and formulation.get(KEY) is None:
        return None
    idle = [key for key in _BY_WEIGHT if formulation.get(key) is not None]
    if idle:
        raise ParamsError(
            f"formulation.{idle[0]}: expected none (null) beside strict priorities, got {formulation[idle[0]]!r}"
        )
    levels = tuple(_level(f"tasks.{name}.{KEY}", given.get(name, 1)) for name, _ in tasks)
    robustness = _level(f"formulation.{KEY}", formulation[KEY]) if formulation.get(KEY) is not None else None
    if measure == "individual" and robustness is None:
        robustness = max(levels) + 1
    return Priorities(levels, robustness)


def without_priorities(tasks: Sequence[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """The entries as the tasks themselves know them."""
    return [
        (name, {key: value for key, value in entry.items() if key != KEY} if isinstance(entry, dict) else entry)
        for name, entry in tasks
    ]


def _level(where: str, value: object) -> int:
    number = fields.number(where, value)
    if number != round(number) or number < 1:
        raise ParamsError(f"{where}: expected 1, 2, ..., got {value!r}")
    return round(number)
