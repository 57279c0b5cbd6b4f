"""diagrams/README.md lists every diagram and leads to the pages of all scenario files."""

from pathlib import Path

import pytest

from drake_tc.registry import diagrams

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "diagrams" / "README.md").read_text("utf-8")


def test_every_diagram_is_listed():
    assert all(f"`{name}`" in PAGE for name in diagrams())


@pytest.mark.parametrize("loop", ["torque", "whole_body", "series_elastic"])
def test_the_page_of_every_scenario_file_is_linked(loop):
    assert f"(../drake_tc/loops/{loop}/SCENARIO.md)" in PAGE
