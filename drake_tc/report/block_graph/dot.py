"""A block graph as Graphviz DOT: one cluster a stage, records with named ports, the loop from left to right."""

import re

from drake_tc.report.block_graph.view import SHOWN_STAGES, Pin, Shape, View


def dot(picture: View) -> str:
    """The DOT text; blocks are b0, b1, …, their ports i<index> and o<index>."""
    lines = [
        "digraph block_graph {",
        f"  graph [label={_quoted(picture.title)}, labelloc=t, rankdir=LR, splines=spline, bgcolor=white, "
        'fontname="Helvetica", nodesep=0.35, ranksep=0.9]',
        '  node [shape=record, fontname="Helvetica", fontsize=10, style=filled, fillcolor=white]',
        '  edge [fontname="Helvetica", fontsize=9]',
    ]
    for stage in SHOWN_STAGES:
        shapes = [s for s in picture.shapes if s.stage == stage]
        if shapes:
            lines += [f"  subgraph cluster_{stage} {{", f'    graph [label="{stage}", color=gray60, fontcolor=gray30]']
            lines += [f"    b{s.key} [label={_record(s)}{', color=gray60' if s.dim else ''}]" for s in shapes]
            lines.append("  }")
    for net in picture.nets:
        style = ", color=gray60, fontcolor=gray40" if net.dim else ""
        source = f"b{net.source[0]}:o{net.source[1]}:e"
        lines += [f"  {source} -> b{t}:i{i}:w [label={_quoted(net.label)}{style}]" for t, i in net.targets]
    return "\n".join([*lines, "}"]) + "\n"


def _record(shape: Shape) -> str:
    """`{{inputs}|title and notes|{outputs}}`: with rankdir=LR the outer braces make the fields run left to right."""
    middle = "\\n".join(_field(line) for line in (shape.title, *shape.notes))
    sides = (_pins("i", shape.inputs), middle, _pins("o", shape.outputs))
    return '"{' + "|".join(side for side in sides if side) + '}"'


def _pins(side: str, pins: tuple[Pin, ...]) -> str:
    return "{" + "|".join(f"<{side}{p.index}> {_field(p.name)}" for p in pins) + "}" if pins else ""


def _field(text: str) -> str:
    """Text of a record's field inside a quoted string."""
    return re.sub(r'([\\{}|<>" ])', r"\\\1", _plain(text)) or "\\ "


def _quoted(text: str) -> str:
    return '"' + re.sub(r'([\\"])', r"\\\1", _plain(text)) + '"'


def _plain(text: str) -> str:
    return " ".join(text.split())
