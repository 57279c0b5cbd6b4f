"""Where commands write their results: tried before anything is computed, locked, and moved into place together.

Results are first written into a hidden folder beside their place. When the command has succeeded they are moved, so
that a folder never holds a new model beside an old report, and a full disk or an interrupt leaves no file cut. The
hidden file `.drake-tc.json` lists what was written, with a digest of each file: what stands there and is not in it, or
was changed since, belongs to the user and is overwritten with `--force` only.
"""

import errno
import fcntl
import hashlib
import json
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from drake_tc.errors import DrakeTcError, ParamsError

MANIFEST = ".drake-tc.json"
"""What drake-tc wrote into a folder; locked while a command writes there."""
STAGING = ".drake-tc-"
"""Prefix of the hidden folder in which results are written before they are moved."""
TRIED = 1 << 16
"""So many bytes are written to see whether there is room [B]."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""What the system says of a disk that takes no more."""


@contextmanager
def result_folder(
    folder: Path,
    option: str,
    *,
    names: Iterable[str] = (),
    inputs: Iterable[Path | None] = (),
    force: bool = False,
) -> Iterator[Path]:
    """Yield a scratch folder for results; what is in it moves to `folder` when the block ends without an error.

    Args:
        folder: Where the results shall be; made.
        option: Of the command, for the message.
        names: Files that the block writes or may write, as far as they are known: tested before the block begins.
            One that an earlier call wrote and this one does not is removed with the same move.
        inputs: Files that the command reads; no result takes the place of one, with `force` neither.
        force: Overwrite what drake-tc did not write.

    Raises:
        ParamsError: a folder that cannot be written, in which another command writes, or that
            holds files of the same names that are not drake-tc's.
    """
    with _opened(folder, folder, option) as place, _locked(place, option, wait=False) as manifest:
        names = tuple(names)
        earlier = _read(manifest)
        readable = [path for path in inputs if path is not None]
        _check(place, option, names, readable, None if force else earlier)
        with _staging(place, option) as staging:
            yield staging
            written = sorted(str(path.relative_to(staging)) for path in staging.rglob("*") if path.is_file())
            _check(place, option, written, readable, None if force else earlier)
            digests = {name: _digest(staging / name) for name in written}
            for name in written:
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                (staging / name).replace(place / name)
            stale = (set(names) & set(earlier)) - set(written)
            for name in stale:
                _remove_unchanged(place / name, earlier[name])
            _write(manifest, {name: digest for name, digest in earlier.items() if name not in stale} | digests)


@contextmanager
def result_file(
    path: Path,
    option: str,
    *,
    inputs: Iterable[Path | None] = (),
    force: bool = False,
) -> Iterator[Path]:
    """Yield a scratch file for a result; it takes the place of `path` when the block ends without an error.

    Other commands may write other files in the same folder meanwhile. A device such as /dev/stdout is written directly.

    Args:
        path: Where the result shall be; its folder is made.
        option: Of the command, for the message.
        inputs: Files that the command reads; the result takes the place of none of them, with `force` neither.
        force: Overwrite a file that drake-tc did not write.

    Raises:
        ParamsError: as `result_folder`.
    """
    with _told(path, option):
        device = _is_device(path)
    if device:
        with _told(path, option):
            yield path
        return
    with _opened(path.parent, path, option) as place:
        readable = [each for each in inputs if each is not None]
        with _locked(place, option, wait=True) as manifest:
            _check(place, option, [path.name], readable, None if force else _read(manifest))
        with _staging(place, option) as staging:
            yield staging / path.name
            with _locked(place, option, wait=True) as manifest:
                written = _read(manifest)
                _check(place, option, [path.name], readable, None if force else written)
                digest = _digest(staging / path.name)
                (staging / path.name).replace((place / path.name).resolve())
                _write(manifest, written | {path.name: digest})


def print_or_write(text: Callable[[], str], out: Path | None, inputs: Iterable[Path | None], *, force: bool) -> None:
    """Print a text, or write it to a file and print the file's name.

    Args:
        text: Computes what to write, after the file was tried.
        out: The file; its folder is made. None: stdout.
        inputs: Files that the command reads.
        force: Overwrite a file that drake-tc did not write.

    Raises:
        ParamsError: the file cannot be written.
    """
    if out is None:
        sys.stdout.write(text())
        return
    with result_file(out, "--out", inputs=inputs, force=force) as path:
        path.write_text(text(), encoding="utf-8")
    print(out)


