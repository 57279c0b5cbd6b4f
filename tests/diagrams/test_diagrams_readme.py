"""diagrams/README.md lists every diagram and names the references of all scenario files."""

from pathlib import Path

import pytest

from drake_tc.cli.schema_command import SCENARIOS
from drake_tc.registry import diagrams

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "diagrams" / "README.md").read_text("utf-8")


def test_every_diagram_is_listed():
    assert all(f"`{name}`" in PAGE for name in diagrams())


@pytest.mark.parametrize("document", SCENARIOS)
def test_the_reference_of_every_scenario_file_is_named(document):
    assert f"`drake-tc schema {document} --page`" in PAGE or f"`{document}`" in PAGE
