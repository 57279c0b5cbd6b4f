"""Markdown extension: two brackets in a row, such as a vector and its units, are text and not a reference."""

import re
from xml.etree.ElementTree import Element

from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor

BRACKETS = r"\[([^\[\]`]+)\](?= ?\[(?!drake_tc\.)[^\[\]]+\](?!\())"
"""A bracket in front of another one that is no object of the package and no link."""
BEFORE_REFERENCES = 185
"""Priority between that of code (190) and that of references (below 170)."""


class _Brackets(InlineProcessor):
    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Element | str | None, int | None, int | None]:
        return m.group(0), m.start(0), m.end(0)


class UnitBrackets(Extension):
    """Leaves brackets with units alone."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register the pattern in front of Markdown's own references."""
        md.inlinePatterns.register(_Brackets(BRACKETS, md), "unit_brackets", BEFORE_REFERENCES)
