"""The door of the command line: help, version, the list of commands."""

import re

import pytest
import typer

import drake_tc
from drake_tc.cli.main import app

COMMANDS = ["close-loop", "check", "design", "rehearse", "identify", "import", "schema"]


def test_version(invoke):
    outcome = invoke("--version")
    assert (outcome.code, outcome.out, outcome.err) == (0, f"{drake_tc.__version__}\n", "")


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_lists_the_commands(invoke, arguments):
    outcome = invoke(*arguments)
    assert outcome.code == 0
    for name in COMMANDS:
        assert re.search(rf"\b{name}\b", outcome.out)


def test_a_narrow_terminal_cuts_no_name_of_an_option(invoke, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        outcome = invoke(name, "--help")
        text = outcome.out
        assert outcome.code == 0 and outcome.err == "" and "Usage" in text
        assert max(map(len, text.splitlines())) <= 60, name
        options = {option for p in command.params for option in p.opts if option.startswith("--")}
        assert options <= set(re.findall(r"--[a-z-]+", text)), name
    assert "..." not in invoke("--help").out.partition("Commands:")[2]


def test_an_unknown_format_lists_those_there_are(invoke, tmp_path):
    outcome = invoke("import", "moon", tmp_path, "--out", tmp_path)
    assert outcome.code == 2
    assert "'moon'" in outcome.err and "possible: bam" in outcome.err
