"""Packages that tests can do without; `make test` installs all of them."""

from importlib.metadata import PackageNotFoundError, distribution

import pytest


def skip_without_robots() -> None:
    """Robots of other makers come with a package; whatever else is wrong with their files is a failure."""
    try:
        distribution("example-robot-data")
    except PackageNotFoundError:
        pytest.skip('needs pip install "drake-tc[robots]"')
