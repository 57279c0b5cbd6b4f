"""Code blocks of a page of the documentation, and what runs them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from drake_tc.cli.main import run

from .conftest import ROOT

FENCE = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.M | re.S)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file that its title names ("" without a title), and its text."""

    language: str
    title: str
    text: str


def blocks(page: str, *languages: str) -> list[Block]:
    """Blocks of these languages of a page of the repository, in order; all of them without one."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = [Block(language, title, body) for language, title, body in FENCE.findall(text)]
    return [block for block in found if not languages or block.language in languages]


def follow(page: str) -> None:
    """Do in the current folder what the page says: write files, run commands, and run Python in one namespace."""
    names: dict[str, object] = {}
    for block in blocks(page):
        if block.language == "console":
            for line in block.text.splitlines():
                if line.startswith("$ "):
                    program, *arguments = shlex.split(line.removeprefix("$ "), comments=True)
                    assert program == "drake-tc", line
                    assert run(arguments) == 0, line
        elif block.language == "python":
            exec(compile(block.text, page, "exec"), names)
        elif block.title:
            path = Path(block.title)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