@contextmanager
def _opened(folder: Path, shown: Path, option: str) -> Iterator[Path]:
    """The folder, made and tried; made folders that stay empty are removed again. `shown` stands in messages."""
    with _told(shown, option):
        made = [each for each in (folder, *folder.parents) if not each.exists()]
        file = next((each for each in (folder, *folder.parents) if each.exists() and not each.is_dir()), None)
    if file is not None:
        raise ParamsError(f"{option} {shown}: cannot be written: {file} is a file; expected the name of a folder")
    try:
        with _told(shown, option):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as tried:
                tried.write(b"\0" * TRIED)
                tried.flush()
        yield folder.resolve()
    finally:
        _remove_if_empty(made)


@contextmanager
def _told(place: Path, option: str) -> Iterator[None]:
    """Whatever the system says against writing at `place`, as the one line of a ParamsError."""
    try:
        yield
    except OSError as found:
        raise ParamsError(f"{option} {place}: cannot be written: {found.strerror or found}") from None


@contextmanager
def _locked(folder: Path, option: str, *, wait: bool) -> Iterator[IO[str]]:
    """The folder's manifest, locked for this process; a lock ends with its process. An empty one is removed again."""
    path = folder / MANIFEST
    with _told(folder, option):
        manifest = path.open("a+", encoding="utf-8")
    with manifest:
        try:
            fcntl.flock(manifest, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise ParamsError(
                f"{option} {folder}: another drake-tc command is writing there; wait until it has ended, or choose"
                " another folder"
            ) from None
        try:
            yield manifest
        finally:
            manifest.seek(0)
            if not manifest.read(1):
                path.unlink(missing_ok=True)


@contextmanager
def _staging(place: Path, option: str) -> Iterator[Path]:
    """A hidden folder beside the results' place, removed on the way out.

    An OSError of the block is told as one of writing if it concerns a file in there, or if there is no room; others,
    such as an input that cannot be read, pass as they are.
    """
    with _told(place, option):
        staging = Path(tempfile.mkdtemp(prefix=STAGING, dir=place))
        staging.chmod(stat.S_IMODE(place.stat().st_mode) | stat.S_IRWXU)
    try:
        yield staging
    except DrakeTcError as found:
        if str(staging) not in str(found):
            raise
        raise type(found)(str(found).replace(str(staging), str(place))) from None
    except OSError as found:
        if found.errno in NO_ROOM or str(found.filename or "").startswith(str(staging)):
            raise ParamsError(f"{option} {place}: cannot be written: {found.strerror or found}") from None
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _check(
    place: Path,
    option: str,
    names: Iterable[str],
    inputs: Iterable[Path],
    written: dict[str, str] | None,
) -> None:
    """Refuse results that would take the place of an input, a folder, or (with `written`) of a file of the user's."""
    read = {path.resolve() for path in inputs}
    for name in names:
        path = place / name
        if path.resolve() in read:
            raise ParamsError(
                f"{option} {path}: this file is an input of the command; expected a name that it does not read"
            )
        if path.is_dir():
            raise ParamsError(f"{option} {path}: cannot be written: a folder is there; expected the name of a file")
        if path.exists() and not os.access(path, os.W_OK):
            raise ParamsError(f"{option} {path}: cannot be written: no permission")
        if written is None or not path.exists() or path.stat().st_size == 0 or written.get(name) == _digest(path):
            continue
        raise ParamsError(
            f"{option} {path}: this file exists, and drake-tc did not write it or it was changed since;"
            " --force overwrites it, or choose another name"
        )


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "blake2b").hexdigest()[:32]


def _read(manifest: IO[str]) -> dict[str, str]:
    """Names and digests of what drake-tc wrote; nothing where the manifest is damaged."""
    manifest.seek(0)
    try:
        found = json.loads(manifest.read() or "{}")
        return {str(name): str(digest) for name, digest in found["written"].items()}
    except (ValueError, KeyError, AttributeError, TypeError):
        return {}


def _write(manifest: IO[str], written: dict[str, str]) -> None:
    manifest.seek(0)
    manifest.truncate()
    json.dump({"about": "written by drake-tc: file and digest", "written": written}, manifest, indent=1)
    manifest.flush()


def _remove_unchanged(path: Path, digest: str) -> None:
    if path.is_file() and _digest(path) == digest:
        path.unlink()


def _remove_if_empty(folders: Iterable[Path]) -> None:
    """Remove folders that were made and stayed empty, the innermost first."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return
