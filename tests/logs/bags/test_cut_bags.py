"""A bag that ends early is read up to its end, and the run says so."""

import shutil
import struct
from importlib import import_module

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.logs.files.bag import is_cut
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log

from .recorded import bag, joint_states

TIME = np.arange(1500) / 250.0
STATES = {"knee": (np.sin(TIME), np.cos(TIME), np.sin(2.0 * TIME))}


def zstd(content: bytes) -> bytes:
    try:
        module = import_module("compression.zstd")
    except ModuleNotFoundError:
        module = import_module("backports.zstd")
    return module.compress(content)


PACKERS = {"": bytes, "lz4": import_module("lz4.frame").compress, "zstd": zstd}


def recorded(path, *, mcap):
    folder = bag(path, joint_states("/joint_states", TIME, STATES), mcap=mcap)
    (file,) = folder.glob("*.mcap" if mcap else "*.db3")
    return file


@pytest.mark.parametrize("mcap", [True, False])
@pytest.mark.parametrize("share", [0.35, 0.8, 0.999])
def test_a_cut_file_is_read_up_to_the_cut(tmp_path, mcap, share):
    file = recorded(tmp_path / "run", mcap=mcap)
    whole = read_table(file)
    content = file.read_bytes()
    for place in (file, tmp_path / f"alone{file.suffix}"):  # in its folder with metadata, and alone
        place.write_bytes(content[: int(share * len(content))])
        path = file.parent if place == file else place
        table = read_table(path)
        assert 0.2 * len(whole) < len(table) <= len(whole)
        assert_allclose(table["knee/position"], whole["knee/position"][: len(table)], rtol=0, atol=1e-12)
        assert f"The file {place.name} is cut off" in " ".join(inspect_log(path).notes)


@pytest.mark.parametrize("packed", PACKERS)
def test_a_chunk_that_is_cut_is_read_up_to_the_cut(tmp_path, packed):
    """The messages of a file, packed into one chunk as recorders do."""
    file = recorded(tmp_path / "run", mcap=True)
    records, at, content = b"", 8, file.read_bytes()
    head = b""
    while content[at] != 0x0F:  # the end of the data
        (length,) = struct.unpack_from("<Q", content, at + 1)
        record = content[at : at + 9 + length]
        inner = record[9 + 40 + struct.unpack_from("<I", record, 9 + 28)[0] :] if record[0] == 0x06 else record
        head, records = (head + record, records) if record[0] == 0x01 else (head, records + inner)
        at += 9 + length
    name = packed.encode()
    body = PACKERS[packed](records)
    chunk = struct.pack("<QQQII", 0, 2**62, len(records), 0, len(name)) + name + struct.pack("<Q", len(body)) + body
    made = content[:8] + head + struct.pack("<BQ", 0x06, len(chunk)) + chunk
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(made[: int(0.7 * len(made))])
    table = read_table(cut)
    assert len(table) > (100 if packed else 900)
    assert_allclose(table["knee/position"], np.sin(TIME[: len(table)]), rtol=0, atol=1e-12)


def test_whole_files_are_not_cut_and_a_bag_without_metadata_is_read(tmp_path):
    for mcap in (True, False):
        file = recorded(tmp_path / f"run{mcap}", mcap=mcap)
        assert not is_cut(file)
        (file.parent / "metadata.yaml").unlink()
        table = read_table(file.parent)
        assert len(table) == TIME.size and "has no metadata.yaml" in table.attrs["hints"][0]


def test_of_a_split_recording_the_last_file_may_be_cut(tmp_path):
    file = recorded(tmp_path / "run", mcap=True)
    other = recorded(tmp_path / "later", mcap=True)
    second = file.with_name("run_1.mcap")
    shutil.copy(other, second)
    text = (file.parent / "metadata.yaml").read_text()
    (file.parent / "metadata.yaml").write_text(text.replace(f"- {file.name}", f"- {file.name}\n  - {second.name}"))
    second.write_bytes(second.read_bytes()[:-200])
    assert len(read_table(file.parent)) == TIME.size
