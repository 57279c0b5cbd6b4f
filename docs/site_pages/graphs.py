"""Block graphs of the committed diagrams, as pictures of the gallery."""

from functools import cache

from drake_tc.registry import diagrams
from drake_tc.report.block_graph.graph import block_graph


@cache
def pictures() -> dict[str, str]:
    """File of the site to its SVG."""
    drawn = {}
    for name, entry in diagrams().items():
        loop = entry.build(entry.scenario())
        drawn[f"images/graph_{name}.svg"] = block_graph(loop.diagram).to_svg()
    return drawn


def overview() -> str:
    """A heading and a picture for each diagram."""
    titles = {name: entry.title for name, entry in diagrams().items()}
    return "\n\n".join(_part(name, title) for name, title in titles.items())


def _part(name: str, title: str) -> str:
    picture = f"images/graph_{name}.svg"
    text = f"{title[:1].upper()}{title[1:]}. A wide picture can be scrolled sideways; a click opens it at full size."
    return f"### {name}\n\n{text}\n\n[![Block graph of {name}]({picture})]({picture})"


COMPARED = ("hrp2_leg", "humanoid_tsid")
"""Diagrams of which docs/images has Graphviz's picture too."""


def comparison() -> str:
    """Our picture and Graphviz's, below each other, of each compared diagram."""
    drawn = (("own layout", "graph"), ("Graphviz", "graphviz"))
    return "\n\n".join(
        f"### {name}, {layout}\n\n[![{name}, {layout}](images/{kind}_{name}.svg)](images/{kind}_{name}.svg)"
        for name in COMPARED
        for layout, kind in drawn
    )
