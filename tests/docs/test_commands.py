"""Every option of a command has an example; examples, and commands on pages, are lines that the program takes."""

import re

import pytest

from .conftest import ROOT

FOLDERS = ("docs", "drake_tc", "diagrams", "models", "tests")
site_pages = pytest.importorskip("site_pages.commands")
COMMANDS, EXAMPLES = site_pages.commands(), site_pages.examples()
LINES = [(name, example["run"]) for name, shown in EXAMPLES.items() for example in shown]


def parsed(name, line):
    """Names of the options that stand on the line, once the command has taken it."""
    words = site_pages.arguments_of(line)
    assert words[: len(name.split())] == name.split()
    rest = words[len(name.split()) :]
    COMMANDS[name].make_context(name, list(rest))
    return {word.split("=")[0] for word in rest if word.startswith("--")}


def test_every_command_has_examples():
    assert set(EXAMPLES) == set(COMMANDS)


@pytest.mark.parametrize(("name", "line"), LINES)
def test_an_example_is_taken(name, line):
    known = {option for p in COMMANDS[name].params for option in (*p.opts, *p.secondary_opts)}
    assert parsed(name, line) <= known


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_has_an_example(name):
    options = {
        option
        for parameter in COMMANDS[name].params
        if parameter.param_type_name == "option"
        for option in (*parameter.opts, *parameter.secondary_opts)
    }
    shown = set().union(*(parsed(name, example["run"]) for example in EXAMPLES[name]))
    assert options - shown == set()


def test_units_in_brackets_are_not_taken_for_markup(capsys):
    from drake_tc.cli.main import run

    assert run(["bode", "--help"]) == 0
    assert "[Hz]" in capsys.readouterr().out


def test_an_option_that_does_not_exist_is_refused():
    with pytest.raises(Exception, match="No such option"):
        parsed("schema", "drake-tc schema rig --no-such-option")


@pytest.mark.parametrize("name", COMMANDS)
def test_scripts_can_hand_a_seed_and_json_to_every_command(name):
    options = {option for parameter in COMMANDS[name].params for option in parameter.opts}
    assert "--seed" in options
    assert "--json" in options or name == "schema"  # a schema is JSON without being asked


def written() -> list[tuple[str, str]]:
    """(page, line) of each `drake-tc` command that stands on a line of its own in a page of the repository."""
    paths = sorted({*ROOT.glob("*.md"), *(p for top in FOLDERS for p in (ROOT / top).rglob("*.md"))})
    found = []
    for path in paths:
        text = path.read_text("utf-8").replace("\\\n", " ")
        lines = re.findall(r"^(?:    |\$ )(drake-tc .*)$", text, re.M)
        found += [(path.relative_to(ROOT).as_posix(), line) for line in lines]
    return found


@pytest.mark.parametrize(("page", "line"), written())
def test_a_command_of_a_page_is_taken(page, line):
    words = site_pages.arguments_of(line)
    COMMANDS[words[0]].make_context(words[0], words[1:])
