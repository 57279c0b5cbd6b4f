"""Compiled functions on arrays: what a control loop repeats every tick, free of the cost of single NumPy calls."""

from pathlib import Path


def states(folder: Path) -> dict[Path, tuple[int, int]]:
    """Time of the last change [ns] and size [bytes] of each module below a folder."""
    return {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in folder.rglob("*.py")}


AT_IMPORT = states(Path(__file__).parent)
"""As this process found its modules: what it compiles is kept only while they are the same (`compiling`)."""
