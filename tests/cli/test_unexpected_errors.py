"""Errors that nobody foresaw end in one line and a file; warnings of libraries stay out of stderr."""

import logging
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from drake_tc.cli import main
from drake_tc.cli.unexpected_errors import UNEXPECTED, quiet_libraries


@pytest.fixture
def failing(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def fail(*arguments, **options):
        error = KeyError("temp")
        error.add_note("while reading run.csv")
        raise error

    monkeypatch.setattr(main, "app", fail)
    return tmp_path


def test_one_line_with_kind_place_and_details(failing, capsys):
    assert main.run(["close-loop", "--rig", "rig.yaml"]) == UNEXPECTED
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "KeyError: 'temp'" in line and "while reading run.csv" in line
    (path,) = re.findall(r"the details are in (\S+);", line)
    details = Path(path).read_text()
    assert "Traceback" in details and "'--rig', 'rig.yaml'" in details


def test_debug_shows_the_traceback(failing):
    with pytest.raises(KeyError):
        main.run(["--debug", "close-loop"])


def test_a_folder_that_cannot_be_written_is_passed_over(failing, monkeypatch, capsys):
    monkeypatch.setenv("XDG_STATE_HOME", "/dev/null")
    assert main.run(["close-loop"]) == UNEXPECTED
    (path,) = re.findall(r"the details are in (\S+);", capsys.readouterr().err)
    Path(path).unlink()


def test_warnings_of_libraries_stay_out(capsys):
    with warnings.catch_warnings(), quiet_libraries(quiet=False, debug=False):
        np.array([1.0]) / np.array([0.0])
        warnings.warn("a library is worried", stacklevel=1)
        for _ in range(3):
            logging.getLogger("drake").warning("a URDF\nis odd")
    assert capsys.readouterr().err == "drake-tc: Drake says: a URDF is odd\n"
    with quiet_libraries(quiet=True, debug=False):
        logging.getLogger("drake").warning("a URDF is odd")
    assert capsys.readouterr().err == ""
