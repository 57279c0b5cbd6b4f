"""The pages of the notebooks and of the script on one page: everything is shown, formulas as pictures."""

import ast
import re

import pytest

from .conftest import ROOT

scripts = pytest.importorskip("site_pages.scripts")


@pytest.fixture(scope="module")
def pages():
    return scripts.pages()


def test_every_notebook_has_a_page_with_its_plots(pages):
    names = {f"notebooks/{path.stem}.md" for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert names == {name for name in pages if name.startswith("notebooks/")}
    assert all("data:image/png;base64," in pages[name] for name in names)


def test_formulas_are_pictures(pages):
    texts = [re.sub(r"````.*?````|^    .*?$", "", pages[name], flags=re.S | re.M) for name in pages]
    assert not any("$" in text for text in texts)
    assert sum(text.count('<svg class="formula"') for text in texts) > 10


def test_the_script_on_one_page_is_whole(pages):
    source = (ROOT / scripts.ONE_PAGE).read_text("utf-8")
    shown = "\n".join(re.findall(r"````python\n(.*?)````", pages["one_page.md"], flags=re.S))
    assert [ast.dump(node) for node in ast.parse(shown).body] == [ast.dump(node) for node in ast.parse(source).body[1:]]
