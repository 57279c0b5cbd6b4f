"""A block graph as text: Graphviz DOT, Mermaid and JSON.

A block graph as Graphviz DOT: one cluster a stage, records with named ports, the loop from left to right.

A block graph as a Mermaid flowchart: one subgraph a stage, edges labelled output → input and width.

A block graph as JSON.

{"schema": 1, "diagram":, "stages": [names],
 "blocks": [{"path":, "name":, "kind":, "stage":, "inputs": [port], "outputs": [port], "feedthrough": [[input, output]],
             "update": {"period":, "offset":} or null}],
 "edges": [{"source": {"block":, "port":}, "target": {"block":, "port":}, "size":, "type":}],
 "inputs": [{port, "ends": [{"block":, "port":}]}], "outputs": [same]}
with port = {"name":, "size":, "type":}; blocks are named by path, ports of a block by name; times in seconds.
"""

import json
import re
from typing import Any

from drake_tc.report.block_graph.data import STAGES, GraphData, Port, Terminal
from drake_tc.report.block_graph.view import SHOWN_STAGES, Pin, Shape, View


def dot(picture: View) -> str:
    """The DOT text; blocks are b0, b1, …, their ports i<index> and o<index>."""
    lines = [
        "digraph block_graph {",
        f"  graph [label={_quoted(picture.title)}, labelloc=t, rankdir=LR, newrank=true, splines=spline, "
        'bgcolor=white, fontname="Helvetica", nodesep=0.35, ranksep=0.9]',
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


_PLAIN = set(" _-+*/.,:()[]=→·'")


def mermaid(picture: View) -> str:
    """The Mermaid text; blocks are b0, b1 and so on."""
    lines = ["flowchart LR"]
    for stage in SHOWN_STAGES:
        shapes = [s for s in picture.shapes if s.stage == stage]
        if shapes:
            lines.append(f'  subgraph stage_{stage}["{stage}"]')
            lines += [f'    b{s.key}["{"<br/>".join(_text(t) for t in (s.title, *s.notes))}"]' for s in shapes]
            lines.append("  end")
    for net in picture.nets:
        source, output = net.source
        name = _name(picture.shapes[source].outputs, output)
        arrow = "-.->" if net.dim else "-->"
        for target, index in net.targets:
            ends = " → ".join(n for n in (name, _name(picture.shapes[target].inputs, index)) if n)
            label = _text(f"{ends} ({net.label})" if ends else net.label)
            lines.append(f'  b{source} {arrow}|"{label}"| b{target}')
    dim = [f"b{s.key}" for s in picture.shapes if s.dim]
    if dim:
        lines += ["  classDef dim opacity:0.55", f"  class {','.join(dim)} dim"]
    return "\n".join(lines) + "\n"


def _name(pins: tuple[Pin, ...], index: int) -> str:
    return next(pin.name for pin in pins if pin.index == index)


def _text(text: str) -> str:
    """Text inside a quoted label: all that Mermaid or HTML might read as its own becomes a character code."""
    return "".join(c if c.isalnum() or c in _PLAIN else f"#{ord(c)};" for c in " ".join(text.split())) or "#160;"


def graph_json(graph: GraphData) -> str:
    """The whole graph; see the module."""
    blocks = {block.path: block for block in graph.blocks}

    def read(path: str, index: int) -> dict[str, str]:
        return {"block": path, "port": blocks[path].inputs[index].name}

    def made(path: str, index: int) -> dict[str, str]:
        return {"block": path, "port": blocks[path].outputs[index].name}

    def terminal(one: Terminal, end: Any) -> dict[str, Any]:
        return {**_port(one.port), "ends": [end(*e) for e in one.ends]}

    document = {
        "schema": 1,
        "diagram": graph.name,
        "stages": list(STAGES),
        "blocks": [
            {
                "path": b.path,
                "name": b.name,
                "kind": b.kind,
                "stage": b.stage,
                "inputs": [_port(p) for p in b.inputs],
                "outputs": [_port(p) for p in b.outputs],
                "feedthrough": [list(pair) for pair in b.feedthrough],
                "update": b.update and {"period": b.update.period, "offset": b.update.offset},
            }
            for b in graph.blocks
        ],
        "edges": [
            {
                "source": made(e.source, e.output),
                "target": read(e.target, e.input),
                "size": e.size,
                "type": e.type,
            }
            for e in graph.edges
        ],
        "inputs": [terminal(t, read) for t in graph.inputs],
        "outputs": [terminal(t, made) for t in graph.outputs],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _port(port: Port) -> dict[str, Any]:
    return {"name": port.name, "size": port.size, "type": port.type}
