"""The documentation site, built once for all tests of it."""

import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))


@dataclass(frozen=True)
class Site:
    """A built site: its folder, what MkDocs said, its exit code, and the processor time that it took [s]."""

    folder: Path
    said: str
    code: int
    seconds: float


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Site:
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    before = _children_seconds()
    ran = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=570)
    return Site(folder, ran.stderr + ran.stdout, ran.returncode, _children_seconds() - before)


def _children_seconds() -> float:
    """Processor time of processes that ended [s]: the clock on the wall also counts what else the machine does."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
