"""Every format gives back the numbers that another library wrote; what cannot be read is refused in one line."""

import gzip

import numpy as np
import pandas as pd
import pytest
import scipy.io
from numpy.testing import assert_allclose

from drake_tc.logs.files.readers import read_table, run_name

from .conftest import unreadable

VALUES = {"time": np.arange(40) * 0.01, "joint/position": np.sin(np.arange(40.0))}


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".parquet", ".feather", ".npz", ".mat"])
def test_every_format_gives_the_same_numbers(tmp_path, ending):
    path = tmp_path / f"run{ending}"
    frame = pd.DataFrame(VALUES)
    if ending.startswith(".csv"):
        frame.to_csv(path, index=False)
    elif ending == ".parquet":
        frame.to_parquet(path)
    elif ending == ".feather":
        frame.to_feather(path)
    elif ending == ".npz":
        np.savez(path, **VALUES)
    else:
        scipy.io.savemat(path, {"time": VALUES["time"], "joint__position": VALUES["joint/position"], "rate": 100.0})
    table = read_table(path)
    assert list(table.columns) == list(VALUES)
    for name, values in VALUES.items():  # text keeps 17 digits, binary all of them
        assert_allclose(table[name], values, rtol=1e-15, atol=1e-15)
    assert run_name(path) == "run"


def test_matlab_struct_fields_become_columns(tmp_path):
    scipy.io.savemat(tmp_path / "run.mat", {"time": VALUES["time"], "joint": {"position": VALUES["joint/position"]}})
    assert_allclose(read_table(tmp_path / "run.mat")["joint/position"], VALUES["joint/position"], rtol=0)


def test_npz_matrix_gives_numbered_columns(tmp_path):
    np.savez(tmp_path / "run.npz", time=np.arange(30.0), q=np.arange(60.0).reshape(30, 2))
    assert_allclose(read_table(tmp_path / "run.npz")["q_1"], np.arange(1.0, 60.0, 2.0), rtol=0)


@pytest.mark.parametrize("text", ["a;b\n1;2\n3;4\n", "a, b\n1, 2\n3, 4\n", "a\tb\n1\t2\n3\t4\n", "a,b\n1,2,0\n3,4,0\n"])
def test_other_separators_spaces_and_surplus_values(tmp_path, text):
    (tmp_path / "run.csv").write_text(text)
    table = read_table(tmp_path / "run.csv")
    assert list(table.columns) == ["a", "b"]
    assert_allclose(table.to_numpy(dtype=float), [[1, 2], [3, 4]], rtol=0)


