"""The export in the report: three errors side by side with one unit, and what is lost."""

import re
from dataclasses import replace

from drake_tc.diagnosis.result.applications import ExportErrors, ExportTrial
from drake_tc.report.html import render
from drake_tc.report.report_json import result_json
from drake_tc.report.sections import cells, headings

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
