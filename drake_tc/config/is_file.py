"""Whether a name is that of a file, or of a folder, whatever the name."""

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether it is one; a name that no file can have, such as one with a zero byte or of 5000 letters, is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Whether it is one; a name that no folder can have is none."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False
