"""Sections on the export, on links that were fitted, and on causes that several joints share."""

import re
from dataclasses import replace

import pytest
from mailed import Undrawn

from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.applications import ExportErrors, ExportTrial
from drake_tc.diagnosis.result.links import BaseParameter, FittedLinks, LinkEstimate
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.report.data_files import result_json
from drake_tc.report.html import render
from drake_tc.report.numbers import percent
from drake_tc.report.sections import (
    cells,
    combination,
    headings,
    links_section,
    links_sentence,
    payload_sentences,
    shared_section,
)

ROWS = (ExportErrors("knee", "sine", 2.06e-5, 1.18e-3, 3.96e-3), ExportErrors("knee", "walk", 3e-5, None, None))
TRIAL = ExportTrial("mjcf", "MuJoCo (MJCF)", "MuJoCo", "model_after.yaml", ("knee: MuJoCo has no <dead zone>.",), ROWS)


def text_of(html):
    found = re.search(r'<section id="export">(.*?)</section>', html, re.S)
    return "" if found is None else " ".join(re.sub(r"<[^>]+>", " ", found[1]).replace("\u00a0", " ").split())


def test_errors_have_one_prefix_and_a_dash_where_nothing_ran():
    assert headings(ROWS, "MuJoCo")[2:] == ("model after (Drake)", "export (MuJoCo)", "your file (MuJoCo)")
    assert [[c.replace("\u00a0", " ") for c in row[2:]] for row in cells(ROWS)] == [
        ["0.0206 mrad", "1.18 mrad", "3.96 mrad"],
        ["0.0300 mrad", "–", "–"],
    ]


def test_a_column_that_nothing_is_in_is_left_out():
    alone = tuple(replace(row, original=None) for row in ROWS)
    assert headings(alone, "MuJoCo")[-1] == "export (MuJoCo)" and {len(row) for row in cells(alone)} == {4}


def test_the_report_shows_the_trial(result):
    text = text_of(render(replace(result, joints={}, export=TRIAL)))
    assert "0.0206 mrad 1.18 mrad 3.96 mrad" in text and "knee: MuJoCo has no &lt;dead zone&gt;." in text
    assert "drake-tc export model_after.yaml --to mjcf" in text
    assert text_of(render(replace(result, joints={}))) == ""


def test_report_json_has_the_errors(result):
    document = result_json(replace(result, export=TRIAL))["export"]
    assert document["free_runs"][0] == {
        "joint": "knee",
        "run": "sine",
        "model": 2.06e-5,
        "export": 1.18e-3,
        "original": 3.96e-3,
        "unit": "rad",
    }
    assert document["runner"] == "MuJoCo" and result_json(result)["export"] is None


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
    assert section is not None and section["summary"] == told


def test_the_sentence_counts_what_differs_from_the_robot_file():
    assert "2 links" in links_sentence(LINKS) and "interval: 1." in links_sentence(LINKS)


def test_rows_have_value_interval_unit_and_what_is_left_of_the_tolerance():
    section = links_section(LINKS)
    assert section is not None
    (upper, rows), (lower, others) = section["links"]
    assert (upper, lower) == ("upper", "lower")
    assert (rows[0]["declared"], rows[0]["value"], rows[0]["unit"]) == ("2.00", "2.50", "kg")
    assert others[0]["unit"] == "kg·m" and others[0]["left"].startswith("98")
    assert section["base"][0]["name"] == "upper m + 0.5 lower m"


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
    assert section is not None and [row["declared"] for row in section["base"]] == ["0", "2.00"]


@pytest.fixture(scope="module")
def cause() -> SharedEffect:
    return SharedEffect(
        id="link_mass",
        where="thigh",
        title="mass of a link",
        parameters={"mass": Estimate(0.812, "kg", (0.79, 0.834), False)},
        heldout_gain=0.53,
        stability=0.99,
        joints={"knee": 0.71},
        indistinguishable=(("link_com", "thigh"),),
    )


def test_nothing_is_said_where_nothing_is_shared(result: CloseLoopResult):
    assert list(shared_section(result)) == []
    assert result_json(result)["shared"] == []


def test_the_section_names_cause_place_size_and_rival(result: CloseLoopResult, cause: SharedEffect):
    html = render(replace(result, shared=(cause,)), Undrawn())
    section = html[html.index('id="shared"') : html.index("</section>", html.index('id="shared"'))]
    shares = (percent(0.53), percent(0.71))
    for text in ("mass of a link", "thigh", "0.812", "kg", *shares, "centre of mass of a link (thigh)"):
        assert text in section, text
    assert 'href="#shared"' in html


def test_report_json_follows_the_contract(result: CloseLoopResult, cause: SharedEffect):
    (entry,) = result_json(replace(result, shared=(cause,)))["shared"]
    assert (entry["id"], entry["where"], entry["heldout_gain"]) == ("link_mass", "thigh", 0.53)
    assert entry["parameters"]["mass"] == {"value": 0.812, "unit": "kg", "ci95": [0.79, 0.834], "at_bound": False}
    assert entry["indistinguishable"] == [{"id": "link_com", "where": "thigh"}]


def test_a_late_encoder_is_not_explained_as_a_delay_of_all_drives(result: CloseLoopResult, cause: SharedEffect):
    late = Estimate(0.02, "s", (0.019, 0.021), at_bound=False)
    joint = next(iter(result.joints))
    for where, words in ((joint, "the delay of the encoder's readings"), ("all joints", "of every drive")):
        delay = replace(cause, id="delay", where=where, parameters={"delay": late}, indistinguishable=())
        (card,) = shared_section(replace(result, shared=(delay,)))
        assert words in card["meaning"]
