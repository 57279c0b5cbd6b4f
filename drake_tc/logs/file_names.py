"""File names made from what data says: a run's, a motor's or a trajectory's name never leads out of its folder."""

import re

LONGEST = 100
"""Characters of a name; file systems take 255 bytes, and endings follow."""


def file_name(text: object) -> str:
    """A name for a file or folder: letters, digits, '_', '-', '+' and inner dots of `text`; all else becomes '_'.

    Args:
        text: Any value that data holds, such as "../../etc/passwd".

    Returns:
        At most 100 characters, without separators and without a dot at either end; "unnamed" where nothing is left.
    """
    kept = re.sub(r"[^\w+.-]", "_", str(text)[: 4 * LONGEST])
    return kept.strip(".")[:LONGEST].rstrip(".") or "unnamed"
