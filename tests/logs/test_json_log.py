"""JSON logs in each form give the same table as CSV; what cannot be read is refused with the place."""

import gzip
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table, run_name
from drake_tc.logs.prepare import load_run

from .conftest import bench, servo_rig, unreadable, write

TIME = [0.0, 0.01, 0.02]
POSITION = [0.1, 0.25, 0.3]


def _write(path, document):
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return path


FORMS = {
    "columns": {"time": TIME, "knee/position": POSITION, "rate": 100.0, "name": "run"},
    "nested columns": {"time": TIME, "knee": {"position": POSITION}},
    "records": [{"time": t, "knee/position": q} for t, q in zip(TIME, POSITION, strict=True)],
    "nested records": [{"time": t, "knee": {"position": q}} for t, q in zip(TIME, POSITION, strict=True)],
    "records under a key": {
        "mass": 0.5,
        "entries": [{"time": t, "knee/position": q} for t, q in zip(TIME, POSITION, strict=True)],
    },
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_columns(tmp_path, form):
    table = read_table(_write(tmp_path / "run.json", FORMS[form]))
    assert list(table.columns) == ["time", "knee/position"]
    assert_allclose(table["time"], TIME, rtol=0)
    assert_allclose(table["knee/position"], POSITION, rtol=0)


def test_one_record_a_line_and_compressed(tmp_path):
    lines = "\n".join(json.dumps(record) for record in FORMS["records"])
    _write(tmp_path / "run.jsonl", lines + "\n\n")
    (tmp_path / "run.json.gz").write_bytes(gzip.compress(json.dumps(FORMS["columns"]).encode()))
    for name in ("run.jsonl", "run.json.gz"):
        assert_allclose(read_table(tmp_path / name)["knee/position"], POSITION, rtol=0)
        assert run_name(tmp_path / name) == "run"


def test_vectors_become_numbered_columns_in_both_forms(tmp_path):
    columns = read_table(_write(tmp_path / "a.json", {"time": [0, 1], "q": [[1, 2], [3, 4]]}))
    records = read_table(_write(tmp_path / "b.json", [{"time": 0, "q": [1, 2]}, {"time": 1, "q": [3, 4]}]))
    for table in (columns, records):
        assert_allclose(table[["q_0", "q_1"]].to_numpy(float), [[1, 2], [3, 4]], rtol=0)


def test_null_and_absent_values_are_missing(tmp_path):
    table = read_table(_write(tmp_path / "run.json", [{"time": 0, "q": 1.5}, {"time": 1}, {"time": 2, "q": None}]))
    assert_allclose(table["q"], [1.5, np.nan, np.nan])


def test_a_run_from_json_is_the_run_from_csv(tmp_path):
    table = bench(2.0)
    records = table.to_dict(orient="records")
    csv = load_run(write(table, tmp_path / "run.csv"), servo_rig())
    json_run = load_run(_write(tmp_path / "run.json", records), servo_rig())
    assert set(csv.columns) == set(json_run.columns)
    for name, values in csv.columns.items():  # both print the shortest decimal that is the same double
        assert_allclose(json_run.columns[name], values, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("cut.json", '{"time": [0, 1],\n "q": [1, ', "not valid JSON at line 2, column 11"),
        ("cut.jsonl", '{"time": 0}\n{"time": 1\n{"time": 2}', "not valid JSON at line 2"),
        ("text.json", '"hello"', "expected a mapping of columns {name: [values]}, or a list of records"),
        ("scalars.json", '{"mass": 1, "length": 2}', "got a mapping without a list: mass, length"),
        ("numbers.json", "[1, 2, 3]", "row 1 is the value 1; expected a mapping"),
        ("odd.json", '[{"time": 0}, [1, 2]]', "row 2 is a list of 2 values"),
        ("short.json", '{"time": [0, 1, 2], "q": [1, 2]}', "column 'q' has 2 rows where the others have 3"),
        ("ragged.json", '{"time": [0, 1], "q": [[1, 2], [3]]}', "column 'q': row 2 holds a list of 1 values"),
        ("mixed.json", '{"time": [0, 1], "q": [1, {"a": 2}]}', "column 'q': row 2 holds a mapping; expected one value"),
        ("twice.json", '{"time": [0, 1], "q": [1, 2], "q": [3, 4]}', "'q' stands more than once in one mapping"),
        ("empty.json", "", "no rows"),
        ("none.json", "[]", "no rows"),
        ("bytes.json.gz", "not gzip", "cannot be read as .json.gz"),
    ],
)
def test_refusals_name_the_place(tmp_path, name, text, said):
    assert said in unreadable(_write(tmp_path / name, text))


