"""The difference between two model files, line by line, for a page that colours it."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class DiffLine:
    """One line: whether it was added, removed, kept, or only says where we are; and its text without the mark."""

    kind: Literal["added", "removed", "kept", "place"]
    text: str


def model_diff(before: str, after: str, context: int = 3) -> Sequence[DiffLine]:
    """Unified difference of two texts; empty when they are the same.

    Args:
        before: Text of the model file before.
        after: The same after.
        context: Unchanged lines to keep around a change.
    """
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=context, lineterm="")
    out: list[DiffLine] = []
    for number, line in enumerate(lines):
        if number < 2:
            continue
        if line.startswith("@@"):
            out.append(DiffLine("place", line))
        elif line.startswith("+"):
            out.append(DiffLine("added", line[1:]))
        elif line.startswith("-"):
            out.append(DiffLine("removed", line[1:]))
        else:
            out.append(DiffLine("kept", line[1:]))
    return out
