"""Every expected file of every paper."""

from pathlib import Path

from drake_tc.diagrams.papers import expected_values


def expected_files() -> list[Path]:
    folder = Path(expected_values.__file__).parent
    return sorted(path for name in expected_values.FOLDERS.values() for path in (folder / name).glob("expected/*.yaml"))
