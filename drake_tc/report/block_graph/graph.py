"""Block graphs of Drake diagrams, to look at and for programs: SVG, DOT, Mermaid and JSON.

    graph = block_graph(diagram)
    graph.to_svg()

A notebook shows a BlockGraph as its SVG.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pydrake.systems.framework import Diagram

from drake_tc.report.block_graph.data import GraphData
from drake_tc.report.block_graph.read import read_diagram
from drake_tc.report.block_graph.svg import svg
from drake_tc.report.block_graph.text_formats import dot, graph_json, mermaid
from drake_tc.report.block_graph.view import view


@dataclass(frozen=True)
class BlockGraph(GraphData):
    """A diagram as blocks and edges, and its pictures; the same diagram gives the same bytes.

    The pictures leave out logs, signals that only logs read and ports that nothing is connected to, unless
    `everything` is set; `to_json` always holds all.
    """

    def to_json(self) -> str:
        """All blocks, ports, connections and exported ports as JSON; see `to_json`."""
        return graph_json(self)

    def to_svg(self, *, everything: bool = False) -> str:
        """One `<svg>` document on a background of its own, light or dark as the viewer asks."""
        return svg(view(self, everything=everything))

    def to_dot(self, *, everything: bool = False) -> str:
        """Graphviz: a cluster for each stage, records with named ports."""
        return dot(view(self, everything=everything))

    def to_mermaid(self, *, everything: bool = False) -> str:
        """A Mermaid flowchart: a subgraph for each stage, edges labelled with ports and widths."""
        return mermaid(view(self, everything=everything))

    def _repr_svg_(self) -> str:
        return self.to_svg()


def block_graph(diagram: Diagram, stages: Mapping[str, str] | None = None, depth: int | None = 1) -> BlockGraph:
    """The block graph of a diagram.

    Args:
        diagram: Any Drake Diagram.
        stages: Path, name or class of a block to its stage, where the choice is to be another.
        depth: 1 shows the diagram's own systems, 2 also what stands in nested diagrams, …; None opens all.

    Raises:
        ParamsError: not a Diagram, a depth below 1, a stage or block that there is not.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> loop = add_torque_loop(builder, add_robot_plant(builder, robot), robot, load_models(robot.actuators))
        >>> "torque_control" in block_graph(builder.Build()).to_mermaid()
        True
    """
    read = read_diagram(diagram, stages, depth)
    return BlockGraph(read.name, read.blocks, read.edges, read.inputs, read.outputs)
