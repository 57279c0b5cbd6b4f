"""The report's structure: well formed, self-contained, complete, and made for any result."""

import re
import time
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from mailed import Mailed, Undrawn

from drake_tc.diagnosis.residual.unexplained import TimeStretch
from drake_tc.diagnosis.result.joint_result import Errors, JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.html import render, write_report
from drake_tc.report.plots.residual_plots import leftover_plots
from tests.benchmarks.times.machine import require

VOID = {"meta", "link", "br", "img", "hr", "input", "path", "use", "image", "rect", "circle"}


class Page(HTMLParser):
    """Checks that tags close in order, and keeps headings, ids, references and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.headings: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("src", "href", "xlink:href", "srcset", "action", "data", "poster"):
                self.references.append(value or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        depth = len(self.open)
        self.handle_starttag(tag, attrs)
        del self.open[depth:]

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("script", "style"):
            return
        self.text += data
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data.strip())


@pytest.fixture(scope="module")
def html(result: CloseLoopResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(result, path)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_every_tag_closes_and_no_id_repeats(page: Page) -> None:
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))


def test_nothing_is_fetched(html: str, page: Page) -> None:
    for reference in page.references:
        assert reference.startswith(("#", "data:image/png;base64,")), reference[:60]
        assert not reference.startswith("#") or reference[1:] in page.ids
    assert re.findall(r"(?:https?:|file:|wss?:|\B//[a-z]+\.)[^\s\"'<>)]*", html) == [
        "https://github.com/leeoniya/uPlot"
    ]
    assert not re.search(
        r"@import|javascript:|\bfetch\(|XMLHttpRequest|WebSocket|sendBeacon|importScripts|\bimport\(", html
    )
    assert not {"link", "iframe", "object", "embed"} & set(page.tags)
    assert "default-src 'none'" in html
    for target in re.findall(r"url\(([^)]*)\)", html):
        assert target.strip("'\"").lstrip("#") in page.ids


def test_the_plotting_script_is_loaded_only_where_it_is_used(html: str, result: CloseLoopResult) -> None:
    assert "var uPlot" in html and "MIT Licensed" in html
    without = render(replace(result, joints={}))
    assert "<script" not in without


def test_plots_follow_the_pages_colours(html: str) -> None:
    style = html[: html.index("</style>")]
    used = set(re.findall(r"var\(--([\w-]+)\)", html))
    assert used <= set(re.findall(r"--([\w-]+):", style))
    assert "prefers-color-scheme: dark" in style
    assert {"ink", "grid", "forward", "backward", "before", "after"} <= used
    assert not re.search(r"(?:fill|stroke): #", html[html.index("</style>") : html.index("<script")])


def test_sections_come_in_the_readers_order(page: Page) -> None:
    wanted = ["Missing effects found", "Errors", "What was missing", "Measured and modelled effort", "Residual"]
    wanted += ["Spectrum", "Correlation", "Free run", "Equations", "Parameters"]
    wanted += ["What is left", "What was not added", "Data", "The models’ difference", "How the figures are computed"]
    found = [next(i for i, h in enumerate(page.headings) if h.startswith(w)) for w in wanted]
    assert found == sorted(found)


def test_the_numbers_and_words_are_there(page: Page, joint: JointResult) -> None:
    text = " ".join(page.text.split())
    assert "Missing in the model: Stribeck friction and torque ripple." in text
    assert "look for peaks at zero velocity" in text
    assert "cannot distinguish Stribeck friction from" in text
    assert "temperature not recorded" in text
    assert "at bound" in text
    assert "40.0 mrad" in text
    assert "position modulo 18° (20 a turn)" in text
    assert "slow: 3 rows filled" in text
    assert f"{1e3 * joint.before.heldout:#.3g} mA" in text
    assert f"{1e3 * joint.before.heldout / joint.final.gain:#.3g} mN·m".replace(". ", " ") in text
    assert "logs/a" not in text
    assert "fast.csv" in text
    assert "\\b" not in text


def test_several_joints_have_an_overview_and_names_cannot_break_the_page(
    result: CloseLoopResult, joint: JointResult, unexplained_joint: JointResult
) -> None:
    joints = {"knee": joint, "<hip> & co": unexplained_joint}
    page = Page(render(replace(result, joints=joints, verdict="unexplained_structure"), Undrawn()))
    assert {"#j0", "#j1"} <= set(page.references)
    assert len(page.ids) == len(set(page.ids))
    text = " ".join(page.text.split())
    assert page.open == []
    assert "hip" not in page.tags
    assert "<hip> & co" in text
    assert "fast from 2.0 to 3.5 s" in text
    assert "repeats at 4.20 Hz" in text
    assert "No free run" in text
    assert "Nothing needed repair" in text


def test_a_remainder_is_shown_against_what_it_depends_on(unexplained_joint: JointResult, joint: JointResult) -> None:
    panels = leftover_plots(unexplained_joint, "x")
    assert len(panels) == 3
    for panel, name in zip(panels, ("velocity", "load torque expected by the model", "time"), strict=True):
        assert f"residual against {name}, after, held-out runs" in panel
    left = replace(unexplained_joint.unexplained, confined_to=(TimeStretch("slow", 1.0, 2.0),))
    assert "training runs" in leftover_plots(replace(unexplained_joint, unexplained=left), "x")[0]
    assert leftover_plots(joint, "x") == []


@pytest.mark.parametrize("value", [float("nan"), pytest.param(0.0, marks=pytest.mark.slow)])
def test_no_figure_is_refused(result: CloseLoopResult, joint: JointResult, value: float) -> None:
    trace = joint.free_run["fast"]
    lone = {name: values for name, values in trace.items() if name != "before"}
    broken = replace(
        joint,
        noise_floor=value,
        before=Errors(value, value, value),
        after=Errors(value, value, None),
        unexplained=replace(joint.unexplained, explainable_rms=value, fraction=value),
        free_run={"fast": {**trace, "after": np.full(800, np.nan)}, "slow": lone},
    )
    made = render(replace(result, joints={"knee": broken}, model_before_yaml="", model_after_yaml=""))
    assert Page(made).open == []
    assert "No model files were written" in made


@pytest.mark.benchmark
def test_it_is_quick(result: CloseLoopResult, tmp_path: Path) -> None:
    def written() -> dict[str, float]:
        start = time.process_time()
        write_report(result, tmp_path / "report.html")
        return {"report": time.process_time() - start}

    require({"report": 4.0}, written, rounds=3)


def test_the_page_is_small_and_workers_draw_the_same_bytes_again(result: CloseLoopResult, html: str) -> None:
    assert len(html.encode()) < 3e6
    workers = Mailed()
    assert render(result, workers) == html
    assert set(workers.sent) == {"cloud_svg"} and len(workers.sent) > 8
