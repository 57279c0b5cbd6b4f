"""`is_file`: whether a name is that of a file, whatever the name."""

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether it is one; a name that no file can have, such as one with a zero byte or of 5000 letters, is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
