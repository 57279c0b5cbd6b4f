"""A self-contained page of headings, sentences, tables and plots, in the style of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from drake_tc import __version__
from drake_tc.config.files import utf8_text


@dataclass(frozen=True)
class PageTable:
    """Rows of text under headings; columns named in `numbers` are set to the right."""

    headings: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    numbers: tuple[str, ...] = ()


@dataclass(frozen=True)
class PageSection:
    """One section: warnings, sentences, plots (SVG elements), tables."""

    heading: str
    paragraphs: Sequence[str] = ()
    warnings: Sequence[str] = ()
    plots: Sequence[str] = ()
    tables: Sequence[PageTable] = ()
    aside: str = ""


def plain_page(title: str, kicker: str, lead: Sequence[str], sections: Sequence[PageSection]) -> str:
    """The HTML of a page that fetches nothing.

    Args:
        title: Of the page, and its first heading.
        kicker: The small line above it.
        lead: Sentences below it.
        sections: In order.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["svg"] = Markup
    folder = files("drake_tc.report")
    template = environment.from_string((folder / "plain_page.html.jinja").read_text(encoding="utf-8"))
    page = template.render(
        title=title,
        kicker=kicker,
        lead=list(lead),
        sections=list(sections),
        style=Markup((folder / "report.css").read_text(encoding="utf-8")),
        version=__version__,
    )
    return utf8_text(page)
