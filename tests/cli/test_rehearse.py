"""`drake-tc rehearse`."""

import json

import pytest

from drake_tc.experiments.rehearsal.run import rehearse

pytestmark = pytest.mark.usefixtures("fitted_once")


def test_it_prints_and_writes_a_power_curve(invoke, look_for, bench, tmp_path, monkeypatch):
    """One size beside none: each is a simulation and a diagnosis, which looks for two effects."""
    look_for("load_dependent_friction", "stribeck")
    monkeypatch.setitem(rehearse.__kwdefaults__, "factors", (2.0,))
    done = invoke(
        "rehearse", *bench.arguments(), "--holdout", bench.holdout, "--with", "load_dependent_friction=0.1",
        "--repeats", 1, "--jobs", 1, "--out", tmp_path / "r", "--json",
    )  # fmt: skip
    assert done.code == 0, done.err
    document = json.loads(done.out)
    assert [(p["size"], p["trials"]) for p in document["points"]] == [(0.0, 1), (0.2, 1)]
    assert document["points"][1]["found"] == 1
    assert (tmp_path / "r" / "rehearsal.html").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--with", "nothing_known"], "no effect"),
        (["--with", "thermal_friction"], "temperature not recorded"),
        (["--with", "stribeck", "--repeats", "0"], "--repeats"),
        (["--with", "stribeck", "--joint", "elbow"], "--joint"),
    ],
)
def test_what_cannot_be_rehearsed_is_one_line(invoke, bench, tmp_path, arguments, words):
    runs = [*bench.arguments(), "--holdout", bench.holdout]
    done = invoke("rehearse", *runs, "--jobs", "1", "--out", tmp_path / "r", *arguments)
    assert words in done.refusal()


def test_one_run_is_not_enough(invoke, bench, tmp_path):
    done = invoke("rehearse", "--rig", bench.rig, "--log", bench.logs[0], "--with", "stribeck", "--out", tmp_path / "r")
    assert "two runs" in done.refusal()
