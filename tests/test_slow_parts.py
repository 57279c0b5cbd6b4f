"""Parts of the slow tests: each slow test is in one of them (tests/conftest.py), and each is listed."""

import subprocess
import sys
from pathlib import Path

import pytest
import slow_parts
from slow_parts import PARTS, parts_of


@pytest.mark.parametrize(
    ("test", "part"),
    [
        ("diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded[A.table1]", "leg"),
        ("diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded[A.torque_estimate]", "leg"),
        ("diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded[A.tune]", "leg-sweeps"),
        ("diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded[B.closed_loop]", "closed-loop"),
        ("diagrams/papers/test_papers.py::test_a_reproduction_is_as_recorded[C.turn_half_hz]", "coman-motions"),
        ("diagnosis/test_blind_full.py::test_figures[rest]", "blind-rest"),
        ("test_notebooks.py::test_the_script_runs[05_coman]", "notebooks"),
    ],
)
def test_part_of_a_test(test, part):
    assert parts_of(test) == [part]


def test_a_test_of_a_new_file_is_in_no_part():
    assert parts_of("diagrams/test_new.py::test_slow") == []


def test_a_slow_test_without_a_part_stops_the_collection(tmp_path):
    here = Path(slow_parts.__file__).parent
    for name in ("conftest.py", "slow_parts.py"):
        (tmp_path / name).write_text((here / name).read_text("utf-8"))
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    slow: long\n")
    (tmp_path / "test_new.py").write_text("import pytest\n\n\n@pytest.mark.slow\ndef test_long():\n    pass\n")
    command = [sys.executable, "-m", "pytest", "-p", "no:xdist", "-m", "not slow"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "test_new.py::test_long is slow: expected one part of tests/slow_parts.py, got []" in done.stderr


def test_the_list_is_printed_without_anything_installed():
    done = subprocess.run(
        [sys.executable, "-S", slow_parts.__file__, "--list"], capture_output=True, text=True, check=True
    )
    assert [line.split()[2].removeprefix("PART=") for line in done.stdout.splitlines()[1:]] == list(PARTS)
    assert max(map(len, done.stdout.splitlines())) <= 140


def test_parts_run_one_after_the_other_and_all_failures_are_told(monkeypatch, capsys):
    ran = []
    monkeypatch.setattr(slow_parts, "run", lambda name: ran.append(name) or name != "tsid")
    assert slow_parts.main([]) == 1
    assert ran == list(PARTS)
    assert capsys.readouterr().out == "slow tests: failed: tsid\n"
    assert slow_parts.main(["leg"]) == 0
    assert slow_parts.main(["legs"]) == 2
    assert "no part legs; parts: leg, leg-sweeps" in capsys.readouterr().err
