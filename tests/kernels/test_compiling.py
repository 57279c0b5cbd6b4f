"""Where machine code is kept, when it is compiled again, and that a loop compiles nothing."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from drake_tc.kernels import compiling
from drake_tc.kernels.calls import Kernel

NEEDS_COMPILER = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
ENTRY = """
from drake_tc.kernels.compiling import REAL, kernel
from drake_tc.kernels.{helper} import double

@kernel(REAL)
def entry(x: float) -> float:
    '''Twice x.'''
    return double(x)
"""
HELPER = """
from drake_tc.kernels.compiling import helper

@helper
def double(x: float) -> float:
    '''{about}'''
    return {factor} * x
"""


def write(folder: Path, factor: float, about: str = "Twice x.") -> None:
    (folder / "one.py").write_text(ENTRY.format(helper="other"), encoding="utf-8")
    (folder / "other.py").write_text(HELPER.format(factor=factor, about=about), encoding="utf-8")
    (folder / "unrelated.py").write_text("x = 1\n", encoding="utf-8")


def test_a_change_of_a_helper_in_another_file_gives_another_folder(tmp_path):
    write(tmp_path, 2.0)
    first = compiling.sources_hash("one", tmp_path)
    assert [path.stem for path in compiling.sources_of("one", tmp_path)] == ["one", "other"]
    (tmp_path / "unrelated.py").write_text("x = 2\n", encoding="utf-8")
    write(tmp_path, 2.0, about="Words that change nothing.")
    assert compiling.sources_hash("one", tmp_path) == first
    write(tmp_path, 3.0)
    assert compiling.sources_hash("one", tmp_path) != first


def test_modules_imported_as_a_whole_count_too(tmp_path):
    write(tmp_path, 2.0)
    text = "from drake_tc.kernels import other as o, unrelated\n"
    (tmp_path / "whole.py").write_text(text, encoding="utf-8")
    assert [path.stem for path in compiling.sources_of("whole", tmp_path)] == ["other", "unrelated", "whole"]


RUN = """
import sys
import drake_tc.kernels
drake_tc.kernels.__path__.append(sys.argv[1])
from drake_tc.kernels import compiling
compiling._SOURCES = __import__("pathlib").Path(sys.argv[1])
original = compiling.sources_hash
compiling.sources_hash = lambda module: original(module, compiling._SOURCES)
from drake_tc.kernels.calls import Kernel
print(Kernel("one", "entry")(1.5))
"""


EDIT = RUN.replace(
    "from drake_tc.kernels.calls",
    """folder = compiling._SOURCES
drake_tc.kernels.AT_IMPORT |= drake_tc.kernels.states(folder)
import drake_tc.kernels.other
text = (folder / "other.py").read_text(encoding="utf-8")
(folder / "other.py").write_text(text.replace("2.0", "40.0"), encoding="utf-8")
from drake_tc.kernels.calls""",
)


def run(folder: Path, home: Path, code: str = RUN) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment |= {"XDG_CACHE_HOME": str(home), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", code, str(folder)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True)


@NEEDS_COMPILER
def test_an_edited_helper_is_compiled_again_and_compilation_is_told(tmp_path):
    sources, home = tmp_path / "sources", tmp_path / "home"
    sources.mkdir()
    write(sources, 2.0)
    first, again = run(sources, home), run(sources, home)
    assert (float(first.stdout), float(again.stdout)) == (3.0, 3.0)
    assert first.stderr == "Compiling kernels (once) ...\n"
    assert again.stderr == ""
    write(sources, 4.0)
    changed = run(sources, home)
    assert float(changed.stdout) == 6.0
    assert changed.stderr == first.stderr


@NEEDS_COMPILER
def test_what_a_process_compiles_from_sources_that_were_edited_since_is_not_kept(tmp_path):
    """It has loaded the helper before: kept under the hash of the new file, it would be found by all others."""
    sources, home = tmp_path / "sources", tmp_path / "home"
    sources.mkdir()
    write(sources, 2.0)
    assert float(run(sources, home, EDIT).stdout) == 3.0
    assert float(run(sources, home).stdout) == 60.0


@NEEDS_COMPILER
@pytest.mark.slow
def test_where_nothing_can_be_written_it_compiles_without_a_cache(tmp_path):
    sources, blocked = tmp_path / "sources", tmp_path / "a file"
    sources.mkdir()
    write(sources, 2.0)
    blocked.write_text("no folder", encoding="utf-8")
    found = run(sources, blocked)
    assert float(found.stdout) == 3.0
    assert found.stderr == "Compiling kernels (once) ...\n"


def test_numba_is_imported_where_a_kernel_is_called_and_not_before():
    code = "import sys, drake_tc.tsid.law, drake_tc.tsid.controller; print('numba' in sys.modules)"
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "False\n"


@NEEDS_COMPILER
@pytest.mark.parametrize(
    "name",
    [
        ("sensors", "reading"),
        ("filters", "advance"),
        ("joint_torque", "estimate"),
        ("joint_torque", "joint_forces"),
        ("joint_torque", "motion_torque"),
        ("torque_control", "solve"),
        ("fault_monitor", "raise_flags"),
        ("guard", "step"),
        ("actuator", "advance"),
    ],
    ids=".".join,
)
def test_the_loop_of_the_leg_compiles_nothing_again(name, leg_ticks):
    assert leg_ticks > 0
    assert len(Kernel(*name).entry().signatures) == 1


@NEEDS_COMPILER
@pytest.mark.parametrize(
    "name",
    [
        ("tsid.terms", "terms"),
        ("tsid.rows", "com"),
        ("tsid.rows", "posture"),
        ("tsid.rows", "viable"),
        ("tsid.terms", "causes"),
        ("tsid.scaling", "scaled"),
        ("tsid.newton", "minimum"),
        ("tsid.problem", "problem"),
    ],
    ids=".".join,
)
def test_a_loop_compiles_nothing_again(name, humanoid_ticks):
    entry = Kernel(*name).entry()
    assert len(entry.signatures) == 1
    assert humanoid_ticks.solved
    assert len(entry.signatures) == 1


@NEEDS_COMPILER
def test_the_series_elastic_loop_compiles_nothing_again(series_elastic_ticks):
    names = [("base.tick", "tick"), ("base.chain", "tick"), ("base.pose", "outputs"), ("joint_voting", "vote")]
    names += [("series_elastic", "law"), ("sensors", "imu"), ("sensors", "wrenches")]
    assert series_elastic_ticks.solved
    assert {name: len(Kernel(*name).entry().signatures) for name in names} == dict.fromkeys(names, 1)
