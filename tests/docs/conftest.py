"""The documentation site, built once for all tests of it."""

import os
import subprocess
import sys
import time
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
    begin = time.monotonic()
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    arguments = ["-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    ran = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=500
    )
    return Site(folder, ran.stderr + ran.stdout, ran.returncode, time.monotonic() - begin)
