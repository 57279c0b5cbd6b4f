"""`drake-tc schema rig`: a JSON schema on stdout, or the page."""

import json


def test_the_schema_goes_to_stdout(invoke):
    outcome = invoke("schema", "rig")
    assert outcome.code == 0 and outcome.err == ""
    assert json.loads(outcome.out)["properties"]["drive"]["description"].startswith("What the drive")


def test_the_page_goes_to_a_file(invoke, tmp_path):
    outcome = invoke("schema", "rig", "--page", "--out", tmp_path / "docs" / "RIG.md")
    assert outcome.code == 0
    assert (tmp_path / "docs" / "RIG.md").read_text(encoding="utf-8").startswith("# The rig file")


def test_an_unknown_document_and_a_place_that_cannot_be_written(invoke, tmp_path):
    assert "'rgi'" in invoke("schema", "rgi").refusal()
    (tmp_path / "file").write_text("")
    assert "cannot be written" in invoke("schema", "rig", "--out", tmp_path / "file" / "x").refusal()
