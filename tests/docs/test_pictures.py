"""The record of the gallery's stored pictures is of them, and tells which files that draw them have changed since."""

import json
import re
import subprocess
from datetime import date

import pytest

from .conftest import ROOT

pictures = pytest.importorskip("site_pages.pictures")
GROUPS = pictures.listed()
RECORD = json.loads(pictures.RECORD.read_text("utf-8"))
OLDEST_DAYS = 31


@pytest.mark.parametrize("name", GROUPS)
def test_the_record_is_of_these_pictures(name):
    """A new picture needs a new record: `python docs/record_pictures.py NAME`."""
    now = {path: pictures.picture_digest((ROOT / path).read_bytes()) for path in GROUPS[name]["pictures"]}
    assert now == RECORD[name]["pictures"]
    assert len(RECORD[name]["commit"]) == 40 and re.fullmatch(r"\d{4}-\d\d-\d\d", RECORD[name]["date"])


@pytest.mark.parametrize("page", ["docs/gallery.md", "docs/tutorial.md", "docs/log_files.md", "README.md"])
def test_every_stored_picture_of_these_pages_is_listed(page):
    targets = re.findall(r"!\[[^\]]*\]\(([^)]+\.png)\)", (ROOT / page).read_text("utf-8"))
    shown = {((ROOT / page).parent / target).resolve().relative_to(ROOT).as_posix() for target in targets}
    assert shown and shown <= {path for said in GROUPS.values() for path in said["pictures"]}


@pytest.mark.parametrize("name", GROUPS)
def test_no_picture_is_much_older_than_what_draws_it(name):
    """Pictures are made anew by `make pictures` within a month of a change."""
    changed = [path for path in pictures.changed(GROUPS[name], RECORD[name]) if (ROOT / path).exists()]
    asked = subprocess.run(
        ["git", "log", "-1", "--format=%cs", "--", *changed], cwd=ROOT, capture_output=True, text=True
    )
    if not changed or asked.returncode != 0 or not asked.stdout.strip():
        return
    age = date.fromisoformat(asked.stdout.strip()) - date.fromisoformat(RECORD[name]["date"])
    assert age.days <= OLDEST_DAYS, f"make pictures NAMES={name}: changed since {RECORD[name]['date']}: {changed}"


def test_every_pattern_has_files():
    patterns = [pattern for said in GROUPS.values() for pattern in said["drawn_by"]]
    assert [pattern for pattern in patterns if not pictures.drawing_files([pattern])] == []


def test_docstrings_and_comments_do_not_count():
    plain = b"def f(x):\n    return x\n"
    told = b'"""About."""\n\n\ndef f(x):\n    """Of x."""\n    # as it is\n    return x\n'
    assert pictures.drawing_digest("a.py", plain) == pictures.drawing_digest("a.py", told)
    assert pictures.drawing_digest("a.py", plain) != pictures.drawing_digest(
        "a.py", plain.replace(b"return x", b"pass")
    )
    assert pictures.drawing_digest("a.css", plain) != pictures.drawing_digest("a.css", told)


def test_the_page_names_what_has_changed(monkeypatch, tmp_path):
    folder = tmp_path / "report"
    folder.mkdir()
    for name in ("same.css", "other.css", "new.css"):
        (folder / name).write_text(name, encoding="utf-8")
    said = {"title": "Report", "made_with": "`make demo`", "pictures": ["images/a.png"], "drawn_by": ["report/*.css"]}
    drawn = {"report/same.css": pictures.picture_digest(b"same.css"), "report/other.css": "0", "report/gone.css": "0"}
    stored = {"commit": "a" * 40, "date": "2026-01-02", "pictures": {}, "drawn_by": drawn}
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    assert pictures.changed(said, stored) == ["report/gone.css", "report/new.css", "report/other.css"]
    monkeypatch.setattr(pictures, "listed", lambda: {"report": said})
    monkeypatch.setattr(pictures, "RECORD", tmp_path / "pictures.json")
    (tmp_path / "pictures.json").write_text(json.dumps({"report": stored}), encoding="utf-8")
    text = pictures.overview()
    assert "(`a.png`): commit `aaaaaaaaaaaa`, 2026-01-02, by `make demo`." in text
    assert "changed since" in text and "`report/other.css`" in text and "same.css" not in text
