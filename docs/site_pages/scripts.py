"""Pages of what runs from top to bottom: the notebooks as they are stored, and the script of the loop on one page."""

import ast
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from matplotlib import rc_context
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

from site_pages.repository import ROOT, page_of

ONE_PAGE = "diagrams/one_page.py"
SHOWN_FIRST = ("image/svg+xml", "image/png", "text/html", "text/plain")
"""Kinds of an output, the one that is shown first."""
ESCAPES = re.compile(r"\x1b\[[0-9;]*m")
FORMULA = re.compile(r"(```.*?```|`[^`]*`|^    .*?$)|\$\$(.+?)\$\$|\$(.+?)\$", re.S | re.M)
"""Code, which is left as it is; a displayed formula; a formula in a sentence."""
LEFT_OUT = re.compile(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", re.S)
"""Parts of a picture that a page would take for its own."""


def pages() -> dict[str, str]:
    """Page to its text."""
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    texts = {f"notebooks/{path.name}": _notebook(json.loads(path.read_text("utf-8"))) for path in notebooks}
    texts[ONE_PAGE] = _script((ROOT / ONE_PAGE).read_text("utf-8"))
    return {page: text for source, text in texts.items() if (page := page_of(source)) is not None}


def _notebook(document: Mapping[str, Any]) -> str:
    """Texts, code and outputs of a stored notebook."""
    parts = []
    for cell in document["cells"]:
        text = "".join(cell["source"])
        parts.append(_fenced(text, "python") if cell["cell_type"] == "code" else FORMULA.sub(_formula, text))
        parts += [shown for output in cell.get("outputs", ()) if (shown := _output(output))]
    return "\n\n".join(parts) + "\n"


def _formula(found: re.Match[str]) -> str:
    """A formula as a picture of its own, in the colour of the text; the site fetches no script that would draw it."""
    code, displayed, inline = found.groups()
    if code is not None:
        return str(code)
    file, text = io.StringIO(), " ".join((displayed or inline).split())
    with rc_context({"mathtext.fontset": "stix", "savefig.transparent": True, "svg.hashsalt": "formula"}):
        depth = math_to_image(f"${text}$", file, prop=FontProperties(size=12), dpi=72, format="svg")
    drawn = LEFT_OUT.sub("", file.getvalue().partition("<svg")[2])
    shape = "display: block; margin: 1em 0" if displayed else f"vertical-align: {-depth:.2f}pt"
    return f'<svg class="formula" style="fill: currentColor; {shape}" {" ".join(drawn.split())}'


def _output(output: Mapping[str, Any]) -> str:
    if output["output_type"] == "stream":
        return _fenced("".join(output["text"]), "text")
    kinds = output.get("data", {})
    kind = next((kind for kind in SHOWN_FIRST if kind in kinds), "")
    content = "".join(kinds.get(kind, ""))
    if kind == "image/png":
        return f'<p><img alt="plot of the cell above" src="data:image/png;base64,{content.strip()}"></p>'
    if kind in ("image/svg+xml", "text/html"):
        return f'<div class="output">{content}</div>'
    return _fenced(content, "text") if content else ""


def _fenced(text: str, language: str) -> str:
    return f"````{language}\n{ESCAPES.sub('', text).rstrip()}\n````"


def _script(source: str) -> str:
    """A script in pieces: what the docstring of each definition says, and below it the definition."""
    tree, lines = ast.parse(source), source.splitlines()
    about = (ast.get_docstring(tree) or "").partition("\n\n")
    head = ("# The loop on one page", about[0], about[2], f"The file is `{ONE_PAGE}`. Its parts, from top to bottom:")
    return "\n\n".join([*head, *_pieces(tree.body[1:], lines)]) + "\n"


def _pieces(nodes: Sequence[ast.stmt], lines: Sequence[str]) -> Iterator[str]:
    start = nodes[0].lineno - 1
    for node, following in zip(nodes, [*nodes[1:], None], strict=True):
        if isinstance(following, ast.FunctionDef) or following is None or isinstance(node, ast.FunctionDef):
            end = len(lines) if following is None else following.lineno - 1
            said = ast.get_docstring(node) if isinstance(node, ast.FunctionDef) else None
            if said is not None and isinstance(node, ast.FunctionDef):
                yield f"## `{node.name}`\n\n{said}"
            yield _fenced("\n".join(lines[start:end]).strip("\n"), "python")
            start = end
