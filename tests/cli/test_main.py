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


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("columns", ["60", "120"])
def test_each_command_explains_itself(invoke, monkeypatch, name, columns):
    monkeypatch.setenv("COLUMNS", columns)
    outcome = invoke(name, "--help")
    assert outcome.code == 0 and outcome.err == ""
    assert "Usage" in outcome.out
    assert max(map(len, outcome.out.splitlines())) <= int(columns)


def test_a_narrow_terminal_cuts_no_name_of_an_option(invoke, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        text = invoke(name, "--help").out
        assert max(map(len, text.splitlines())) <= 60, name
        options = {option for p in command.params for option in p.opts if option.startswith("--")}
        assert options <= set(re.findall(r"--[a-z-]+", text)), name
    assert "..." not in invoke("--help").out.partition("Commands:")[2]


def test_an_unknown_format_lists_those_there_are(invoke, tmp_path):
    outcome = invoke("import", "moon", tmp_path, "--out", tmp_path)
    assert outcome.code == 2
    assert "'moon'" in outcome.err and "possible: bam" in outcome.err
