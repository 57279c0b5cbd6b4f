"""Results never take the place of inputs or of the user's files, and come together or not at all."""

import errno
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drake_tc.cli.out_files import MANIFEST, result_file, result_folder
from drake_tc.errors import ParamsError


def seen(folder: Path) -> list[str]:
    """Names in a folder that are not hidden, and hidden ones but for the manifest."""
    return sorted(path.name for path in folder.iterdir() if path.name != MANIFEST)


def write(folder: Path, texts: dict[str, str], **options) -> None:
    with result_folder(folder, "--out", names=("a.txt", "b.txt"), **options) as place:
        for name, text in texts.items():
            (place / name).write_text(text)


def test_results_come_together_when_the_block_ends(tmp_path):
    out = tmp_path / "deep" / "out"
    with result_folder(out, "--out") as place:
        (place / "a.txt").write_text("one")
        assert not (out / "a.txt").exists()
    assert seen(out) == ["a.txt"] and (out / "a.txt").read_text() == "one"


def test_nothing_stays_of_a_block_that_fails(tmp_path):
    out = tmp_path / "deep" / "out"
    with pytest.raises(ZeroDivisionError), result_folder(out, "--out") as place:
        (place / "a.txt").write_text("cut")
        raise ZeroDivisionError
    assert not (tmp_path / "deep").exists()


def test_own_files_are_overwritten_and_stale_ones_removed(tmp_path):
    write(tmp_path, {"a.txt": "1", "b.txt": "2"})
    write(tmp_path, {"a.txt": "3"})
    assert seen(tmp_path) == ["a.txt"] and (tmp_path / "a.txt").read_text() == "3"


def test_a_file_of_the_users_is_kept(tmp_path):
    (tmp_path / "b.txt").write_text("mine")
    with pytest.raises(ParamsError, match=r"b\.txt: this file exists, and drake-tc did not write it"):
        write(tmp_path, {"a.txt": "1"})
    assert seen(tmp_path) == ["b.txt"] and (tmp_path / "b.txt").read_text() == "mine"
    write(tmp_path, {"a.txt": "1", "b.txt": "2"}, force=True)
    assert (tmp_path / "b.txt").read_text() == "2"


def test_a_result_that_was_edited_is_the_users(tmp_path):
    write(tmp_path, {"a.txt": "1"})
    (tmp_path / "a.txt").write_text("1, with my notes")
    with pytest.raises(ParamsError, match="changed since"):
        write(tmp_path, {"a.txt": "2"})
    assert (tmp_path / "a.txt").read_text() == "1, with my notes"


def test_an_edited_result_that_is_not_written_again_stays(tmp_path):
    write(tmp_path, {"a.txt": "1", "b.txt": "2"})
    (tmp_path / "b.txt").write_text("noted")
    write(tmp_path, {"a.txt": "3"}, force=True)
    assert (tmp_path / "b.txt").read_text() == "noted"


@pytest.mark.parametrize("force", [False, True])
def test_an_input_is_never_overwritten(tmp_path, force):
    run = tmp_path / "run.csv"
    run.write_text("data")
    link = tmp_path / "link.csv"
    link.symlink_to(run)
    for place in (run, link):
        with (
            pytest.raises(ParamsError, match="is an input"),
            result_file(place, "--out", inputs=[run], force=force),
        ):
            pass
    assert run.read_text() == "data"


def test_an_empty_file_may_be_filled(tmp_path):
    place = tmp_path / "made_by_mktemp.yaml"
    place.touch()
    with result_file(place, "--out") as path:
        path.write_text("text")
    assert place.read_text() == "text"


def test_the_second_writer_of_a_folder_is_refused(tmp_path):
    with result_folder(tmp_path, "--out") as place:
        (place / "a.txt").write_text("first")
        with (
            pytest.raises(ParamsError, match="another drake-tc command is writing there"),
            result_folder(tmp_path, "--out"),
        ):
            pass
    assert (tmp_path / "a.txt").read_text() == "first"


