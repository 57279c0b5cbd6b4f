"""The gate: least squares and given models on the rows of a diagnosis, coverage of intervals, and what is stored."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from tests.benchmarks import gate, gate_parts
from tests.benchmarks.__main__ import run
from tests.benchmarks.blind_rigs import BlindOptions
from tests.benchmarks.close_loop_speed import SpeedCase, write_runs
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.gate_real import SETS, SetErrors, held_out_residuals, least_squares, model_residual
from tests.benchmarks.real_log_cases import CaseFiles
from tests.benchmarks.real_logs import chosen_sets


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> SpeedCase:
    return write_runs(tmp_path_factory.mktemp("runs"), 12.0, 200.0)


@pytest.fixture(scope="module")
def diagnosed(recorded):
    options = DiagnosisOptions(assess_residual=False, effects=(effect("quadratic_viscous"),))
    return close_loop(recorded.rig, recorded.logs, recorded.holdout, options)


@pytest.mark.slow
def test_least_squares_and_a_given_model_are_judged_on_the_rows_of_the_diagnosis(recorded, diagnosed):
    """The simulated joint lacks 1.2 v|v| [N m]; its true model leaves the noise of the torque sensor alone."""
    true = ActuatorModel(
        "joint",
        Drive("current", 0.08),
        (
            EffectValue("viscous", {"viscous": 6.0}),
            EffectValue("coulomb", {"coulomb": 3.0}),
            EffectValue("quadratic_viscous", {"quadratic_viscous": 1.2}),
        ),
    )
    files = CaseFiles(recorded.rig, recorded.logs, recorded.holdout)
    left = held_out_residuals(files, diagnosed, true)["joint"]
    rms = {name: float(np.sqrt(np.mean(each**2))) for name, each in left.items()}
    rows = diagnosed.joints["joint"].heldout.samples.rows.size
    assert {each.size for each in left.values()} == {rows}
    assert rms["published"] == pytest.approx(rms["after"], rel=0.1)
    assert rms["published"] < 0.6 * rms["least squares"]
    assert rms["least squares"] <= 1.05 * rms["before"]
    assert rms["before"] == pytest.approx(diagnosed.joints["joint"].before.heldout)


def test_least_squares_is_exact_where_the_joint_has_what_it_fits(diagnosed):
    """Fitted to the rows that it is judged on, it leaves no more than any model of the same five columns."""
    held = diagnosed.joints["joint"].heldout
    plain = ActuatorModel("joint", Drive("current", 0.08), (EffectValue("viscous", {"viscous": 6.0}),))
    own = least_squares(held, held)
    assert np.mean(own**2) < np.mean(held.before**2)
    assert np.mean(own**2) < np.mean(model_residual(plain, held) ** 2)
    assert abs(np.mean(own)) < 1e-9


def test_a_set_is_compared_with_the_best_and_each_joint_counts_alike():
    errors = SetErrors()
    errors.add("a", {"after": np.full(4, 1.0), "pooled": np.full(4, 2.0), "scaled": np.full(4, 4.0)})
    errors.add("b", {"after": np.full(9, 100.0), "pooled": np.full(9, 50.0), "scaled": np.full(9, 100.0)})
    errors.add("a", {"after": np.full(4, 1.0), "pooled": np.full(4, 2.0), "scaled": np.full(4, 4.0)})
    assert errors.best() == "pooled"
    assert errors.ratio("after", "pooled") == pytest.approx(1.0)
    assert errors.ratio("after", "scaled") == pytest.approx(0.5)
    assert errors.rms("b", "pooled") == pytest.approx(50.0)


def test_every_set_of_the_gate_has_its_cases_and_its_rig_file():
    for each in SETS:
        (chosen,) = chosen_sets([each.name])
        names = [case.name for case in chosen.cases]
        assert all(any(name.startswith(begin) for name in names) for begin in each.cases), each.name
        assert not each.rig or (chosen.folder / each.rig).is_file()


def test_the_small_gate_asks_for_rigs_that_there_are():
    small = gate_parts.SIZES["small"].blind
    groups = {spec.group for spec in BlindOptions(small.scale, kinds=small.kinds).chosen(1)}
    assert groups == {"null", "single", "pair", "outside"}


def test_intervals_of_an_exact_answer_are_held_against_the_truth():
    truth = {
        "name": "rig_000", "group": "single", "kind": "load_dependent_friction", "strength": "middle",
        "effects": ["load_dependent_friction"], "pendulum": None, "causes": {"load_dependent_friction": {"mu": 0.1}},
        "joint": {
            "drive": "current", "gain": 0.5, "servo_damping": 1.0, "viscous": 2.0, "coulomb": 4.0, "breakaway": 0.01,
            "rotor_inertia": 0.3, "link_inertia": 1.0, "gravity": 0.0, "heat_capacity": 1.0, "ambient": 20.0,
            "bandwidth": 1.0,
        },
    }  # fmt: skip
    final = {"drive": {"gain": [0.4, 0.6]}, "viscous": {"viscous": [2.9, 3.1]}, "coulomb": {"coulomb": [4.1, 4.3]}}
    report = {
        "final_parameters": {
            "joint": {key: {name: {"ci95": ci} for name, ci in group.items()} for key, group in final.items()}
        },
        "joints": {
            "joint": {
                "effects": [{"id": "load_dependent_friction", "parameters": {"load_friction": {"ci95": [0.09, 0.12]}}}]
            }
        },
    }
    assert gate_parts.blind_intervals(truth, report) == [
        ("declared gain", True),
        ("declared viscous", True),
        ("declared coulomb", False),
        ("effects", True),
    ]


@pytest.mark.parametrize(("right", "of", "met"), [(20, 20, None), (95, 100, True), (91, 100, False), (99, 100, False)])
def test_too_few_intervals_are_reported_and_not_judged(right, of, met):
    assert gate_parts.interval_row("x", [True] * right + [False] * (of - right)).met is met


@dataclass(frozen=True)
class Drawn:
    """What a part of the gate reads of `GateRuns`."""

    size: str = "small"
    seed: int = 3


@pytest.fixture
def one_part(monkeypatch):
    """A gate whose only part is one row."""
    monkeypatch.setattr(
        gate, "PARTS", {"blind": lambda runs: [BenchmarkRow.share("exact", [True, False], "min", 0.98)]}
    )


def test_results_join_the_file_and_stand_beside_those_of_the_same_size_and_seed(one_part, tmp_path):
    path = tmp_path / "gate.json"
    part = gate.run_part("blind", Drawn())
    assert (part["seed"], part["size"], len(part["commit"].removesuffix("+changes"))) == (3, "small", 40)
    gate.store_results(path, {"blind": part | {"rows": []}, "time": part})
    gate.store_results(path, {"blind": part})
    found = gate.load_results(path)
    assert found == {"blind": part, "time": part}
    new = ("blind: exact", ">= 98", "50.0 % of 2", "NO")
    assert gate.table(found, found) == [(*new, "50.0 % of 2", "NO")]
    assert gate.table(found, {"blind": part | {"seed": 4}}) == gate.table(found, {}) == [(*new, "-", "")]


def test_the_stored_results_are_of_parts_of_the_gate():
    stored = gate.load_results(gate.STORED)
    assert stored and set(stored) <= set(gate.PARTS)
    assert all(part["rows"] and part["size"] in gate_parts.SIZES for part in stored.values())
    assert len(gate.table(stored, {})) == sum(len(part["rows"]) for part in stored.values())


def test_the_command_prints_rows_and_stores_them(one_part, tmp_path, capsys):
    path = tmp_path / "gate.json"
    assert run(["gate", "--part", "blind", "--json", "--jobs", "1", "--store", str(path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["name"] == "gate" and [row["name"] for row in told["rows"]] == ["blind/exact"]
    assert gate.load_results(path)["blind"]["rows"][0]["median"] == 0.5


def test_a_slip_is_one_line(capsys, tmp_path):
    with pytest.raises(ParamsError, match="no part 'blnd' of the gate"):
        gate.chosen_parts(["blnd"])
    assert run(["gate", "--size", "middle"]) == 2
    assert "expected small or full, got 'middle'" in capsys.readouterr().err
    bad = Path(tmp_path / "bad.json")
    bad.write_text("[]", encoding="utf-8")
    with pytest.raises(ParamsError, match="expected results of the gate"):
        gate.load_results(bad)
