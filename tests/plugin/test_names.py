"""A diagram and a reproduction of an installed package, by name, in the commands."""

import json
import re

import pytest

from drake_tc.errors import ParamsError
from drake_tc.registry import reproductions, runnable

from .conftest import PACKAGE, ROOT


def test_a_diagram_is_drawn_simulated_and_judged_by_its_name(command, tmp_path):
    drawn = command("graph", "decay", "--format", "json")
    assert drawn.returncode == 0, drawn.stderr
    assert {block["name"] for block in json.loads(drawn.stdout)["blocks"]} >= {"store", "drain"}
    ran = command("simulate", "decay", "--duration", "0.1", "--out", tmp_path / "run", "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["diagram"] == "decay"
    evaluated = command("stability", "decay", "--open-at", "drain:y0", "--json")
    assert evaluated.returncode == 0, evaluated.stderr
    assert json.loads(evaluated.stdout)["spectral_radius"] == pytest.approx(0.9, abs=1e-6)


def test_a_reproduction_is_computed_by_its_id(command):
    ran = command("reproduce", "X.half_life", "--json")
    assert ran.returncode == 0, ran.stderr
    (row,) = json.loads(ran.stdout)["rows"]
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