def test_refusals_name_the_file_and_what_is_possible(tmp_path):
    assert "no such log file" in unreadable(tmp_path / "absent.csv")
    assert "no such log file" in unreadable(tmp_path / ("x" * 5000 + ".csv"))
    (tmp_path / "run.docx").write_text("x")
    assert ".parquet" in unreadable(tmp_path / "run.docx")


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("run.parquet", b"not parquet", "cannot be read"),
        ("run.npz", b"zip?", "cannot be read"),
        ("run.mat", b"MATLAB?" * 30, "cannot be read"),
        ("cut.csv.gz", gzip.compress(b"time,q\n" + b"1,2\n" * 5000, mtime=0)[:30], "cannot be read"),
        ("empty.csv", b"", "no rows"),
        ("header.csv", b"time,joint/position\n", "no rows"),
        ("twice.csv", b"time,q,q\n" + b"1,2,3\n" * 30, "column 'q' stands more than once"),
        ("twice.csv.gz", gzip.compress(b"time,q ,q\n" + b"1,2,3\n" * 30, mtime=0), "column 'q' stands more than once"),
        ("echo.csv", b"17,0,hip,0.25\n18,0,hip,0.26\n", "names of the columns in line 1, got numbers ('0.25' first)"),
        ("run.h5", b"", "unknown kind of log file (.h5); write its columns as CSV or its arrays with numpy.savez"),
        ("first.csv", b"0.0,0.0,1e-3\n0.1,0.2,0.3\n", "names of the columns in line 1, got numbers ('0.0' first)"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    assert says in unreadable(tmp_path / name)


@pytest.mark.parametrize("mark", ["utf-16-le", "utf-16-be"])
def test_csv_in_utf_16_with_its_mark(tmp_path, mark):
    text = "\ufefftime [s]\tWinkel [°]\n" + "1\t2\n" * 30
    (tmp_path / "run.csv").write_bytes(text.encode(mark))
    assert list(read_table(tmp_path / "run.csv").columns) == ["time [s]", "Winkel [°]"]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32"])
def test_csv_in_another_encoding_is_refused(tmp_path, encoding):
    (tmp_path / "run.csv").write_bytes(("time,q\n" + "1,2\n" * 30).encode(encoding))
    assert "expected text in UTF-8" in unreadable(tmp_path / "run.csv")


def test_texts_beside_the_samples_are_left_out(tmp_path):
    np.savez(tmp_path / "run.npz", t=np.arange(30.0), q=np.zeros((30, 2)), labels=np.array(["hip", "knee"]))
    table = read_table(tmp_path / "run.npz")
    assert list(table.columns) == ["t", "q_0", "q_1"]
    assert "The texts 'labels' are no columns" in table.attrs["notes"][0]


def test_arrays_of_different_length_are_refused(tmp_path):
    np.savez(tmp_path / "run.npz", time=np.arange(30.0), q=np.arange(29.0))
    assert "'q' has 29 rows" in unreadable(tmp_path / "run.npz")


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_beside_a_separator_that_is_no_comma(tmp_path, separator):
    """pandas writes them; a cell that is missing stays missing, and a column of whole numbers is none of them."""
    frame = pd.DataFrame(VALUES | {"count": np.arange(40), "gap": [np.nan, *np.linspace(-1e-7, 2.5, 39)]})
    frame.to_csv(tmp_path / "run.csv", index=False, sep=separator, decimal=",")
    table = read_table(tmp_path / "run.csv")
    for name in frame:
        assert_allclose(table[name], frame[name], rtol=1e-15, atol=1e-15)
    (note,) = table.attrs["notes"]
    assert "'time', 'joint/position', 'gap' were read with a decimal comma" in note


@pytest.mark.parametrize(
    ("separator", "texts", "numbers"),
    [
        (";", ["-1.234,5", "2,5", "nan"], [-1234.5, 2.5, np.nan]),
        (",", ['"1,234.5"', "2.5", "-nan(ind)"], [1234.5, 2.5, np.nan]),
        (",", ['"1,234,567"', '"1,234"', "12"], [1234567.0, 1234.0, 12.0]),
    ],
)
def test_separators_of_thousands(tmp_path, separator, texts, numbers):
    """A text with both marks, or with one twice, tells which of them is which for its column."""
    rows = "".join(f"{k}{separator}{text}\n" for k, text in enumerate(texts))
    (tmp_path / "run.csv").write_text(f"time{separator}a\n{rows}")
    table = read_table(tmp_path / "run.csv")
    assert_allclose(table["a"], numbers)
    assert table.attrs["notes"] == ["The numbers of 'a' were read with thousands separators."]


@pytest.mark.parametrize("texts", [["1.234,5", "2,5.1"], ["1,2", "two"], ["1,2,3", "1,2"]])
def test_texts_that_may_mean_something_else_stay_texts(tmp_path, texts):
    (tmp_path / "run.csv").write_text("time;a\n" + "".join(f"{k};{text}\n" for k, text in enumerate(texts)))
    table = read_table(tmp_path / "run.csv")
    assert table["a"].tolist() == texts and "notes" not in table.attrs


def test_vectors_in_cells_as_numpy_prints_them_and_with_missing_rows(tmp_path):
    cells = [str([np.float64(k), np.float64(-k)]) for k in range(40)]
    pd.DataFrame({"time": np.arange(40.0), "q": ["None", *cells[1:3], "", *cells[4:]]}).to_csv(tmp_path / "run.csv")
    table = read_table(tmp_path / "run.csv")
    assert np.flatnonzero(table["q_1"].isna()).tolist() == [0, 3] and table["q_1"].iloc[7] == -7.0


def test_a_file_of_python_objects_says_so(tmp_path):
    np.savez(tmp_path / "run.npz", data={"q": [1.0, 2.0]})  # type: ignore[arg-type]
    assert "no rows (What cannot be read (Python objects) was left out: data.)" in unreadable(tmp_path / "run.npz")
