"""The block graph of the whole-body controller shows what a tick computes."""

from pydrake.systems.framework import DiagramBuilder

from drake_tc.report.block_graph.graph import block_graph
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid

from .test_controller import FILE, OUTPUTS


def test_the_block_graph_shows_what_a_tick_computes():
    law = load_law(FILE)
    builder = DiagramBuilder()
    builder.AddNamedSystem("tsid", RobustTsid(law))
    graph = block_graph(builder.Build())
    paths = [block.path.removeprefix("tsid::") for block in graph.blocks]
    rows = [f"task {task.name}" for task in law.tasks] + [f"limit {limit.name}" for limit in law.limits]
    assert paths == ["terms", *rows, "reduction", "program"]
    assert {edge.source for edge in graph.edges if edge.target == "tsid::reduction"} == {
        "tsid::terms",
        *(f"tsid::{name}" for name in rows),
    }
    assert [port.name for port in graph.blocks[-1].outputs] == list(OUTPUTS)
    assert {block.stage for block in graph.blocks} == {"control"}
