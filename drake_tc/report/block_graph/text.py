"""How wide a text is in Helvetica or a face of its widths, so that boxes fit what stands in them."""

import unicodedata
from collections.abc import Mapping

_GROUPS: Mapping[int, str] = {
    191: "'",
    222: "ijl",
    260: "|",
    278: " !,./:;I[\\]ft",
    333: "()-`r",
    334: "{}",
    355: '"',
    389: "*",
    469: "^",
    500: "Jckszvxy",
    556: "#$0123456789?L_abdeghnopqu",
    584: "+<=>~",
    611: "FTZ",
    667: "&ABEKPSVXY",
    722: "CDHNRUw",
    778: "GOQ",
    833: "Mm",
    889: "%",
    944: "W",
    1015: "@",
}
"""Advance widths of Helvetica [1/1000 em]."""
_WIDTHS = {character: width for width, group in _GROUPS.items() for character in group}
_BOLD = 1.08


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width of one line of text of a font size, in the same unit; an upper bound for letters beyond ASCII."""
    return size * (_BOLD if bold else 1.0) * sum(_width(c) for c in text) / 1000.0


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    wide = unicodedata.east_asian_width(character) in ("W", "F")
    return _WIDTHS.get(character, 1000 if wide else 722)


def shortened(text: str, size: float, limit: float, *, bold: bool = False) -> str:
    """The text, its middle replaced by an ellipsis where it is wider than the limit."""
    if text_width(text, size, bold=bold) <= limit:
        return text
    keep = len(text)
    while keep > 2:
        keep -= 1
        short = f"{text[: (keep + 1) // 2]}…{text[len(text) - keep // 2 :]}"
        if text_width(short, size, bold=bold) <= limit:
            return short
    return text[:1] + "…"
