"""How much a log may hold once it is unpacked, so that a small file cannot fill the memory."""

import zlib
from pathlib import Path

from drake_tc.errors import LogError

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
                    raise LogError(f"{path}: {refused}: the file is cut after {len(packed)} bytes; copy it anew")
                parts.append(part)
                size, rest = size + len(part), member.unconsumed_tail
                check_size(path, len(packed), size)
        except zlib.error:
            raise LogError(f"{path}: {refused}: the packed data are damaged; copy it anew") from None
        rest = member.unused_data
    return b"".join(parts)
