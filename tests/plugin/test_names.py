"""A diagram and a reproduction of an installed package, by name, in the commands."""

import json
import re

import pytest

from drake_tc.errors import ParamsError
from drake_tc.registry import reproductions, runnable

from .conftest import PACKAGE, ROOT


def test_a_diagram_is_drawn_simulated_and_judged_and_a_reproduction_computed_by_their_names(commands, tmp_path):
    said = commands(
        ["graph", "decay", "--format", "json"],
        ["simulate", "decay", "--duration", "0.1", "--out", str(tmp_path / "run"), "--json"],
        ["stability", "decay", "--open-at", "drain:y0", "--json"],
        ["reproduce", "X.half_life", "--json"],
    )
    drawn, ran, evaluated, reproduced = map(json.loads, said)
    assert {block["name"] for block in drawn["blocks"]} >= {"store", "drain"}
    assert ran["diagram"] == "decay"
    assert evaluated["spectral_radius"] == pytest.approx(0.9, abs=1e-6)
    (row,) = reproduced["rows"]
    assert (row["value"], row["expected"], row["met"]) == (7, 7, True)


def test_nothing_of_it_is_known_where_it_is_not_installed():
    with pytest.raises(ParamsError, match="no diagram 'decay'"):
        runnable("decay")
    with pytest.raises(ParamsError, match=r"no reproduction 'X.half_life'"):
        reproductions("X.half_life")


def test_the_page_shows_the_entry_points_of_the_package():
    page = (ROOT / "docs" / "diagram_commands.md").read_text("utf-8")
    (shown,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    assert shown in (PACKAGE / "pyproject.toml").read_text("utf-8")
