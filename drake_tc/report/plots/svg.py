"""Matplotlib figures as inline SVG in the page's colours: lines and text are vectors, clouds are bitmaps."""

import base64
import io
import re
from collections.abc import Mapping
from contextlib import AbstractContextManager

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image

INK, MUTED, GRID, SHADE = "#101112", "#515253", "#d1d2d3", "#e4e5e6"
FORWARD, BACKWARD = "#0170b1", "#c15201"
BEFORE, AFTER, REFINED = "#8a7d6c", "#0171b2", "#7d3f98"
_VARIABLES: Mapping[str, str] = {
    INK: "ink",
    MUTED: "muted",
    GRID: "grid",
    SHADE: "shade",
    FORWARD: "forward",
    BACKWARD: "backward",
    BEFORE: "before",
    AFTER: "after",
    REFINED: "refined",
}
"""Vector colours are CSS variables of the page, so that a plot follows the light or dark scheme."""

FORWARD_DOT, BACKWARD_DOT, REVERSAL_DOT = "#3d8fc7", "#d9803f", "#b0699b"
"""Bitmap colours read on light and dark paper; Okabe and Ito's blue, vermilion and purple, evened out."""

PIXELS_PER_INCH = 180
BITMAP_COLOURS = 32
DECIMALS = 2
"""Of coordinates, whose unit is 1/72 inch."""
_STYLE = {
    "svg.fonttype": "none",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.edgecolor": GRID,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "axes.titlelocation": "left",
    "axes.titley": 1.03,
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "path.simplify": True,
}


SCREEN_PIXELS_PER_INCH = 96
"""At which a notebook shows a figure in its own size."""


class NotebookFigure(Figure):
    """A figure that a notebook shows by itself, also where no plotting backend of a notebook is loaded."""

    def png(self) -> bytes:
        """The picture."""
        stream = io.BytesIO()
        self.savefig(stream, format="png", dpi=PIXELS_PER_INCH)
        return stream.getvalue()

    @property
    def screen_width(self) -> int:
        """Of the picture [pixels]."""
        return round(SCREEN_PIXELS_PER_INCH * float(self.get_figwidth()))

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        return self.png(), {"width": self.screen_width}


def new_figure(width: float, height: float) -> NotebookFigure:
    """An empty figure of width by height [inch] that draws in the page's style; use it inside `page_style`."""
    figure = NotebookFigure(figsize=(width, height))
    figure.subplots_adjust(
        left=0.5 / width, right=1.0 - 0.08 / width, bottom=0.42 / height, top=1.0 - 0.24 / height, hspace=0.12
    )
    figure.patch.set_alpha(0.0)
    FigureCanvasSVG(figure)
    return figure


def page_style(name: str) -> AbstractContextManager[None]:
    """Context in which figures are made and written; `name` keeps the ids of one plot apart from another's."""
    return mpl.rc_context({**_STYLE, "svg.hashsalt": name})


def to_svg(figure: Figure, label: str, pixels_per_inch: int = PIXELS_PER_INCH) -> str:
    """The figure as one `<svg>` element without ids that nothing uses, metadata, fixed size or outside references.

    Args:
        figure: Made by `new_figure`.
        label: What it shows, for readers who do not see it.
        pixels_per_inch: Of its bitmaps.
    """
    stream = io.StringIO()
    figure.savefig(stream, format="svg", dpi=pixels_per_inch, transparent=True)
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    used = set(re.findall(r"[(\"]#([\w-]+)", text))
    text = re.sub(r' id="([\w.-]+)"', lambda m: m.group(0) if m.group(1) in used else "", text)
    text = re.sub(r"font-family:[^;\"]*;?", "", text)
    text = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", text)
    text = re.sub(
        r"data:image/png;base64,([^\"]+)", lambda m: f"data:image/png;base64,{_fewer_colours(m.group(1))}", text
    )
    for colour, variable in _VARIABLES.items():
        text = text.replace(colour, f"var(--{variable})")
    text = _shorter(text)
    box = re.search(r'viewBox="[^"]*"', text)
    opening = f'<svg {box.group(0) if box else ""} role="img" aria-label="{_attribute(label)}">'
    text = re.sub(r"<svg[^>]*>", lambda _: opening, text, count=1)
    return re.sub(r"\s*\n\s*", "\n", text).strip()


def _shorter(text: str) -> str:
    """The same picture with rounded coordinates, without groups and turns that change nothing."""
    longer = re.compile(rf"(\d+\.\d{{{DECIMALS}}})\d+")
    text = re.sub(r"<[^>]*>", lambda tag: longer.sub(r"\1", tag.group(0)), text)  # in tags: labels keep their digits
    text = re.sub(r' transform="rotate\(-0 [^)]*\)"', "", text)
    text = re.sub(r"\s*\n(?=[LMQCz] ?)", "", text)
    text = re.sub(r"(?<=\d)\s*\n\"", '"', text)
    text = re.sub(r"(?<=[LM]) (?=[-\d])", "", text)
    while (
        shorter := re.sub(r"<g>\s*((?:<(?:path|use|text)\b[^>]*?(?:/>|>[^<]*</text>)\s*)*)</g>", r"\1", text)
    ) != text:
        text = shorter
    return text


def _fewer_colours(encoded: str) -> str:
    """The same bitmap (base64 of a PNG) with a palette: a third of the size, no visible change."""
    with Image.open(io.BytesIO(base64.b64decode(encoded))) as image:
        stream = io.BytesIO()
        small = image.convert("RGBA").quantize(BITMAP_COLOURS, method=Image.Quantize.FASTOCTREE)
        small.save(stream, format="png")  # `optimize` takes three times as long for 5 % fewer bytes
    return base64.b64encode(stream.getvalue()).decode("ascii")


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
