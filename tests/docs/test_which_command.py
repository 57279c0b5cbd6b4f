"""The page of questions: the program takes its commands, its Python names are public, and no command is left out."""

import re

import pytest

import drake_tc

from .conftest import DOCS

site_pages = pytest.importorskip("site_pages.commands")
COMMANDS = site_pages.commands()
PAGE = (DOCS / "which_command.md").read_text("utf-8")
LINES = re.findall(r"\[`(drake-tc [^`]+)`\]\(cli/([a-z-]+)\.md\)", PAGE)


@pytest.mark.parametrize(("line", "page"), LINES)
def test_a_command_is_taken_and_leads_to_its_page(line, page):
    name, *rest = site_pages.arguments_of(line)
    assert name == page
    COMMANDS[name].make_context(name, rest)


def test_every_command_answers_a_question():
    assert {page for _, page in LINES} == set(COMMANDS)


def test_options_beside_a_command_are_options_of_close_loop():
    options = set(re.findall(r"the same with `(--[a-z-]+)", PAGE))
    assert options and options <= {name for each in COMMANDS["close-loop"].params for name in each.opts}


def test_the_calls_are_public():
    calls = set(re.findall(r"`drake_tc\.(\w+)\(", PAGE))
    assert calls and calls <= set(drake_tc.__all__)
