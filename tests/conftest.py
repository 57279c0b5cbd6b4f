"""Settings of every test, and the parts of the slow ones.

No window opens, and a terminal is 80 columns wide unless a test says otherwise.
"""

import gc
import os
from pathlib import Path

# Before numpy and scikit-learn are imported: gradient-boosted trees spin when two test processes use all cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest
from hypothesis import settings
from slow_parts import PARTS, parts_of

os.environ.setdefault("MPLBACKEND", "Agg")

# The same examples at every run, so that a failure is the change's; HYPOTHESIS_PROFILE=explore looks for others.
settings.register_profile("same", derandomize=True)
settings.register_profile("explore", print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(autouse=True)
def _plain_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.delenv("FORCE_COLOR", raising=False)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of public data sets, by DRAKE_TC_DATA or beside the project; skips where there is none."""
    named = os.environ.get("DRAKE_TC_DATA")
    root = Path(named) if named else Path(__file__).resolve().parents[1].parent / "shared" / "data"
    if not root.is_dir():
        pytest.skip("no public data: neither ../shared/data beside the project nor DRAKE_TC_DATA")
    return root


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is collected stays to the end: the garbage collector never looks through these millions of objects again.

    Each of its full rounds took half a second of that, and the loops in real time ask for one before they run.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


SLOW_TIMEOUT = 40 * 60
"""A slow test may take as long as a part of them [s]."""


def pytest_addoption(parser):
    parser.addoption("--part", choices=PARTS, help="of the slow tests, run this part: see tests/slow_parts.py")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Every slow test belongs to one part and may take as long as that; with --part the other parts are left out."""
    chosen = config.getoption("part")
    kept = []
    for item in items:
        parts = None
        if item.get_closest_marker("slow"):
            test = item.nodeid.removeprefix("tests/")
            parts = parts_of(test)
            if len(parts) != 1:
                raise pytest.UsageError(f"{test} is slow: expected one part of tests/slow_parts.py, got {parts}")
            if not item.get_closest_marker("timeout"):
                item.add_marker(pytest.mark.timeout(SLOW_TIMEOUT))
        if chosen is None or parts == [chosen]:
            kept.append(item)
    config.hook.pytest_deselected(items=[item for item in items if item not in kept] if chosen else [])
    items[:] = kept
