"""Files that are written whole or not at all: beside their place, and moved there when all is written."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """Yield a scratch file in the same folder, with the same ending; it takes the place of `path` when the block ends.

    Where the block raises, or the disk is full, what was at `path` stays as it is, and nothing else is left. A link is
    followed; a device is written directly.

    Args:
        path: Where the file shall be.

    Raises:
        OSError: the folder is not there, or cannot be written.
    """
    place = Path(path).resolve()
    if place.exists() and not place.is_file():
        yield place
        return
    handle, name = tempfile.mkstemp(prefix=".", suffix=place.suffix, dir=place.parent)
    os.close(handle)
    scratch = Path(name)
    try:
        yield scratch
        scratch.chmod(place.stat().st_mode & 0o777 if place.exists() else 0o666 & ~_umask())
        scratch.replace(place)
    finally:
        scratch.unlink(missing_ok=True)


def write_whole(path: Path | str, text: str) -> None:
    """Write a text in UTF-8 as a whole file; see `whole_file`.

    Raises:
        OSError: the file cannot be written.
    """
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
