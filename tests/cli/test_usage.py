"""What the help shows can be typed as it stands, and a value that cannot be read is named with what was expected."""

import re
import shlex

import pytest
import typer

from drake_tc.cli.main import app

COMMANDS = typer.main.get_command(app).commands


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_shows_no_types_of_python(invoke, name):
    text = invoke(name, "--help").out
    assert re.findall(r"--\S+ (<[^>]*(?:\[|int|float|str|Path)[^>]*>)", text) == re.findall(r"--\S+ (<integer>)", text)


@pytest.mark.parametrize(
    ("line", "option", "values"),
    [
        ("--position -0.8 0.8", "position", (-0.8, 0.8)),
        ("--load 0 --load 1.5@0.3", "load", ["0", "1.5@0.3"]),
    ],
)
def test_an_example_of_the_help_is_taken_as_it_stands(invoke, line, option, values):
    assert line in " ".join(invoke("design", "--help").out.split())
    context = COMMANDS["design"].make_context("design", ["--rig", "rig.yaml", *shlex.split(line)])
    assert context.params[option] == values


def test_two_values_of_an_option_may_stand_behind_an_equals_sign():
    words = ["--rig", "rig.yaml", "--position=-1.4,1.4", "--velocity", "1"]
    context = COMMANDS["design"].make_context("design", words)
    assert context.params["position"] == (-1.4, 1.4) and context.params["velocity"] == 1.0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("design --position -0.8 a", "'--position': expected a number, got a (see drake-tc design --help)"),
        ("demo --seed -1", "'--seed': expected at least 0, got -1 (see drake-tc demo --help)"),
        ("demo --seed 1.5", "'--seed': expected an integer, got 1.5 (see drake-tc demo --help)"),
        ("demo --seed 4294967296", "'--seed': expected at most 4294967295, got 4294967296 (see drake-tc demo --help)"),
        ("stability hrp2_leg --direction 1.5", "expected at most 1, got 1.5 (see drake-tc stability --help)"),
        ("graph hrp2_leg --format pdf", "'--format': 'pdf' is not one of 'svg', 'dot', 'mermaid', 'json'."),
        ("design --position=-0.8", "requires 2 arguments. (see drake-tc design --help)"),
        ("export", "Missing argument 'MODEL'. (see drake-tc export --help)"),
        ("demo --zzz", "No such option: --zzz (see drake-tc demo --help)"),
        ("nope", "No such command 'nope'. (see drake-tc --help)"),
    ],
)
def test_a_value_that_cannot_be_read_is_told(invoke, line, message):
    assert message in invoke(*shlex.split(line)).refusal()
