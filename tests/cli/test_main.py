"""The door of the command line: help, version, the list of commands."""

import re

import pytest

import drake_tc

COMMANDS = ["close-loop", "check", "design", "rehearse", "identify", "import", "schema", "bench"]


def test_version(invoke):
    outcome = invoke("--version")
    assert (outcome.code, outcome.out, outcome.err) == (0, f"{drake_tc.__version__}\n", "")


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_lists_the_commands(invoke, arguments):
    outcome = invoke(*arguments)
    assert outcome.code == 0
    for name in COMMANDS:
        assert re.search(rf"\b{name}\b", outcome.out)


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("columns", ["60", "120"])
def test_each_command_explains_itself(invoke, monkeypatch, name, columns):
    monkeypatch.setenv("COLUMNS", columns)
    outcome = invoke(name, "--help")
    assert outcome.code == 0 and outcome.err == ""
    assert "Usage" in outcome.out
    assert max(map(len, outcome.out.splitlines())) <= int(columns)


@pytest.mark.parametrize(
    ("name", "option"), [("close-loop", "--holdout"), ("identify", "--method"), ("import", "--out")]
)
def test_options_are_named_in_the_help(invoke, name, option):
    assert option in invoke(name, "--help").out


def test_an_unknown_data_set_lists_those_there_are(invoke, tmp_path):
    outcome = invoke("import", "moon", tmp_path, "--out", tmp_path)
    assert outcome.code == 2
    for known in ("bam", "dfki", "tmotor", "staubli", "tiago", "uart-backlash"):
        assert known in outcome.err
