"""The README keeps its promises: its rig file is one, its names exist."""

import re
from pathlib import Path

import yaml

import drake_tc
from drake_tc.logs.rig import parse_rig

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


BLOCKS = re.findall(r"```yaml\n(.*?)```", README, re.S)


def test_the_rig_file_is_one():
    rig = parse_rig(yaml.safe_load(BLOCKS[0]))
    assert rig.joints == ("knee",)
    assert rig.known("knee", "rotor_inertia") == 0.31
    assert rig.units["time"] == "ms"


def test_the_names_it_imports_are_public():
    lines = re.findall(r"from drake_tc import (.*)", README)
    assert lines
    for line in lines:
        assert set(line.split(", ")) <= set(drake_tc.__all__)


def test_its_commands_are_in_the_makefile():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name in re.findall(r"(?:`|    )make ([a-z-]+)", README):
        assert re.search(rf"^{name}:", makefile, re.M), name


WORDS = 500
"""Of the whole page, with its code and table."""


def test_it_is_short():
    assert len(README.split()) <= WORDS
