"""The pages that explain the extension points: their files are the package's, their scripts run."""

import re
import tomllib

import pytest

from .conftest import PACKAGE, ROOT

PAGES = ("your_own_effect", "your_own_task")


def blocks(page: str, language: str) -> list[tuple[str, str]]:
    """(the file that the line before names, or "", text) of each block."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    found = re.findall(rf"(?:File `([^`]+)`:\n\n)?```{language}\n(.*?)```", text, flags=re.DOTALL)
    assert found, page
    return found


@pytest.mark.parametrize("page", PAGES)
def test_files_on_the_page_are_those_of_the_installed_package(page):
    files = [(name, text) for name, text in blocks(page, "python") if name]
    assert files
    for name, text in files:
        assert text == (PACKAGE / name).read_text("utf-8")


@pytest.mark.parametrize("page", PAGES)
def test_entry_points_on_the_page_are_those_of_the_package(page):
    declared = tomllib.loads((PACKAGE / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]
    for _, text in blocks(page, "toml"):
        for group, points in tomllib.loads(text)["project"]["entry-points"].items():
            assert points == declared[group]


SCRIPTS = [(page, number) for page, count in (("your_own_effect", 2), ("your_own_task", 2)) for number in range(count)]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "number"), SCRIPTS)
def test_scripts_on_the_page_run(page, number, python, tmp_path):
    """Where the package is importable but, as on the page, not installed with its entry points."""
    scripts = [text for name, text in blocks(page, "python") if not name]
    assert len(scripts) == len([p for p, _ in SCRIPTS if p == page])
    ran = python("-c", scripts[number], cwd=tmp_path, path=PACKAGE)
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    expected = EXPECTED.get((page, number))
    if expected:
        assert re.search(expected, ran.stdout), ran.stdout


EXPECTED = {
    ("your_own_effect", 0): r"seal_drag \{'cosine_drag': 0\.2[45]\d*, 'sine_drag': -0\.(39|4)",
    ("your_own_task", 1): r"'knees'.*'joint power'",
}
