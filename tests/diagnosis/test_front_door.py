"""`drake_tc.close_loop` as a notebook calls it: rigs and logs of any kind, and a result that shows itself."""

import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import drake_tc
from drake_tc.cli.close_loop_command import print_summary
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.models import models_of
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.effects.library import effect
from drake_tc.errors import DrakeTcError

from .rigs import Joint, record

JOINT = Joint(duration=8.0, period=4e-3, torque_noise=0.25, extra=lambda m: 1.2 * m.v * np.abs(m.v))
RIG = {"joint": "joint", "drive": "current", "load": "torque", "declared": {"rotor_inertia": 0.3}}
QUICK = DiagnosisOptions(assess_residual=False, effects=(effect("quadratic_viscous"),))


def table_of(name: str, shift: float, seed: int) -> pd.DataFrame:
    run = record(JOINT, name, shift, seed)
    return pd.DataFrame({"time": run.time, **run.columns})


@pytest.fixture(scope="module")
def tables() -> list[pd.DataFrame]:
    """Two runs to fit and two that are held out."""
    return [table_of(f"run{seed}", shift, seed) for seed, shift in enumerate((0.0, 0.9, 2.3, 3.1))]


@pytest.fixture(scope="module")
def result(tables) -> CloseLoopResult:
    return drake_tc.close_loop(RIG, tables[:2], holdout=tables[2:], options=QUICK)


def numbers(result: CloseLoopResult) -> list[float]:
    return [value for row in result.intervals[["value", "low", "high"]].to_numpy() for value in row]


def test_files_and_tables_give_the_same(tables, result, tmp_path):
    paths = [tmp_path / f"{name}.parquet" for name in "abcd"]
    for table, path in zip(tables, paths, strict=True):
        table.to_parquet(path, index=False)
    rig = tmp_path / "rig.yaml"
    rig.write_text("{joint: joint, drive: current, load: torque, declared: {rotor_inertia: 0.3}}")
    mixed = drake_tc.close_loop(str(rig), [paths[0], tables[1]], holdout=[paths[2], str(paths[3])], options=QUICK)
    assert numbers(mixed) == numbers(result)
    assert (mixed.train_files, mixed.rig_file) == ((str(paths[0]), "log 2"), str(rig))
    assert (result.train_files, result.heldout_files) == (("log 1", "log 2"), ("held-out 1", "held-out 2"))
    assert result["joint"].heldout.samples.runs != mixed["joint"].heldout.samples.runs


def test_a_table_stays_as_it_was_and_its_index_counts_for_nothing(tables, result):
    own = [table.set_index(table.index[::-1] * 7) for table in tables]
    own[0].columns = [f" {name}" for name in own[0].columns]
    own[0].attrs["units"] = {" joint/position": "deg"}
    copies = [table.copy() for table in own]
    assert numbers(drake_tc.close_loop(RIG, own[:2], holdout=own[2:], options=QUICK)) == numbers(result)
    for table, copy in zip(own, copies, strict=True):
        pd.testing.assert_frame_equal(table, copy)
        assert table.attrs == copy.attrs


@pytest.mark.parametrize("changed", [{"joint/temprature": 20.0}, {"joint/position": 2.0}])
def test_a_table_gets_the_notes_and_hints_of_a_csv_file(tables, changed, tmp_path):
    rig = drake_tc.load_rig(write_rig(tmp_path, "units: {joint/position: deg}"))
    table = tables[0].assign(**{"joint/position": np.degrees(tables[0]["joint/position"])})
    table = table.assign(**changed)
    table.loc[100:103, "joint/torque"] = np.nan
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)

    def read(log: Path | pd.DataFrame) -> object:
        try:
            run = drake_tc.load_run(log, rig)
        except DrakeTcError as error:
            return re.sub(r" \(file line \d+\)", "", str(error)).replace(str(path), "log 1")
        return run.notes, run.hints, {name: np.round(values, 9).tolist() for name, values in run.columns.items()}

    assert read(table) == read(path)


def write_rig(folder: Path, more: str = "") -> Path:
    path = folder / "rig.yaml"
    path.write_text(f"joint: joint\ndrive: current\nload: torque\n{more}\n")
    return path