def test_a_text_in_a_column_names_its_row(tmp_path):
    records = bench(1.0).to_dict(orient="records")
    records[6]["joint/torque"] = "overload"
    with pytest.raises(LogError, match=r"'joint/torque'.*row 7 holds 'overload'"):
        load_run(_write(tmp_path / "run.json", records), servo_rig())


@pytest.mark.parametrize(
    ("beside", "own"),
    [({"config": {"action_hz": 50}}, {}), ({"dt": 0.02}, {}), ({}, {"meta": {"hz": 50}}), ({}, {"t": "times"})],
)
def test_episodes_of_columns(tmp_path, beside, own):
    """Their rate stands beside them or in each, or each has its times."""
    time = np.arange(60) / 50.0
    clock = "t" if "t" in own else "time"
    own = {"t": time.tolist()} if "t" in own else own
    runs = [{"kind": "chirp", "q": (k + np.sin(time)).tolist(), "u": np.cos(time).tolist(), **own} for k in range(3)]
    path = _write(tmp_path / "run.json", beside | {"data": runs})
    table = read_table(path)
    assert len(table) == 180 and np.sum(np.diff(table[clock]) > 0.5) == 2
    second = read_table(tmp_path / "run.json#1")
    assert_allclose(second["q"], 1.0 + np.sin(time), rtol=0)
    assert_allclose(second[clock], time, rtol=0, atol=1e-12)
    with pytest.raises(LogError, match="no episode 7; episodes here: 0 to 2"):
        read_table(tmp_path / "run.json#7")


def test_a_rate_beside_columns_gives_the_times(tmp_path):
    table = read_table(_write(tmp_path / "run.json", {"sample_rate": 200, "q": [0.0, 0.1, 0.2]}))
    assert_allclose(table["time"], [0.0, 0.005, 0.01], rtol=1e-12)
    np.savez(tmp_path / "run.npz", q=np.zeros((30, 2)), dt=0.01)
    assert_allclose(np.diff(read_table(tmp_path / "run.npz")["time"]), 0.01, rtol=1e-9)


def test_episodes_without_times_are_refused(tmp_path):
    with pytest.raises(LogError, match=r'2 episodes without times; expected .* such as "hz": 100'):
        read_table(_write(tmp_path / "run.json", [{"q": list(range(30))}, {"q": list(range(30))}]))


def test_episodes_with_names_are_no_joints(tmp_path):
    episodes = [{"name": name, "actions": [0.1] * 50, "sensor_data": [0.2] * 50} for name in ("chirp", "sine")]
    table = read_table(_write(tmp_path / "a.json", {"hz": 50, "runs": episodes}))
    assert list(table.columns) == ["time", "actions", "sensor_data"] and len(table) == 100


def test_tables_as_pandas_writes_them_and_lines_without_their_ending(tmp_path):
    own = bench(0.1)
    for number, form in enumerate(("columns", "index", "split", "records")):
        path = tmp_path / f"{number}.json"
        own.to_json(path, orient=form, double_precision=15, lines=form == "records")
        assert_allclose(read_table(path)[list(own)], own, rtol=1e-12, atol=1e-12)


def test_a_matrix_may_have_a_row_for_each_joint(tmp_path):
    q = np.stack([np.arange(40.0), -np.arange(40.0)])
    table = read_table(_write(tmp_path / "run.json", {"time": list(range(40)), "q": q.tolist()}))
    assert_allclose(table[["q_0", "q_1"]], q.T)


def test_a_last_line_that_is_cut_off_is_left_out(tmp_path):
    bench(0.1).to_json(tmp_path / "run.jsonl", orient="records", lines=True)
    (tmp_path / "run.jsonl").write_text((tmp_path / "run.jsonl").read_text()[:-9])
    table = read_table(tmp_path / "run.jsonl")
    assert len(table) == len(bench(0.1)) - 1 and table.attrs["notes"] == ["The last line is cut off and was left out."]
