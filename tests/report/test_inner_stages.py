"""Systems that name the stages inside them are drawn as these stages."""

import json

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain, LogVectorOutput

from drake_tc.array_stage import InnerStage
from drake_tc.errors import ParamsError
from drake_tc.report.block_graph.graph import block_graph

from .block_graph_diagrams import N, Stage

SPLIT = (
    InnerStage("split", "Splitter", {"all": "u"}, {"low": "LowPart", "high": "HighPart"}),
    InnerStage("join", "Joiner", {"high": "split.high", "low": "split.low", "whole": "u"}, {"y": "vector"}),
)


def drawn(stages=SPLIT):
    """A gain before and behind a system with inner stages; both ends are exported."""
    builder = DiagramBuilder()
    before, after = (builder.AddNamedSystem(name, Gain(1.0, N)) for name in ("before", "after"))
    inside = Stage({"u": N}, {"y": N})
    inside.inner_stages = stages
    builder.AddNamedSystem("inside", inside)
    builder.Connect(before.get_output_port(), inside.get_input_port(0))
    builder.Connect(inside.get_output_port(0), after.get_input_port())
    builder.ExportInput(before.get_input_port(), "into")
    builder.ExportOutput(inside.get_output_port(0), "out")
    LogVectorOutput(inside.get_output_port(0), builder)
    return block_graph(builder.Build())


def test_the_stages_stand_in_place_of_the_system():
    graph = drawn()
    assert [block.path for block in graph.blocks][:4] == ["before", "after", "inside::split", "inside::join"]
    ends = {(edge.source, edge.output, edge.target, edge.input): edge.type for edge in graph.edges}
    assert ends == {
        ("before", 0, "inside::split", 0): "vector",
        ("before", 0, "inside::join", 2): "vector",
        ("inside::split", 1, "inside::join", 0): "HighPart",
        ("inside::split", 0, "inside::join", 1): "LowPart",
        ("inside::join", 0, "after", 0): "vector",
        ("inside::join", 0, "VectorLogSink_1", 0): "vector",
    }
    assert graph.outputs[0].ends == (("inside::join", 0),)
    assert json.loads(graph.to_json())["blocks"][3]["update"] == {"period": 1e-3, "offset": 0.0}
    assert "inside / split" in graph.to_svg() and "HighPart" in graph.to_mermaid() and "Joiner" in graph.to_dot()


@pytest.mark.parametrize(
    ("stages", "words"),
    [
        ((InnerStage("a", "A", {"all": "v"}, {"y": "vector"}),), "'inside': nothing is called 'v'"),
        ((InnerStage("a", "A", {}, {"y": "vector"}),), "'inside': port 'u' belongs to no stage"),
        ((InnerStage("a", "A", {"all": "u"}, {"x": "vector"}),), "'inside': port 'y' belongs to no stage"),
    ],
)
def test_stages_that_do_not_fit_the_system_are_refused(stages, words):
    with pytest.raises(ParamsError, match=words):
        drawn(stages)
