"""Files that are damaged, packed to burst, or of another kind: one line, whatever they hold; and never the process."""

import gzip
import io
import sys
import time
import zipfile

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.testing import assert_array_equal

from drake_tc.errors import LogError
from drake_tc.logs.files.array_files import read_mat
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.prepare import load_run

from .conftest import bench, servo_rig, unreadable

ROWS = 40
COLUMNS = {"time": 0.01 * np.arange(ROWS), "joint__position": np.sin(np.arange(ROWS))}


def mat(**options) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, COLUMNS, **options)
    return buffer.getvalue()


NUMBERS = st.sampled_from(["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "c16", "bool"])


@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), compressed=st.booleans())
def test_a_matlab_file_reads_as_scipy_reads_it(tmp_path, data, compressed):
    dtype = np.dtype(data.draw(NUMBERS))
    values = data.draw(arrays.arrays(dtype, arrays.array_shapes(min_dims=2, max_dims=3, min_side=0, max_side=5)))
    path = tmp_path / "x.mat"
    content = {"a": values, "inner": {"b": values, "c": {"d": values[..., :1]}}, "text": "no number"}
    scipy.io.savemat(path, content, do_compression=compressed)
    ours, theirs = read_mat(path), scipy.io.loadmat(path)
    assert_array_equal(ours["a"], theirs["a"])
    assert_array_equal(ours["inner/b"], theirs["inner"]["b"].item())
    assert_array_equal(ours["inner/c/d"], theirs["inner"]["c"].item()["d"].item())
    assert ours["text"].tolist() == ["no number"]
    assert set(ours) == {"a", "inner/b", "inner/c/d", "text"}


@pytest.mark.parametrize("dtype", ["f4", "i2", "c16"])
def test_a_matlab_file_of_version_4(tmp_path, dtype):
    values = np.arange(12).reshape(3, 4).astype(dtype)
    scipy.io.savemat(tmp_path / "x.mat", {"a": values, "b": values.T}, format="4")
    ours = read_mat(tmp_path / "x.mat")
    assert_array_equal(ours["a"], values)
    assert_array_equal(ours["b"], values.T)


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}])
def test_a_matlab_file_with_any_byte_changed_or_cut_is_read_or_refused(tmp_path, options):
    """SciPy ends the process in which it reads some of these."""
    sound, path, rng = mat(**options), tmp_path / "x.mat", np.random.default_rng(0)
    refused = 0
    for number in range(3):
        content = bytearray(sound)
        if number % 3 == 0:
            content = content[: rng.integers(len(sound))]
        for place in rng.integers(len(content), size=rng.choice([1, 4])) if content else ():
            content[place] = rng.integers(256)
        path.write_bytes(content)
        try:
            read_table(path)
        except LogError as error:
            refused += 1
            assert str(error).startswith(str(path))
    assert refused >= 1


def test_a_matlab_file_on_which_scipy_ends_the_process_is_refused(tmp_path, monkeypatch):
    """The reader is killed, whatever the file holds."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys, os, signal\nif 'drake_tc.logs.files.array_files' in str(sys.orig_argv):\n"
        "    os.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    monkeypatch.setattr("sys.path", [str(tmp_path), *sys.path])
    (tmp_path / "x.mat").write_bytes(mat())
    assert "it is damaged" in unreadable(tmp_path / "x.mat")


def test_variables_and_fields_have_any_name(tmp_path):
    scipy.io.savemat(tmp_path / "x.mat", {"file": np.arange(3.0), "self": {"args": np.arange(2.0)}})
    assert set(read_mat(tmp_path / "x.mat")) == {"file", "self/args"}


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0 MAT-file", b"\0" * 127, b"\x89HDF\r\n\x1a\n" + b"\0" * 600])
def test_no_matlab_file(tmp_path, content):
    (tmp_path / "x.mat").write_bytes(content)
    unreadable(tmp_path / "x.mat")


def packed(text: bytes = b"time,q\n" + b"1,2\n" * 5000) -> bytes:
    return gzip.compress(text, mtime=0)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (packed()[:-30], "cut"),
        (packed()[:40] + b"\xff" * 8 + packed()[48:], "cannot be read as .csv.gz"),
        (b"time,q\n1,2\n", "cannot be read as .csv.gz"),
        (b"", "no rows"),
        (gzip.compress(b"\0" * 2**27), "would unpack to"),
        (gzip.compress(b"time,q\n" + b"1,2\n" * 2**25), "would unpack to"),
    ],
)
def test_a_packed_csv_that_is_damaged_or_a_bomb(tmp_path, content, says):
    (tmp_path / "run.csv.gz").write_bytes(content)
    begin = time.process_time()
    assert says in unreadable(tmp_path / "run.csv.gz")
    assert time.process_time() - begin < 5.0


def zeros_of_matlab(path):
    scipy.io.savemat(path, {"time": np.zeros(2**24)}, do_compression=True)


def zeros_of_parquet(path):
    pd.DataFrame({"time": np.zeros(2**24)}).to_parquet(path)


def zeros_of_feather(path):
    pd.DataFrame({"time": np.zeros(2**24)}).to_feather(path, compression="zstd")


def texts_that_are_not_utf8(path):
    places = pa.py_buffer(np.array([0, 1, 2], np.int32).tobytes())
    texts = pa.Array.from_buffers(pa.string(), 2, [None, places, pa.py_buffer(b"a\xff")])
    pq.write_table(pa.table({"time": [0.0, 1.0], "joint": texts}), path)


@pytest.mark.parametrize(
    ("name", "make", "says"),
    [
        ("run.json.gz", lambda path: path.write_bytes(packed(b"[" + b" " * 2**27 + b"]")), "would unpack to"),
        ("run.mat", zeros_of_matlab, "would unpack to"),
        ("run.parquet", zeros_of_parquet, "would unpack to"),
        ("run.feather", zeros_of_feather, "would unpack to"),
        ("run.parquet", texts_that_are_not_utf8, "cannot be read"),
    ],
)
def test_other_bombs_and_texts(tmp_path, name, make, says):
    make(tmp_path / name)
    assert says in unreadable(tmp_path / name)


def test_a_gzip_file_of_several_members_is_read_whole(tmp_path):
    (tmp_path / "run.csv.gz").write_bytes(packed(b"time,q\n1,2\n") + packed(b"2,3\n") + b"\0" * 512)
    assert len(read_table(tmp_path / "run.csv.gz")) == 2


def npz(path, **members: bytes) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)


def npy(values) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=True)
    return buffer.getvalue()


def huge_header() -> bytes:
    """An array of 8 TB by its header, of 8 bytes in fact."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    return buffer.getvalue() + b"\0" * 8


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"time, q", "is no array"),
        (npy(np.arange(9.0))[:-8], "expected 72 bytes got 64"),
        (huge_header(), "is no array"),
        (npy(np.zeros(2**24)), "would unpack to"),
    ],
)
def test_an_npz_file_with_an_odd_member(tmp_path, content, says):
    npz(tmp_path / "run.npz", time=npy(np.arange(9.0)), q=content)
    assert says in unreadable(tmp_path / "run.npz")


