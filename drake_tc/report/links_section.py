"""The report's section on links whose inertial parameters were fitted."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.report.numbers import interval, percent, pretty_unit, significant
from drake_tc.report.words import natural

ROUNDING = 1e-12
"""Share of the largest end of an interval below which a value of the robot file is rounding."""


@dataclass(frozen=True)
class LinkRow:
    """One parameter as the template shows it: texts only.

    Attributes:
        name, declared, value, interval, unit: Of the parameter.
        left: Share of the declared tolerance that is left; empty where there is none.
    """

    name: str
    declared: str
    value: str
    interval: str
    unit: str
    left: str = ""


@dataclass(frozen=True)
class LinksSection:
    """Rows by link, of the base parameters and of payloads by run; `summary` is the sentence before them."""

    summary: str
    links: Sequence[tuple[str, Sequence[LinkRow]]]
    base: Sequence[LinkRow]
    payloads: Sequence[tuple[str, Sequence[LinkRow]]]


def links_section(links: FittedLinks | None, *, wrong_set_up: bool = False) -> LinksSection | None:
    """The section; None where the links were not fitted."""
    if links is None:
        return None
    by_link: dict[str, list[LinkRow]] = {}
    for p in links.parameters:
        row = _row(p.name, _declared(p.declared, p.estimate), p.estimate, percent(p.narrowed))
        by_link.setdefault(p.link, []).append(row)
    base = [_row(p.name, _declared(p.declared, p.estimate), p.estimate) for p in links.base]
    payloads = [(run, [_row(n, "", e) for n, e in parameters.items()]) for run, parameters in links.payloads.items()]
    return LinksSection(links_sentence(links, wrong_set_up=wrong_set_up), list(by_link.items()), base, payloads)


def links_sentence(links: FittedLinks, *, wrong_set_up: bool = False) -> str:
    """What was fitted, in one sentence."""
    if wrong_set_up:
        return (
            "The links' inertial parameters were fitted with the wrong set-up; their values do not describe the robot."
        )
    apart = sum(not p.estimate.ci95[0] <= p.declared <= p.estimate.ci95[1] for p in links.base)
    return (
        f"The inertial parameters of {len({p.link for p in links.parameters})} links were fitted: "
        f"{len(links.base)} base parameters. "
        f"Base parameters whose value in the robot file lies outside the 95 % interval: {apart}."
    )


def payload_sentences(links: FittedLinks) -> Iterable[str]:
    """For each log with an unknown payload, its mass."""
    for run, parameters in links.payloads.items():
        mass = parameters["m"]
        value, spread = interval(mass.value, *mass.ci95)
        yield f"Payload in {run}: {value} kg, 95 % interval {spread} kg."


def _row(name: str, declared: str, estimate: Estimate, left: str = "") -> LinkRow:
    value, spread = interval(estimate.value, *estimate.ci95)
    return LinkRow(combination(name), declared, value, spread, pretty_unit(estimate.unit), left)


def combination(name: str) -> str:
    """A combination of parameters as an equation has it: equal coefficients are factored out, in the links' order.

    `a/mx +0.2 c/m +0.2 b/m -1 d/mz` becomes `a mx + 0.2 (b m + c m) − d mz`.
    """
    first, *rest = re.split(r" (?=[+-]\d)", name)
    by_factor: dict[str, list[str]] = {}
    for term in rest:
        factor, _, member = term.partition(" ")
        by_factor.setdefault(factor, []).append(member.replace("/", " "))
    shown = first.replace("/", " ")
    for factor, members in by_factor.items():
        sign, size = "−" if factor[0] == "-" else "+", factor[1:]
        joined = " + ".join(sorted(members, key=natural))
        if len(members) > 1 and (size != "1" or sign == "−"):
            joined = f"({joined})"
        shown += f" {sign} {joined}" if size == "1" else f" {sign} {size} {joined}"
    return shown


def _declared(value: float, estimate: Estimate) -> str:
    """The robot file's value; what is left of it by rounding counts as zero."""
    reach = max(abs(end) for end in (estimate.value, *estimate.ci95))
    return "0" if abs(value) < ROUNDING * reach else significant(value)
