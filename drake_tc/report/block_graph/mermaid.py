"""A block graph as a Mermaid flowchart: one subgraph a stage, edges labelled output → input and width."""

from drake_tc.report.block_graph.view import SHOWN_STAGES, Pin, View

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
