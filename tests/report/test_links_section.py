"""What the report says of links that were fitted."""

import pytest

from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.links import BaseParameter, FittedLinks, LinkEstimate
from drake_tc.report.sections import combination, links_section, links_sentence, payload_sentences


def estimate(value: float, half: float, unit: str = "kg") -> Estimate:
    return Estimate(value, unit, (value - half, value + half), False)


LINKS = FittedLinks(
    parameters=(
        LinkEstimate("upper", "m", 2.0, estimate(2.5, 0.1), 0.05),
        LinkEstimate("lower", "mx", 0.1, estimate(0.1, 0.2, "kg*m"), 0.98),
    ),
    base=(
        BaseParameter("upper/m +0.5 lower/m", 2.0, estimate(2.5, 0.1), {"upper/m": 1.0, "lower/m": 0.5}),
        BaseParameter("lower/mx", 0.1, estimate(0.1, 0.2, "kg*m"), {"lower/mx": 1.0}),
    ),
    payloads={"loaded": {"m": estimate(2.81, 0.06)}},
)


def test_no_section_where_no_links_were_fitted():
    assert links_section(None) is None


def test_values_of_a_wrong_set_up_are_not_compared_with_the_robot_file():
    told = links_sentence(LINKS, wrong_set_up=True)
    assert "wrong set-up" in told and "interval" not in told
    section = links_section(LINKS, wrong_set_up=True)
    assert section is not None and section.summary == told


def test_the_sentence_counts_what_differs_from_the_robot_file():
    assert "2 links" in links_sentence(LINKS) and "interval: 1." in links_sentence(LINKS)


def test_rows_have_value_interval_unit_and_what_is_left_of_the_tolerance():
    section = links_section(LINKS)
    assert section is not None
    (upper, rows), (lower, others) = section.links
    assert (upper, lower) == ("upper", "lower")
    assert (rows[0].declared, rows[0].value, rows[0].unit) == ("2.00", "2.50", "kg")
    assert others[0].unit == "kg·m" and others[0].left.startswith("98")
    assert section.base[0].name == "upper m + 0.5 lower m"


@pytest.mark.parametrize("part", ["loaded", "2.810 kg", "[2.750, 2.870] kg"])
def test_a_payload_is_told_with_its_interval(part):
    (sentence,) = payload_sentences(LINKS)
    assert part in sentence


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("link_2/my", "link_2 my"),
        ("a/mx +0.225 link_10/m +0.225 link_9/m -1 d/mz", "a mx + 0.225 (link_9 m + link_10 m) − d mz"),
        ("a/Ixx +1 b/Izz +1 a/Iyy -0.07 c/mz", "a Ixx + a Iyy + b Izz − 0.07 c mz"),
        ("a/Ixx -1 b/Izz -1 b/Iyy +1e-05 c/m", "a Ixx − (b Iyy + b Izz) + 1e-05 c m"),
    ],
)
def test_a_combination_reads_as_an_equation(name, shown):
    assert combination(name) == shown


def test_a_value_of_the_robot_file_that_is_rounding_is_zero():
    lost = BaseParameter("tip/mx", -1.03e-18, estimate(-0.003, 0.09), {"tip/mx": 1.0})
    section = links_section(FittedLinks(LINKS.parameters, (lost, LINKS.base[0]), {}))
    assert section is not None and [row.declared for row in section.base] == ["0", "2.00"]
