"""`drake-tc check`."""

import json

import pytest

pytestmark = pytest.mark.usefixtures("fitted_once")


def test_it_prints_a_table_and_names_each_effect_with_the_smallest_size_that_would_be_found(invoke, bench, tmp_path):
    done = invoke("check", *bench.arguments(), "--out", tmp_path / "out")
    assert done.code == 0
    assert "stribeck" in done.out and "Cannot be looked for:" in done.out
    page = (tmp_path / "out" / "check.html").read_text(encoding="utf-8")
    assert "Stribeck friction" in page and "What these logs can show" in page
    document = json.loads((tmp_path / "out" / "check.json").read_text(encoding="utf-8"))
    assert document["name"] == "check"
    (joint,) = document["joints"].values()
    stribeck = next(e for e in joint["effects"] if e["id"] == "stribeck")
    confused = {"not_separable_from", "separable", "confused_below"}
    assert set(stribeck) == {"id", "key", "status", "size", "kept", "reason"} | confused
    assert 0.0 < stribeck["size"]["smallest"] < 4.0 and stribeck["size"]["unit"] == "N*m"
    names = {finding["name"] for finding in joint["findings"]}
    assert {"position step", "lead of the command", "clocks", "energy", "gravity"} <= names


def test_input_that_cannot_be_used_is_one_line(invoke, bench, tmp_path):
    assert "no such" in invoke("check", "--rig", bench.rig, "--log", tmp_path / "none.csv").refusal().lower()