def test_single_files_of_one_folder_are_written_side_by_side(tmp_path):
    with result_file(tmp_path / "a.txt", "--out") as one, result_file(tmp_path / "b.txt", "--out") as two:
        one.write_text("1")
        two.write_text("2")
    assert seen(tmp_path) == ["a.txt", "b.txt"]
    assert set(json.loads((tmp_path / MANIFEST).read_text())["written"]) == {"a.txt", "b.txt"}


def test_a_full_disk_leaves_nothing_cut(tmp_path):
    write(tmp_path, {"a.txt": "old"})
    with (
        pytest.raises(ParamsError, match=r"--out .*: cannot be written: No space"),
        result_folder(tmp_path, "--out") as place,
    ):
        (place / "a.txt").write_text("cu")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert seen(tmp_path) == ["a.txt"] and (tmp_path / "a.txt").read_text() == "old"


def test_a_device_is_written_directly():
    with result_file(Path("/dev/null"), "--out") as path:
        assert path == Path("/dev/null")
    with (
        pytest.raises(ParamsError, match="/dev/full: cannot be written"),
        result_file(Path("/dev/full"), "--out") as path,
    ):
        path.write_text("x" * 100_000)


def test_errors_of_inputs_are_not_taken_for_errors_of_writing(tmp_path):
    with pytest.raises(FileNotFoundError), result_folder(tmp_path / "out", "--out"):
        (tmp_path / "missing.csv").read_text()


def test_a_damaged_manifest_makes_everything_the_users(tmp_path):
    write(tmp_path, {"a.txt": "1"})
    (tmp_path / MANIFEST).write_text("[}")
    with pytest.raises(ParamsError, match="--force"):
        write(tmp_path, {"a.txt": "2"})


def ended(group: int) -> bool:
    """Whether all processes of a group end within 10 s."""
    for _ in range(100):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


BUSY = """
import signal, sys, time
from pathlib import Path
import typer
from drake_tc.analysis.sweep import processes
from drake_tc.cli import entry, main
from drake_tc.cli.out_files import result_folder

def long() -> None:
    with result_folder(OUT, "--out") as place, processes(2) as pool:
        (place / "a.txt").write_text("cut")
        waiting = [pool.submit(time.sleep, 60) for _ in range(2)]
        print("started", flush=True)
        [each.result() for each in waiting]

main.app.command("long")(long)
if __name__ == "__main__":
    OUT, sys.argv[1:] = Path(sys.argv[1]), ["long"]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
    entry.main()
"""


@pytest.mark.parametrize(
    ("sent", "code", "line", "preload"),
    [
        (signal.SIGINT, 130, "interrupted", ()),
        (signal.SIGTERM, 143, "terminated", ("colorsys",)),
    ],
)
def test_signals_end_workers_too_and_leave_nothing(tmp_path, sent, code, line, preload):
    script = tmp_path / "busy.py"
    script.write_text(BUSY.replace("processes(2)", f"processes(2, {preload!r})"))
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, script, out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    time.sleep(1.5)  # until the workers sleep too
    os.killpg(process.pid, sent)
    _, err = process.communicate(timeout=20)
    assert process.returncode == code
    assert err == f"drake-tc: {line}\n"
    assert not out.exists()
    assert ended(process.pid)


def test_a_full_disk_leaves_no_result_cut_and_the_earlier_ones_whole(invoke, bench, tmp_path):
    out = tmp_path / "model.yaml"
    call = ["identify", *bench.arguments(), "--out", out]
    assert invoke(*call).code == 0
    before = out.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, hard))
    try:
        line = invoke(*call).refusal()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "--out" in line and "cannot be written: File too large" in line
    assert out.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == [".drake-tc.json", "model.yaml"]


@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_a_file_in_place_of_a_folder_is_named(tmp_path, below):
    log = tmp_path / "run.csv"
    log.write_text("a,b\n1,2\n")
    with (
        pytest.raises(ParamsError, match=r"cannot be written: .*run\.csv is a file; expected the name of a folder"),
        result_folder(log / below, "--out", inputs=[log]),
    ):
        pytest.fail("the block is not to begin")
    assert log.read_text() == "a,b\n1,2\n"
