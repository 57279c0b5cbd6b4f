"""Block graphs as SVG, Graphviz DOT, Mermaid and JSON.

The SVG has plain classes and colours, so that browsers and vector editors agree. DOT has one cluster a stage and
records with named ports; Mermaid one subgraph a stage and edges labelled output → input and width. The JSON is

{"schema": 1, "diagram":, "stages": [names],
 "blocks": [{"path":, "name":, "kind":, "stage":, "inputs": [port], "outputs": [port], "feedthrough": [[input, output]],
             "update": {"period":, "offset":} or null}],
 "edges": [{"source": {"block":, "port":}, "target": {"block":, "port":}, "size":, "type":}],
 "inputs": [{port, "ends": [{"block":, "port":}]}], "outputs": [same]}
with port = {"name":, "size":, "type":}; blocks are named by path, ports of a block by name; times in seconds.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from itertools import pairwise
from typing import Any

from drake_tc.report.block_graph.layout import Drawing, ShaftEffect, Wire, layout
from drake_tc.report.block_graph.place import EDGE, LABEL, NOTE, PIN, TITLE, text_width
from drake_tc.report.block_graph.view import SHOWN_STAGES, STAGES, GraphData, Pin, Port, Shape, Terminal, View

MARGIN = 18.0
HEADING, STAGE, LEGEND = 15.0, 9.5, 9.0
"""Font sizes [px]."""
TOP = 30.0
"""Height of the heading [px]."""
ROUND = 4.0
"""Radius of a signal's corners [px]."""
ARROW = 6.0
KEY = (
    "number on a signal: its width;  T, T[]: abstract value, list of them",
    "● output follows an input at the same instant   ○ output follows the state only",
)


def svg(picture: View) -> str:
    """The SVG document of a picture."""
    drawing = layout(picture)
    wide = max(drawing.width, text_width(picture.title, HEADING, bold=True), max(text_width(k, LEGEND) for k in KEY))
    width, height = wide + 2.0 * MARGIN, drawing.height + TOP + 34.0 + 2.0 * MARGIN
    below = TOP + drawing.height + 20.0
    style = (files("drake_tc.report.block_graph") / "block_graph.css").read_text(encoding="utf-8")
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(width)}" height="{_n(height)}" '
        f'viewBox="0 0 {_n(width)} {_n(height)}" role="img" class="bg" '
        f'aria-label="Block graph of {_e(drawing.title)}">',
        f"<style>\n{style.strip()}\n</style>",
        '<rect class="paper" width="100%" height="100%"/>',
        f'<g transform="translate({_n(MARGIN)} {_n(MARGIN)})">',
        _text(Entry(0.0, HEADING, drawing.title, "heading", HEADING, bold=True)),
        f'<g transform="translate(0 {_n(TOP)})">',
        *_regions(drawing),
        *(line for wire in drawing.wires for line in _wire(wire, drawing.blocks)),
        *(line for block in drawing.blocks for line in _block(block)),
        "</g>",
        *(_text(Entry(0.0, below + 14.0 * i, key, "note", LEGEND)) for i, key in enumerate(KEY)),
        "</g>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _regions(drawing: Drawing) -> Iterator[str]:
    for region in drawing.regions:
        box = f'x="{_n(region.x)}" y="{_n(region.y)}" width="{_n(region.width)}" height="{_n(region.height)}"'
        yield f'<rect class="region {region.stage}" {box} rx="6"/>'
        name, look = region.stage.upper(), f"stage {region.stage}"
        yield _text(Entry(region.x + 10.0, region.y + 15.0, name, look, STAGE, bold=True))


def _wire(wire: Wire, blocks: Sequence[ShaftEffect]) -> Iterator[str]:
    stage = next(b.box.shape.stage for b in blocks if b.box.shape.key == wire.net.source[0])
    look = f"{stage}{' dim' if wire.net.dim else ''}"
    yield f'<g class="wire {look}">'
    yield f'<path d="{" ".join(_path(line) for line in wire.lines)}"/>'
    for line in wire.lines:
        (ax, _), (x, y) = line[-2:]
        back = ARROW if x > ax else -ARROW
        yield f'<polygon points="{_n(x)},{_n(y)} {_n(x - back)},{_n(y - 3.2)} {_n(x - back)},{_n(y + 3.2)}"/>'
    for x, y in branch_points(wire.lines):
        yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="2.3"/>'
    x, y, width = label_box(wire)
    yield _text(Entry(x, y - 3.0, wire.net.label, "", LABEL), length=width)
    yield "</g>"


def label_box(wire: Wire) -> tuple[float, float, float]:
    """Left end, line and width of a signal's label [px]."""
    width = text_width(wire.net.label, LABEL)
    x, y = wire.start
    return (x + 7.0 if wire.direction > 0 else x - 7.0 - width), y, width


def branch_points(lines: Sequence[Sequence[tuple[float, float]]]) -> list[tuple[float, float]]:
    """Where a signal's lines part: points from which it runs to three sides or four."""
    pieces = {tuple(sorted(piece)) for line in lines for piece in pairwise(line)}
    found = []
    for x, y in sorted({point for line in lines for point in line}):
        sides = set()
        for (ax, ay), (bx, by) in pieces:
            if ax == bx == x and ay <= y <= by:
                sides |= ({"up"} if ay < y else set()) | ({"down"} if y < by else set())
            if ay == by == y and ax <= x <= bx:
                sides |= ({"left"} if ax < x else set()) | ({"right"} if x < bx else set())
        if len(sides) > 2:
            found.append((x, y))
    return found


