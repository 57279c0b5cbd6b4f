"""Files and folders of results: whether they can be written is tried before anything is computed."""

import os
from pathlib import Path
from tempfile import TemporaryFile

from drake_tc.errors import DrakeTcError, ParamsError


def ready_folder(folder: Path, option: str, error: type[DrakeTcError] = ParamsError) -> None:
    """Make a folder and try to write into it; nothing stays there.

    Args:
        folder: Wanted.
        option: Of the command, for the message.
        error: What to raise.

    Raises:
        DrakeTcError: of the kind `error`; a folder that cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as found:
        raise error(f"{option} {folder}: cannot be written: {found.strerror or found}") from None


def ready_file(path: Path, option: str, error: type[DrakeTcError] = ParamsError) -> None:
    """Make a file's folder and try whether the file can be written; what is in it stays.

    Args:
        path: Wanted.
        option: Of the command, for the message.
        error: What to raise.

    Raises:
        DrakeTcError: of the kind `error`; a file that cannot be written.
    """
    ready_folder(path.parent, option, error)
    if path.is_dir() or (path.exists() and not os.access(path, os.W_OK)):
        raise error(f"{option} {path}: cannot be written: {'a folder' if path.is_dir() else 'no permission'}")
