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
    parts = [
        f"### {name}\n\n{title}.\n\n![Block graph of {name}](images/graph_{name}.svg)" for name, title in titles.items()
    ]
    return "\n\n".join(parts)
