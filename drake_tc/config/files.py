"""Files: whether they are there, what they may be called and hold, and how they are written whole.

Whether a name is that of a file, or of a folder, whatever the name.

Files that are written whole or not at all: beside their place, and moved there when all is written.

Names of files in texts that are written in UTF-8, whatever bytes a name has.

File names made from what data says: a run's, a motor's or a trajectory's name never leads out of its folder.

How much a log may hold once it is unpacked, so that a small file cannot fill the memory.
"""

import os
import re
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drake_tc.errors import LogError


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


def utf8_text(text: str) -> str:
    """The text; surrogates, as Python has them for bytes of a name that are not UTF-8, are replaced by U+FFFD."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def utf8_name(path: Path | str) -> str:
    """The name of a file without its folder, as `utf8_text`."""
    return utf8_text(Path(path).name)


def path_from(folder: Path | str, path: Path | str) -> str:
    """The path of a file as seen from a folder, with "/", as `utf8_text`; its name where no relative path leads there.

    Example:
        >>> path_from("out/knee", "logs/rig.yaml")
        '../../logs/rig.yaml'
    """
    try:
        return utf8_text(Path(os.path.relpath(path, folder)).as_posix())
    except ValueError:  # another drive
        return utf8_name(path)


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


LARGEST = 2**32
"""Of the unpacked content of a file [bytes]."""
UNSUSPECTED = 2**26
"""Unpacked content of this size is taken whatever the packed one is [bytes]."""
DENSEST = 250.0
"""Unpacked over packed size; recorded signals stay far below, as their last digits are noise."""


def check_size(path: Path, packed: float, unpacked: float) -> None:
    """Refuse content that is too large, or that no recording packs so well.

    Args:
        path: The file, for the message.
        packed: Its size [bytes].
        unpacked: Size of its content [bytes].

    Raises:
        LogError: It is.
    """
    if unpacked > LARGEST or unpacked > max(UNSUSPECTED, DENSEST * packed):
        raise LogError(
            f"{path}: {packed:.0f} bytes would unpack to {unpacked:.3g} or more; expected at most {LARGEST >> 30} GiB,"
            f" and at most {DENSEST:g} times the packed size, as recorded signals take"
        )


def unpacked_gzip(path: Path) -> bytes:
    """The content of a .gz file, which may have several members.

    Raises:
        LogError: It is damaged or cut, or would fill the memory.
    """
    refused = f"cannot be read as {''.join(path.suffixes[-2:])}"
    packed = path.read_bytes()
    parts: list[bytes] = []
    rest, size = packed, 0
    while rest.strip(b"\0"):
        member = zlib.decompressobj(wbits=31)
        try:
            while not member.eof:
                part = member.decompress(rest, 2**24)
                if not part and not member.unconsumed_tail and not member.eof:
                    raise LogError(f"{path}: {refused}: the file is cut after {len(packed)} bytes; copy it again")
                parts.append(part)
                size, rest = size + len(part), member.unconsumed_tail
                check_size(path, len(packed), size)
        except zlib.error:
            raise LogError(f"{path}: {refused}: the packed data are damaged; copy it again") from None
        rest = member.unused_data
    return b"".join(parts)
