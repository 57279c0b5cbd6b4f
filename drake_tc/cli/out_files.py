"""Files and folders of results: tried before anything is computed; and texts that go to a file or to stdout."""

import os
import sys
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


def print_or_write(text: str, out: Path | None) -> None:
    """Print a text, or write it to a file and print the file's name.

    Args:
        text: What to write.
        out: The file; its folder is made. None: stdout.

    Raises:
        ParamsError: the file cannot be written.
    """
    if out is None:
        sys.stdout.write(text)
        return
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ParamsError(f"{out}: cannot be written: {error.strerror or error}") from None
    print(out)