def test_python_objects_are_told_and_never_unpacked(tmp_path):
    objects = npy(np.array([{}, None], dtype=object))
    npz(tmp_path / "run.npz", time=npy(np.arange(9.0)), about=objects)
    table = read_table(tmp_path / "run.npz")
    assert list(table.columns) == ["time"]
    assert "What cannot be read (Python objects) was left out: about." in table.attrs["notes"]
    (tmp_path / "run.npy").write_bytes(objects)
    assert "Python objects, which are not unpacked" in unreadable(tmp_path / "run.npy")


def test_an_encrypted_npz_file(tmp_path):
    npz(tmp_path / "run.npz", time=npy(np.arange(9.0)))
    content = bytearray((tmp_path / "run.npz").read_bytes())
    content[6] |= 1  # the flag of the member, there and in the directory
    content[content.index(b"PK\x01\x02") + 8] |= 1
    (tmp_path / "run.npz").write_bytes(content)
    assert "encrypted" in unreadable(tmp_path / "run.npz")


@pytest.mark.parametrize("cut", [0.3, 0.9])
def test_a_cut_npz_file(tmp_path, cut):
    np.savez(tmp_path / "run.npz", **COLUMNS)
    content = (tmp_path / "run.npz").read_bytes()
    (tmp_path / "run.npz").write_bytes(content[: round(cut * len(content))])
    assert "cannot be read as .npz" in unreadable(tmp_path / "run.npz")


def test_cells_that_are_not_utf8_name_their_row(tmp_path):
    table = bench(1.0)
    text = table.to_csv(index=False).splitlines()
    text[7] = text[7].replace(text[7].split(",")[-2], "dr\xf6hnt")
    (tmp_path / "run.csv").write_bytes("\n".join(text).encode("latin-1"))
    with pytest.raises(LogError, match=r"'joint/torque' .* is not numeric: row 7 \(file line 8\) holds 'dr.hnt'"):
        load_run(tmp_path / "run.csv", servo_rig())


def test_a_folder_and_a_file_that_cannot_be_opened(tmp_path, monkeypatch):
    (tmp_path / "run.csv").mkdir()
    assert unreadable(tmp_path / "run.csv").endswith("(with meta/info.json), got another folder")
    (tmp_path / "one.csv").write_text("time,q\n1,2\n")

    def refuse(*args, **more):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    assert unreadable(tmp_path / "one.csv").endswith("cannot be read as .csv: Permission denied")


def test_sixty_thousand_columns_take_no_longer_than_their_bytes(tmp_path):
    names = ["time", *(f"c{i}" for i in range(60_000))]
    (tmp_path / "wide.csv").write_text(",".join(names) + "\n" + (",".join(["1"] * len(names)) + "\n") * 2)
    begin = time.process_time()
    assert read_table(tmp_path / "wide.csv").shape == (2, 60_001)
    assert time.process_time() - begin < 15.0
