"""The stored pictures of Graphviz show the diagrams as they are now: the same blocks, ports, labels and lines."""

import html
import re

import pytest

from drake_tc.registry import diagrams
from drake_tc.report.block_graph.graph import block_graph

from .conftest import DOCS

graphs = pytest.importorskip("site_pages.graphs")


def of_dot(text: str) -> set[str]:
    """What Graphviz writes for the labels: fields of records, line by line."""
    labels = re.findall(r'label="((?:[^"\\]|\\.)*)"', text)
    fields = [field for label in labels for field in re.split(r"(?<!\\)[|{}]|\\n", re.sub(r"<[io]\d+>", "", label))]
    return {words for field in fields if (words := " ".join(re.sub(r"\\(.)", r"\1", field).split()))}


def of_svg(text: str) -> set[str]:
    found = re.findall(r"<text[^>]*>([^<]*)</text>", text)
    return {words for each in found if (words := " ".join(html.unescape(each).split()))}


@pytest.mark.parametrize("name", graphs.COMPARED)
def test_the_picture_is_of_the_present_diagram(name):
    entry = diagrams()[name]
    dot = block_graph(entry.build(entry.scenario()).diagram).to_dot()
    svg = (DOCS / "images" / f"graphviz_{name}.svg").read_text("utf-8")
    assert of_svg(svg) == of_dot(dot)
    assert svg.count('class="edge"') == dot.count(" -> ")
