"""An effect of an installed package: `close-loop` finds it, models and rig files name it, simulations run it."""

import json

import pytest

from drake_tc.effects.library import all_effects
from drake_tc.errors import RigError
from drake_tc.logs.rig import load_rig

from .seal_logs import COSINE, SINE, write_bench

AMONG_FEW = """
import sys
from drake_tc.cli.main import run
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.effects import library

library.LIBRARY = tuple(each for each in library.LIBRARY if each.id in ("viscous", "coulomb", "stribeck", "payload"))
DiagnosisOptions.__init__.__defaults__ = (0, False, None, None)
sys.exit(run(sys.argv[1:]))
"""
"""The command in a library of four effects, beside that of the package; what is left is not assessed."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return write_bench(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def found(bench, python, tmp_path_factory):
    rig, logs, holdout = bench
    out = tmp_path_factory.mktemp("out")
    runs = [argument for log in logs for argument in ("--log", log)]
    ran = python(
        "-c", AMONG_FEW, "close-loop", "--rig", rig, *runs, "--holdout", holdout, "--out", out, "--no-closed-loop"
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads((out / "report.json").read_text("utf-8")), ran.stdout, out


def test_close_loop_finds_the_effect_of_the_installed_package(found):
    report, text, out = found
    assert report["verdict"] == "effects_found"
    (effect,) = report["joints"]["axis"]["effects"]
    assert effect["id"] == "seal_drag"
    for name, true in (("cosine_drag", COSINE), ("sine_drag", SINE)):
        low, high = effect["parameters"][name]["ci95"]
        assert low <= true <= high
        assert high - low < 0.1 * abs(true)
    assert "seal_drag" in text
    assert "Eccentric seal" in (out / "report.html").read_text("utf-8")


READ = """
import json, sys
from drake_tc import load_models, load_rig
from drake_tc.logs.rig_document.document import rig_schema

keys = [value.key for value in load_models(sys.argv[1])["axis"].effects]
print(json.dumps([keys, list(load_rig(sys.argv[2]).declared["axis"]), str(rig_schema())]))
"""


def test_models_and_rig_files_name_the_effect_where_it_is_installed(found, bench, python, tmp_path):
    errors = found[0]["joints"]["axis"]["error"]
    assert errors["after"]["free_run_heldout"] < 0.5 * errors["before"]["free_run_heldout"]
    declaring = tmp_path / "rig.yaml"
    declaring.write_text(bench[0].read_text("utf-8").replace("{rotor_inertia: 0.05}", "[seal_drag]"), "utf-8")
    ran = python("-c", READ, found[2] / "model_after.yaml", declaring)
    assert ran.returncode == 0, ran.stderr
    model, declared, schema = json.loads(ran.stdout)
    assert "seal_drag" in model and "seal_drag" in declared and "'seal_drag'" in schema
    with pytest.raises(RigError, match="unknown effect 'seal_drag'"):
        load_rig(declaring)


def test_nothing_of_it_is_seen_where_it_is_not_installed():
    assert "seal_drag" not in {effect.id for effect in all_effects()}
