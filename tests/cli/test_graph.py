"""`drake-tc graph`: formats, where it writes, what it refuses. The registry is a stub: one diagram of two blocks."""

import json
import sys
from dataclasses import dataclass, replace
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import pytest
import typer
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain, LogVectorOutput
from typer.testing import CliRunner

from drake_tc.cli.diagram_commands import graph_command
from drake_tc.cli.options import with_flat_options
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class Named:
    name: str
    duration: float = 3600.0

    def changed(self, **fields):
        return replace(self, **fields)


def small(scenario):
    assert scenario.duration == 1.0  # tables of references take time to make
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("reference", ConstantVectorSource([1.0, 2.0]))
    gain = builder.AddNamedSystem(f"gain_{scenario.name}", Gain(2.0, 2))
    builder.Connect(source.get_output_port(), gain.get_input_port())
    LogVectorOutput(gain.get_output_port(), builder)
    diagram = builder.Build()
    diagram.set_name("small")
    return SimpleNamespace(diagram=diagram)


def scenario(name=None, file=None):
    names = [file.read_text()] if file else ["slow", "fast"]
    if name and name not in names:
        raise ParamsError(f"no scenario {name!r}; scenarios: {', '.join(names)}")
    return Named(name or names[0])


def entry(name):
    if name != "small":
        raise ParamsError(f"no diagram {name!r}; diagrams: small")
    made = SimpleNamespace(build=small, scenario=scenario)
    made.naming = lambda file, text: made
    return made


@pytest.fixture
def graph(monkeypatch):
    registry = ModuleType("drake_tc.registry")
    registry.runnable = entry
    monkeypatch.setitem(sys.modules, "drake_tc.registry", registry)
    app = typer.Typer()
    app.command("graph")(with_flat_options(graph_command))
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def blocks(outcome) -> list[str]:
    return [block["name"] for block in json.loads(outcome.stdout)["blocks"]]


def test_svg_is_what_comes_without_asking_and_stands_alone_on_stdout(graph):
    root = ElementTree.fromstring(graph("small").stdout)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"


@pytest.mark.parametrize(("form", "start"), [("svg", "<svg "), ("dot", "digraph"), ("mermaid", "flowchart LR")])
def test_each_format_to_stdout_and_to_a_file_is_the_same(graph, tmp_path, form, start):
    shown = graph("small", "--format", form)
    written = graph("small", "--format", form, "--out", tmp_path / "new" / "graph")
    assert shown.exit_code == written.exit_code == 0
    assert shown.stdout.startswith(start)
    assert (tmp_path / "new" / "graph").read_text(encoding="utf-8") == shown.stdout
    assert written.stdout.strip() == str(tmp_path / "new" / "graph")


@pytest.mark.parametrize("form", ["svg", "dot", "mermaid"])
def test_logs_are_drawn_on_request(graph, form):
    assert "VectorLogSink" not in graph("small", "--format", form).stdout
    assert "VectorLogSink" in graph("small", "--format", form, "--all").stdout


def test_the_scenario_is_built(graph, tmp_path):
    (tmp_path / "own.yaml").write_text("crooked")
    assert "gain_slow" in blocks(graph("small", "--format", "json"))
    assert "gain_fast" in blocks(graph("small", "--format", "json", "--scenario", "fast"))
    assert "gain_crooked" in blocks(graph("small", "--format", "json", "--scenario-file", tmp_path / "own.yaml"))


def test_a_block_is_put_into_another_stage(graph):
    document = json.loads(graph("small", "--format", "json", "--stage", "Gain=filtering").stdout)
    assert [b["stage"] for b in document["blocks"]] == ["filtering", "filtering", "logging"]
    # the source, which no class or tag places, stands where it is read


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["smal"], "'smal'.*small"),
        (["small", "--scenario", "quick"], "'quick'.*slow, fast"),
        (["small", "--stage", "Gain"], "BLOCK=STAGE.*'Gain'"),
        (["small", "--stage", "Gain=filter"], "'filter'.*filtering"),
        (["small", "--stage", "gian=filtering"], "'gian'.*reference, gain_slow"),
    ],
)
def test_refusals(graph, arguments, words):
    outcome = graph(*arguments)
    assert isinstance(outcome.exception, ParamsError)
    assert outcome.stdout == ""
    with pytest.raises(ParamsError, match=words):
        raise outcome.exception


def test_a_file_that_cannot_be_written(graph, tmp_path):
    outcome = graph("small", "--out", tmp_path)
    assert isinstance(outcome.exception, ParamsError) and "cannot be written" in str(outcome.exception)


@pytest.mark.parametrize("arguments", [["small", "--format", "png"], ["small", "--depth", "-1"], []])
def test_slips_of_the_keyboard_end_with_2(graph, arguments):
    assert graph(*arguments).exit_code == 2
