"""Commands that simulate run with an allocator that keeps more freed blocks at hand; others start once."""

import os
import subprocess
import sys

import pytest

from drake_tc.cli import entry
from drake_tc.cli.entry import BLOCKS, TUNABLE, restart_tuned, tuned

OWN = f"{TUNABLE}={BLOCKS}"
NEEDS_GLIBC = pytest.mark.skipif(not entry._has_glibc(), reason="another C library")
CALL = "from drake_tc.cli.entry import main; main()"
DRAKE = "import os\nraise ImportError('tunables ' + os.environ.get('GLIBC_TUNABLES', 'none') + f' {os.getpid()}')"


def seen(tmp_path, *arguments, **variables):
    """What a process has that the command runs in: its tunables, and whether it is the one that was started."""
    (tmp_path / "pydrake").mkdir(exist_ok=True)
    (tmp_path / "pydrake" / "__init__.py").write_text(DRAKE, encoding="utf-8")
    kept = {name: value for name, value in os.environ.items() if name != "GLIBC_TUNABLES"}
    path = os.pathsep.join([str(tmp_path), *filter(None, [kept.get("PYTHONPATH")])])
    environment = {**kept, "PYTHONPATH": path, **variables}
    started = subprocess.Popen(
        [sys.executable, "-c", CALL, *arguments], stderr=subprocess.PIPE, text=True, env=environment
    )
    _, told = started.communicate(timeout=60)
    tunables, process = told.split("tunables ")[1].split()
    assert started.returncode == 2
    return tunables, int(process) == started.pid


@NEEDS_GLIBC
@pytest.mark.parametrize("command", entry.SIMULATING)
def test_a_command_that_simulates_has_the_tunable_in_the_same_process(tmp_path, command):
    assert seen(tmp_path, command, "--flag", "with blanks and 'quotes'") == (OWN, True)


@pytest.mark.parametrize("arguments", [("inspect", "simulate"), ("--help",), ()])
def test_other_commands_keep_their_environment(tmp_path, arguments):
    assert seen(tmp_path, *arguments) == ("none", True)


@NEEDS_GLIBC
def test_tunables_of_the_user_stay(tmp_path):
    assert seen(tmp_path, "simulate", GLIBC_TUNABLES="glibc.malloc.perturb=1") == (
        f"glibc.malloc.perturb=1:{OWN}",
        True,
    )
    assert seen(tmp_path, "simulate", GLIBC_TUNABLES=f"{TUNABLE}=3") == (f"{TUNABLE}=3", True)


def test_nothing_is_added_twice():
    once = tuned({"HOME": "/"})
    assert once == {"HOME": "/", "GLIBC_TUNABLES": OWN}
    assert tuned(once) is None


def test_a_program_that_calls_the_command_goes_on(monkeypatch):
    monkeypatch.delenv("GLIBC_TUNABLES", raising=False)
    monkeypatch.setattr(os, "execve", lambda *arguments: pytest.fail("started anew"))
    restart_tuned(["simulate", "a diagram that the interpreter was not started with"])


def test_without_glibc_nothing_is_started_anew(monkeypatch):
    monkeypatch.delenv("GLIBC_TUNABLES", raising=False)
    monkeypatch.setattr(os, "execve", lambda *arguments: pytest.fail("started anew"))
    monkeypatch.setattr(sys, "orig_argv", ["python", "simulate"])
    monkeypatch.setattr(entry, "_has_glibc", lambda: False)
    restart_tuned(["simulate"])
