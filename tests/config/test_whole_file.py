"""Results are whole or not there: a full disk, an error and a link."""

import resource
from contextlib import contextmanager

import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models, save_models
from drake_tc.config.files import whole_file, write_whole
from drake_tc.errors import LogError
from drake_tc.logs.rig import load_rig, parse_rig, save_rig
from drake_tc.loops.recording import write_log


@contextmanager
def full_disk(size: int):
    """No file can grow beyond so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def models(count: int) -> dict[str, ActuatorModel]:
    effects = (EffectValue("viscous", {"viscous": 3.0}),)
    return {f"j{i}": ActuatorModel(f"j{i}", Drive("current", 0.1), effects) for i in range(count)}


def test_a_model_file_of_before_is_whole_after_a_full_disk(tmp_path):
    path = tmp_path / "model.yaml"
    save_models(models(1), path)
    with full_disk(256), pytest.raises(OSError, match="File too large"):
        save_models(models(40), path)
    assert list(load_models(path)) == ["j0"]
    assert [each.name for each in tmp_path.iterdir()] == ["model.yaml"]


def test_a_rig_file_of_before_is_whole_after_a_full_disk(tmp_path):
    path = tmp_path / "rig.yaml"
    rig = parse_rig({"joint": "knee", "drive": "current"})
    save_rig(rig, path)
    with full_disk(64), pytest.raises(OSError, match="File too large"):
        save_rig(rig, path, "a long comment\n" * 100)
    assert load_rig(path).joints == ("knee",)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_a_log_on_a_full_disk_is_told_and_not_there(tmp_path, suffix):
    columns = {f"c{i}": [float(i * k % 97) for k in range(4000)] for i in range(4)}
    with full_disk(2000), pytest.raises(LogError, match=r"cannot be written: .*File too large"):
        write_log(columns, tmp_path / f"log{suffix}")
    assert not list(tmp_path.iterdir())


def test_an_error_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    write_whole(path, "before")
    with pytest.raises(ValueError, match="stop"), whole_file(path) as scratch:
        scratch.write_text("after")
        raise ValueError("stop")
    assert path.read_text() == "before"
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_a_link_is_followed_and_permissions_stay(tmp_path):
    path, link = tmp_path / "a.txt", tmp_path / "link.txt"
    write_whole(path, "before")
    path.chmod(0o640)
    link.symlink_to(path)
    write_whole(link, "after")
    assert link.is_symlink() and path.read_text() == "after" and path.stat().st_mode & 0o777 == 0o640