def _path(line: Sequence[tuple[float, float]]) -> str:
    """A polyline with rounded corners."""
    parts = [f"M{_n(line[0][0])} {_n(line[0][1])}"]
    for (ax, ay), (x, y), (bx, by) in zip(line, line[1:], line[2:], strict=False):
        before, after = abs(x - ax) + abs(y - ay), abs(bx - x) + abs(by - y)
        r = min(ROUND, before / 2.0, after / 2.0)
        sx, sy = x + (ax - x) / before * r, y + (ay - y) / before * r
        ex, ey = x + (bx - x) / after * r, y + (by - y) / after * r
        parts.append(f"L{_n(sx)} {_n(sy)}Q{_n(x)} {_n(y)} {_n(ex)} {_n(ey)}")
    parts.append(f"L{_n(line[-1][0])} {_n(line[-1][1])}")
    return "".join(parts)


def _block(block: ShaftEffect) -> Iterator[str]:
    shape, box = block.box.shape, block.box
    terminal = not any(pin.name for pin in (*box.left, *box.right)) and shape.stage in ("inputs", "outputs")
    yield f'<g class="block {shape.stage}{" dim" if shape.dim else ""}">'
    corner = box.height / 2.0 if terminal else 3.0
    size = f'width="{_n(block.width)}" height="{_n(box.height)}" rx="{_n(corner)}"'
    yield f'<rect x="{_n(block.x)}" y="{_n(block.y)}" {size}/>'
    yield from map(_text, texts(block))
    for pin in box.left if block.flow < 0 else box.right:
        x = block.x if block.flow < 0 else block.x + block.width
        look = "pin" if pin.follows else "pin state"
        yield f'<circle class="{look}" cx="{_n(x)}" cy="{_n(block.y + box.heights["o", pin.index])}" r="2.7"/>'
    yield "</g>"


@dataclass(frozen=True)
class Entry:
    """One line of text: left end and base line [px], look, font size [px]."""

    x: float
    y: float
    text: str
    look: str
    size: float
    bold: bool = False


def texts(block: ShaftEffect) -> Iterator[Entry]:
    """All text inside a block."""
    box = block.box
    middle = block.x + block.width / 2.0
    y = block.y + 6.0 + TITLE
    yield Entry(middle - text_width(box.title, TITLE, bold=True) / 2.0, y, box.title, "title", TITLE, bold=True)
    for note in box.notes:
        y += NOTE + 3.0
        yield Entry(middle - text_width(note, NOTE) / 2.0, y, note, "note", NOTE)
    sides: Mapping[int, str] = {0: "i" if block.flow > 0 else "o", 1: "o" if block.flow > 0 else "i"}
    for s, pins in enumerate((box.left, box.right)):
        for pin in pins:
            width = text_width(pin.name, PIN)
            x = block.x + EDGE if s == 0 else block.x + block.width - EDGE - width
            if pin.name:
                yield Entry(
                    x, block.y + box.heights[sides[s], pin.index] + 3.3, pin.name, "port" if pin.used else "note", PIN
                )


def _text(entry: Entry, length: float | None = None) -> str:
    """A line of text held to the width that the layout counts with, whatever face the viewer has."""
    width = text_width(entry.text, entry.size, bold=entry.bold) if length is None else length
    name = f' class="{entry.look}"' if entry.look else ""
    fit = f' textLength="{_n(width)}" lengthAdjust="spacingAndGlyphs"' if entry.text else ""
    place = f'x="{_n(entry.x)}" y="{_n(entry.y)}"'
    return f'<text {place} font-size="{_n(entry.size)}"{fit}{name}>{_e(entry.text)}</text>'


def _n(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}".rstrip("0").rstrip(".")


def _e(text: str) -> str:
    """Text of an element or attribute; characters that XML does not allow become a replacement character."""
    legal = "".join(c if c in "\t\n" or (ord(c) >= 32 and not 0xD800 <= ord(c) < 0xE000) else "\ufffd" for c in text)
    return escape(legal)


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
            lines += [f'    b{s.key}["{"<br/>".join(_coded(t) for t in (s.title, *s.notes))}"]' for s in shapes]
            lines.append("  end")
    for net in picture.nets:
        source, output = net.source
        name = _name(picture.shapes[source].outputs, output)
        arrow = "-.->" if net.dim else "-->"
        for target, index in net.targets:
            ends = " → ".join(n for n in (name, _name(picture.shapes[target].inputs, index)) if n)
            label = _coded(f"{ends} ({net.label})" if ends else net.label)
            lines.append(f'  b{source} {arrow}|"{label}"| b{target}')
    dim = [f"b{s.key}" for s in picture.shapes if s.dim]
    if dim:
        lines += ["  classDef dim opacity:0.55", f"  class {','.join(dim)} dim"]
    return "\n".join(lines) + "\n"


def _name(pins: tuple[Pin, ...], index: int) -> str:
    return next(pin.name for pin in pins if pin.index == index)


def _coded(text: str) -> str:
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
