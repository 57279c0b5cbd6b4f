"""What was done to many logs, told once for each kind of note and with the names of the logs."""

import re
from collections.abc import Iterable, Sequence

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")
"""A number that is not a part of a name such as `joint_2`."""
NAMED = 3
"""Logs that are named in a sentence; further ones are counted."""


def distinct_notes(notes: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """One sentence for each kind of note, in the order in which the kinds first appear.

    Notes that differ in their numbers alone are of one kind; the numbers are those of the first log.

    Args:
        notes: (name of the log, sentence).
    """
    kinds: dict[str, list[tuple[str, str]]] = {}
    for log, note in notes:
        kinds.setdefault(_NUMBER.sub("#", note), []).append((log, note))
    return tuple(_sentence(group) for group in kinds.values())


def of_joint(notes: Iterable[tuple[str, str]], joint: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """The notes without those that concern other joints alone."""
    return [(log, note) for log, note in notes if concerns(note, joint, joints)]


def concerns(note: str, joint: str, joints: Sequence[str]) -> bool:
    """Whether a note names a column of the joint, or of no other joint."""
    return _names(note, [joint]) or not _names(note, [name for name in joints if name != joint])


def _names(note: str, joints: Sequence[str]) -> bool:
    """Whether the sentence names a column of one of the joints."""
    return any(re.search(rf"(?<!\w){re.escape(joint)}/", note) for joint in joints)


def _sentence(group: Sequence[tuple[str, str]]) -> str:
    first, note = group[0]
    logs = list(dict.fromkeys(log for log, _ in group))
    if all(other == note for _, other in group):
        return f"{_listed(logs)}: {note}"
    if len(logs) == 1:
        return f"{first}: {note} The same happened {len(group) - 1} more times, with other numbers."
    return f"{first}: {note} The same, with other numbers, holds for {_listed(logs[1:])}."


def _listed(logs: Sequence[str]) -> str:
    if len(logs) <= NAMED:
        return ", ".join(logs)
    return f"{', '.join(logs[:NAMED])} and {len(logs) - NAMED} more logs"