@pytest.mark.parametrize(
    ("rig", "logs", "message"),
    [
        (3, "tables", r"^rig: expected a path .* or a Rig, got a int$"),
        ({"joint": "joint"}, "tables", "^rig: drive is missing"),
        (RIG, "run.csv", r"^log: expected a list, each entry a path .* got a str \('run.csv'\)$"),
        (RIG, "table", r"^log: expected a list, each entry .*, got a DataFrame$"),
        (RIG, [np.zeros(3)], r"^log 1: expected a path \(str or Path\) or a DataFrame, got a ndarray$"),
        (RIG, [pd.DataFrame({"time": []})], "^log 1: no rows"),
        (RIG, [pd.DataFrame([[0.0, 1.0]], columns=["time", "time"])], "^log 1: column 'time' stands more than once"),
        (RIG, [pd.DataFrame({"t": [0.0, 0.1]})], "^log 1: no column 'time'"),
        (RIG, "twice", "^held-out 1: it holds the same samples as log 1"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(tables, rig, logs, message):
    given = {"tables": tables[:1], "table": tables[0], "twice": [tables[2]]}
    with pytest.raises(DrakeTcError, match=message) as caught:
        drake_tc.close_loop(rig, given.get(logs, logs) if isinstance(logs, str) else logs, holdout=tables[2:3])
    assert "\n" not in str(caught.value)


def test_a_held_out_run_of_another_type_is_called_so(tables):
    with pytest.raises(DrakeTcError, match=r"^held-out 1: expected a path .* got a NoneType$"):
        drake_tc.close_loop(RIG, tables[:1], holdout=[None])


def test_it_shows_what_the_command_prints(result, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "110")
    print_summary(result, tmp_path)
    printed = capsys.readouterr().out.splitlines()[:-1]
    verdict, *shown = repr(result).splitlines()
    assert verdict == f"verdict: Missing effect found ({result.verdict})"
    assert [line.rstrip() for line in shown] == [line.rstrip() for line in printed]
    assert repr(result["joint"]).splitlines() == shown


def test_it_shows_effects_with_intervals_errors_and_noise_floors(result):
    joint = result["joint"]
    value = joint.effects[0].parameters["quadratic_viscous"]
    low, high = value.ci95
    shown = repr(result)
    assert f"quadratic_viscous {value.value:.4g} [{low:.4g}, {high:.4g}] N·m·s²/rad²" in shown
    table = {line.split("  ")[1]: line.split() for line in shown.splitlines() if line.startswith("  ")}
    assert (
        f"{joint.before.heldout:.3g}" in table["RMS error before"]
        and f"{joint.after.heldout:.3g}" in table["RMS error after"]
    )
    assert f"{joint.after.heldout / joint.noise_floor:.3g}" in table["after / noise floor"]


def test_colours_of_a_terminal_do_not_reach_the_text(result, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert "\x1b" not in repr(result)


def test_an_unknown_joint_is_refused_with_those_that_there_are(result):
    both = replace(result, joints={"knee": result["joint"], "hip": result["joint"]})
    with pytest.raises(DrakeTcError, match=r"^no joint 'ankle'; joints here: knee, hip$"):
        both["ankle"]


def test_a_notebook_shows_the_words_and_the_residual(result):
    hostile = replace(result["joint"], joint='<b>"&')
    html = replace(result, joints={'<b>"&': hostile})._repr_html_()
    assert "<b>" not in html and html.count("<img ") == 1 and "data:image/png;base64," in html
    words = re.sub(r"<[^>]*>", "", html)
    assert "held-out gain" in words and "quadratic_viscous" in words
    assert hostile._repr_html_().count("<img ") == 1


def test_the_plot_has_both_residuals_of_the_held_out_runs(result):
    joint = result["joint"]
    figure = joint.plot_residual()
    top, bottom = figure.axes
    assert [line.get_label() for line in top.get_lines()[:3]] == ["measured", "model before", "model after"]
    before, after = (line.get_ydata() for line in bottom.get_lines()[:2])
    scale = np.nanmax(np.abs(before)) / np.max(np.abs(joint.heldout.before))
    assert_allclose(np.nanmax(np.abs(after)), scale * np.max(np.abs(joint.heldout.after)), rtol=1e-9)  # extremes stay
    assert f"[{'mA' if scale == pytest.approx(1e3) else 'A'}]" in bottom.get_ylabel()
    time = bottom.get_lines()[0].get_xdata()
    assert np.all(np.diff(time) >= 0.0)
    assert time[-1] > 1.9 * JOINT.duration * 0.9  # two runs, end to end
    assert "end to end" in bottom.get_xlabel()
    data, size = figure._repr_png_()
    assert data.startswith(b"\x89PNG") and size["width"] < 1000


def test_the_intervals_are_those_of_the_model(result):
    table = result["joint"].intervals
    assert list(table.columns) == ["effect", "parameter", "value", "low", "high", "unit"]
    row = table.set_index("parameter").loc["quadratic_viscous"]
    assert row["low"] < 1.2 < row["high"] and row["unit"] == "N*m*s^2/rad^2"
    assert result.intervals["joint"].unique().tolist() == ["joint"]
    assert_allclose(table[["low", "value", "high"]].diff(axis=1).to_numpy()[:, 1:] >= 0.0, True)


def test_the_models_are_those_of_the_files(result, tmp_path):
    models_of(result, tmp_path)
    for name, model in (("model_before", result["joint"].model_before), ("model_after", result.models["joint"])):
        written = drake_tc.load_models(tmp_path / f"{name}.yaml")["joint"]
        assert [e.key for e in written.effects] == [e.key for e in model.effects]
        assert_allclose(written.drive.gain, model.drive.gain, rtol=1e-5)  # files have six digits
        for one, other in zip(written.effects, model.effects, strict=True):
            assert_allclose([*one.parameters.values()], [*other.parameters.values()], rtol=1e-5)
    assert result["joint"].model == result.models["joint"]


def test_a_result_can_be_sent_to_another_process(result):
    assert repr(pickle.loads(pickle.dumps(result))) == repr(result)


def test_looking_at_nothing_loads_no_plots():
    code = "import sys, drake_tc; drake_tc.close_loop; print([n for n in ('matplotlib', 'rich') if n in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
