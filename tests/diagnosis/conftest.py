"""Where the public data sets lie."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of public data sets, by DRAKE_TC_DATA or beside the project; skips where there is none."""
    named = os.environ.get("DRAKE_TC_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not root.is_dir():
        pytest.skip("no public data: neither ../shared/data beside the project nor DRAKE_TC_DATA")
    return root
