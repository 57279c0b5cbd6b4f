"""Where Drake cannot be loaded, every command ends with one line that says what to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drake_tc.cli import entry
from drake_tc.system_libraries import PACKAGES, how_to_install, missing_library, missing_packages, package_of

OPENING = "cannot open shared object file: No such file or directory"


def run_with(tmp_path, pydrake, *arguments):
    """The command in a process in which `import pydrake` runs the text `pydrake`."""
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake" / "__init__.py").write_text(pydrake, encoding="utf-8")
    (tmp_path / "pydrake" / "common.py").touch()
    call = [sys.executable, "-c", "from drake_tc.cli.entry import main; main()", *arguments]
    return subprocess.run(
        call, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": str(tmp_path)}
    )


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("simulate", "hrp2_leg"), ("close-loop",)])
def test_a_missing_library_is_one_line_with_its_package(tmp_path, arguments):
    done = run_with(
        tmp_path, f"print('a page of advice')\nraise ImportError('libglib-2.0.so.0: {OPENING}')", *arguments
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "drake-tc: Drake could not be loaded: the system library libglib-2.0.so.0 is missing;"
        " on Debian and Ubuntu: apt install libglib2.0-0\n"
    )


def test_a_library_without_a_known_package_is_named(tmp_path):
    done = run_with(tmp_path, f"raise ImportError('libodd-3.so.4.1: {OPENING}')")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "libodd-3.so.4.1 is missing; install the package of your system" in done.stderr


def test_another_import_error_is_passed_on_in_one_line(tmp_path):
    done = run_with(tmp_path, "raise ImportError('version `GLIBC_2.38` not found\\n(required by libdrake.so)')")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "Drake could not be loaded: version `GLIBC_2.38` not found (required by libdrake.so)" in done.stderr


def test_drake_that_is_not_installed(tmp_path):
    done = run_with(tmp_path, "raise ModuleNotFoundError(\"No module named 'pydrake'\", name='pydrake')")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "Drake is not installed" in done.stderr and "pip install 'drake>=1.51'" in done.stderr


def test_a_drake_that_is_too_old(monkeypatch):
    monkeypatch.setattr(entry, "version", lambda name: "1.36.0")
    assert entry.drake_problem().startswith("Drake 1.36 is too old; expected 1.51 or newer")


def test_a_drake_that_can_be_used_is_no_problem():
    assert entry.drake_problem() is None


@pytest.mark.parametrize(
    "library, package",
    [("libglib-2.0.so.0", "libglib2.0-0"), ("libX11.so.6", "libx11-6"), ("libSM.so.6", "libsm6"),
     ("libGL.so.1", "libgl1"), ("libEGL.so.1", "libegl1"), ("libgomp.so.1", "libgomp1")],
)  # fmt: skip
def test_packages_of_the_libraries_that_wheels_leave_out(library, package):
    assert missing_library(ImportError(f"{library}: {OPENING}")) == library
    assert package_of(library) == package and package in PACKAGES.values()
    assert how_to_install(library).endswith(f"apt install {package}")


def test_packages_that_modules_lack(monkeypatch, tmp_path):
    for name, library in {"without_glib": "libglib-2.0.so.0", "without_odd": "libodd.so.1"}.items():
        (tmp_path / f"{name}.py").write_text(f"raise ImportError('{library}: {OPENING}')", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert missing_packages(["without_glib", "without_odd", "json", "not_installed"]) == ["libglib2.0-0", "libodd.so.1"]


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
def test_the_script_of_the_installation_finds_nothing_missing():
    """It runs only where nothing is installed yet: an environment that is ready would hide that it is broken."""
    script = Path(__file__).resolve().parents[2] / ".ci" / "system_libraries.sh"
    ran = subprocess.run(["bash", script, sys.executable, "json"], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


def test_what_is_not_a_missing_library():
    assert missing_library(ImportError("cannot import name 'x' from 'y'")) is None
    assert package_of("libodd.so.1") is None
