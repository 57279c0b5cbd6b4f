"""Pages of the reproduced papers: each figure with the value on record, what is expected, and the reason of a miss."""

from collections.abc import Iterable, Sequence

from drake_tc.config.page import table
from drake_tc.diagrams.papers.catalogue import REPRODUCTIONS
from drake_tc.diagrams.papers.expected_values import expectations, expected_file, on_record
from drake_tc.report.figure_row import Expectation, FigureRow, OnRecord, reproduced_row

PAPERS = {
    "A": ("delprete2016", "Del Prete et al. (2016): torque control without joint-torque sensors"),
    "B": ("delprete2015", "Del Prete and Mansard (2015): robust task-space inverse dynamics"),
    "C": ("faraji2015", "Faraji et al. (2015): a series-elastic humanoid"),
}
"""First letter of an id to the page of its paper, and its title."""


def pages() -> dict[str, str]:
    """Page to its text."""
    return {f"papers/{name}.md": _page(letter, title) for letter, (name, title) in PAPERS.items()}


def overview() -> str:
    """How many expected values of each reproduction are met, by the values on record."""
    rows = []
    for id_ in REPRODUCTIONS:
        name, _ = PAPERS[id_[0]]
        met = [row.met for row in _rows(expectations(expected_file(id_)).values())]
        rows.append((f"[`{id_}`](papers/{name}.md#{_anchor(id_)})", str(len(met)), str(sum(map(bool, met)))))
    return table(("id", "expected values", "met"), rows)


def _page(letter: str, title: str) -> str:
    ids = [id_ for id_ in REPRODUCTIONS if id_.startswith(letter)]
    head = (
        f"# {title}\n\nValues on record, computed with seed 0. `reproduce` prints them anew. Everything is simulated."
        " A value in bold misses what is expected."
    )
    return "\n\n".join([head, *(_section(id_) for id_ in ids)]) + "\n"


def _section(id_: str) -> str:
    expected = expectations(expected_file(id_))
    others = [each for name, each in on_record(expected_file(id_)).items() if name not in expected]
    parts = [f"## {id_}", f"    drake-tc reproduce {id_}", _expected_table(list(expected.values()))]
    reasons: dict[str, list[str]] = {}
    for row in _rows(expected.values()):
        if row.met is False and row.note:
            reasons.setdefault(row.note, []).append(row.name)
    if reasons:
        parts.append("**Misses**")
        parts.append("\n".join(f"- {'; '.join(map(_plain, names))}: {why}." for why, names in reasons.items()))
    if others:
        parts.append("**Other values**")
        parts.append(table(("figure", "value"), [(_plain(each.name), f"{each.reached:.4g}") for each in others]))
    return "\n\n".join(parts)


def _rows(expected: Iterable[Expectation]) -> list[FigureRow]:
    return [reproduced_row(each.name, each.reached, each) for each in expected if each.reached is not None]


def _expected_table(expected: Sequence[Expectation]) -> str:
    signs = {"min": "≥", "max": "≤", "within": "="}
    rows = []
    for each in expected:
        value = "–" if each.reached is None else f"{OnRecord(each.name, each.reached).reached:.4g}"
        missed = each.reached is not None and reproduced_row(each.name, each.reached, each).met is False
        slack = f" ± {each.tolerance:.4g}" if each.tolerance else ""
        goal = f"{signs[each.how]} {each.expected:.4g}{slack}"
        unit = each.unit if each.unit != "-" else ""
        rows.append((_plain(each.name), f"**{value}**" if missed else value, goal, unit, _plain(each.source)))
    return table(("figure", "value", "expected", "unit", "where the expectation comes from"), rows)


def _plain(text: str) -> str:
    """Text of a data file as Markdown: brackets and stars mean themselves."""
    return "".join(f"\\{letter}" if letter in "[]*_<" else letter for letter in text)


def _anchor(id_: str) -> str:
    return id_.lower().replace(".", "")
