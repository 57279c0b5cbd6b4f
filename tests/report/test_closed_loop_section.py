"""The report's closed loop and torque uncertainty: what is simulated is called so, what did not change has one row."""

import re
from dataclasses import replace

import numpy as np
import pytest

from drake_tc.cli.close_loop_command import print_summary
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.result.applications import ClosedLoop, JointClosedLoop, LoopFigures
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.data_files import loop_entry, result_json
from drake_tc.report.html import render
from drake_tc.report.sections import closed_loop_section

from .test_html import Page

SOFT = LoopFigures(2.4e-3, 6.1e-3, 0.9871, 2.0, 0.7, 0.0121, 2.5)
LOST = LoopFigures(np.nan, np.nan, 1.013, np.nan, np.nan, np.nan, np.nan)
TIME = np.linspace(0.0, 2.0, 200)


def a_joint(before, after, *, changed=True):
    error = 1e-3 * np.sin(TIME)
    gains = {"k6": 0.5, "k7": 0.01, "kp": 1.0}
    return JointClosedLoop(before, after, np.cos(TIME), 3.0 * error, error, changed, gains)


@pytest.fixture(scope="module")
def closed():
    worse = replace(SOFT, rms_error=4.8e-3, sensitivity_peak=2.9)
    joints = {
        "knee": a_joint(worse, SOFT),
        "hip <&>": a_joint(LOST, SOFT),
        "ankle": a_joint(SOFT, SOFT, changed=False),
    }
    plant, note = "the robot of leg.yaml", "With the model before compensated, the simulated robot ran away."
    return ClosedLoop(joints, plant, "Windows of 80 samples", "walk", 1.0, 4.5, TIME, changed=True, notes=(note,))


@pytest.fixture(scope="module")
def spread():
    covariance = np.array([[4.0, 1.0], [1.0, 1.0]]) * 1e-4
    pair = np.array([100.0, 50.0])
    return TorqueUncertainty(
        ("knee", "hip"), covariance, 0.001 * pair, 1e-4 * np.outer(pair, [1, 4]), 1e-4 * pair, pair, 9 * pair, 44.0, 0.1
    )


@pytest.fixture(scope="module")
def page_without_joints(result):
    """The report with its joints left out: they take seconds and are tested elsewhere."""
    return replace(result, joints={})


def text_of(html):
    return " ".join(Page(html).text.split())


def section_of(text):
    return text[text.index("Closed loop") : text.index("Torque uncertainty")]


def test_the_section_says_what_it_is(page_without_joints, closed, spread):
    html = render(replace(page_without_joints, closed_loop=closed, uncertainty=spread))
    page = Page(html)
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert page.headings.index("Closed loop, an upper bound") < page.headings.index("Torque uncertainty")
    assert page.headings.index("Torque uncertainty") < page.headings.index("The models’ difference")
    text = section_of(text_of(html))
    assert text.startswith("Closed loop, an upper bound simulated")
    assert "This is an upper bound of the improvement: the plant of the simulation is the model after" in text
    assert "Nothing here was measured" in text
    assert "ran away" in text
    assert "the motion of walk, 1.0 to 4.5 s" in text
    assert "4.80 mrad" in text and "2.40 mrad" in text and "2.0 ×" in text.replace("\u00a0", " ")
    assert "12.1 ms" in text.replace("\u00a0", " ") and "40°" in text
    assert "1.0130 unstable" in text
    assert "hip <&>" in text
    assert "the linear loop of hip <&> is unstable with the model before and stable with the model after" in text


def test_an_unchanged_joint_has_one_row(closed, page_without_joints):
    html = render(replace(page_without_joints, closed_loop=closed))
    table = html[html.index('<table class="loop">') :]
    rows = re.findall(r"<tr><th>.*?</tr>", table[: table.index("</table>")], flags=re.DOTALL)
    assert len(rows) == 5 + 1  # the head; two for each that changed
    assert sum("unchanged" in row for row in rows) == 1


def test_nothing_found_is_said_instead_of_two_equal_columns(closed, page_without_joints):
    joints = {"ankle": closed.joints["ankle"]}
    text = text_of(
        render(replace(page_without_joints, closed_loop=replace(closed, joints=joints, changed=False, notes=())))
    )
    assert "The model was not changed, so the loop is the same before and after" in text
    assert "model before compensated" not in text
    assert "upper bound of the improvement" not in text


def test_a_loop_that_was_not_made_is_one_sentence(page_without_joints):
    note = "No closed loop was made: the load of knee is unknown, so there is no plant to simulate."
    html = render(replace(page_without_joints, closed_loop=ClosedLoop({}, notes=(note,))))
    assert Page(html).open == []
    assert note in text_of(html)
    assert '<table class="loop">' not in html


def test_margins_alone_have_no_tracking(closed, page_without_joints):
    nothing = np.zeros(0)
    joint = replace(
        closed.joints["knee"],
        before=replace(SOFT, rms_error=np.nan, largest_error=np.nan),
        after=replace(SOFT, rms_error=np.nan, largest_error=np.nan),
        reference=nothing,
        error_before=nothing,
        error_after=nothing,
    )
    html = render(replace(page_without_joints, closed_loop=replace(closed, joints={"knee": joint}, time=None)))
    assert Page(html).open == []
    assert "tracking error, RMS" not in html
    assert "closed loop of knee" not in html


def test_the_console_does_not_call_a_loop_simulated_that_has_margins_alone(closed, result, tmp_path, capsys):
    nothing = np.zeros(0)
    none = replace(SOFT, rms_error=np.nan, largest_error=np.nan)
    joint = replace(a_joint(none, none), reference=nothing, error_before=nothing, error_after=nothing)
    print_summary(replace(result, closed_loop=replace(closed, joints={"knee": joint}, time=None, notes=())), tmp_path)
    said = " ".join(capsys.readouterr().out.split())
    assert "closed loop: tracking was not simulated; the report lists the margins of the linear loop" in said
    assert "not simulated to the end" not in said


def test_the_spread_of_the_torque_is_shown(spread, page_without_joints):
    text = text_of(render(replace(page_without_joints, uncertainty=spread))).replace("\u00a0", " ")
    assert "20.0 mN·m" in text and "[10.0, 40.0]" in text
    assert "Strongest correlation between two joints: 0.50 (knee and hip)" in text
    assert "100 of 900" in text
    assert "Closed loop" not in text
    apart = replace(spread, covariance=np.diag(np.diag(spread.covariance)), common_effective_samples=0.0)
    assert "only the diagonal" in text_of(render(replace(page_without_joints, uncertainty=apart)))


def test_without_either_there_is_no_section(page_without_joints):
    assert closed_loop_section(page_without_joints) is None
    assert "Closed loop" not in text_of(render(page_without_joints))


def test_report_json_has_it_by_joint(closed, spread, result: CloseLoopResult):
    document = result_json(replace(result, closed_loop=closed, uncertainty=spread))
    knee = document["joints"]["knee"]
    assert knee["closed_loop"]["before"]["rms_error"] == 4.8e-3
    assert knee["closed_loop"]["simulated"] is True
    assert knee["torque_uncertainty"]["sigma"] == pytest.approx(0.02)
    assert document["closed_loop"]["reference"] == {"run": "walk", "start": 1.0, "end": 4.5}
    assert loop_entry(closed, "hip <&>")["before"]["gain_margin"] is None  # NaN is no JSON
    nothing = result_json(result)
    assert nothing["closed_loop"] is None
    assert nothing["joints"]["knee"]["closed_loop"] is None
