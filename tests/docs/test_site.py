"""The documentation site builds without a warning, its links lead somewhere, and it loads nothing from elsewhere."""

import re
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest

from tests.benchmarks.times.machine import slowness

from .conftest import ROOT

FETCHING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}
"""Elements that make a browser fetch something, and where they say what."""


class Page(HTMLParser):
    """Ids, links, and what a browser fetches, of one page."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.fetched = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids |= {values[name] for name in ("id", "name") if values.get(name)}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        if tag in FETCHING and values.get(FETCHING[tag]) and values.get("rel") not in ("canonical", "prev", "next"):
            self.fetched.append(values[FETCHING[tag]])


@pytest.fixture(scope="module")
def pages(site):
    named = {path.relative_to(site.folder).as_posix(): path for path in site.folder.rglob("*.html")}
    named.pop("404.html", None)  # a server shows it at any depth, so its links begin at the root
    return {name: Page(path.read_text("utf-8")) for name, path in named.items()}


@pytest.mark.slow
def test_it_builds_without_a_warning(site):
    assert site.code == 0, site.said
    assert "WARNING" not in site.said


@pytest.mark.slow
def test_it_builds_within_a_minute_of_an_idle_processor(site):
    assert site.seconds < 60.0 * slowness()


@pytest.mark.slow
def test_links_lead_to_pages_and_headings(pages, site):
    broken = []
    for name, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or link.startswith("//"):
                continue
            target = (site.folder / name).parent / unquote(parts.path) if parts.path else site.folder / name
            target = target.resolve()
            if not target.exists():
                broken.append(f"{name}: {link}")
            elif parts.fragment and target.suffix == ".html":
                ids = pages[target.relative_to(site.folder.resolve()).as_posix()].ids
                if unquote(parts.fragment) not in ids:
                    broken.append(f"{name}: {link}")
    assert broken == []


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(pages, site):
    elsewhere = {f"{name}: {url}" for name, page in pages.items() for url in page.fetched if urlsplit(url).netloc}
    styles = "".join(path.read_text("utf-8") for path in site.folder.rglob("*.css"))
    elsewhere |= set(re.findall(r"(?:url\(|@import )['\"]?(?:https?:)?//[^)'\"]+", styles))
    assert elsewhere == set()


@pytest.mark.slow
@pytest.mark.parametrize("section", ["effects", "reference", "cli", "api", "methods", "notebooks", "papers"])
def test_every_section_has_pages(pages, section):
    assert len([name for name in pages if name.startswith(f"{section}/")]) >= 3


LONGEST = 900
"""Words of a text without a heading; tables and code are looked up, not read."""


def sources():
    folders = ("docs", "drake_tc", "diagrams", "models")
    return sorted({*ROOT.glob("*.md"), *(path for folder in folders for path in (ROOT / folder).rglob("*.md"))})


def anchors(page):
    """Of the headings of a page, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.S)
    titles = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title) for title in re.findall(r"^#+ (.*)$", text, re.M)]
    return {re.sub(r"[^\w\- ]", "", title.lower().strip()).replace(" ", "-") for title in titles}


def test_links_between_pages_lead_to_files_and_headings():
    """In the sources; pages of the commands are made with the site, and `test_which_command` has their names."""
    broken, seen = [], 0
    for path in sources():
        text = re.sub(r"```.*?```|`[^`\n]*`", "", path.read_text("utf-8"), flags=re.S)
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"[a-z]+:|cli/", link):
                continue
            name, _, heading = link.partition("#")
            target = path.parent / name if name else path
            seen += 1
            if not target.exists() or (heading and target.suffix == ".md" and heading not in anchors(target)):
                broken.append(f"{path.relative_to(ROOT)}: {link}")
    assert seen > 100 and broken == []


def test_every_page_of_the_repository_is_on_the_site():
    from site_pages.repository import page_of

    paths = [path.relative_to(ROOT).as_posix() for path in sources()]
    assert [path for path in paths if page_of(path) is None] == []


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_page_is_long_without_headings(path):
    text = re.sub(r"```.*?```", "", path.read_text("utf-8"), flags=re.S)
    read = "\n".join(line for line in text.splitlines() if not line.startswith(("|", "    ")))
    longest = max(len(part.split()) for part in re.split(r"^#{1,6} ", read, flags=re.M))
    assert longest <= LONGEST


def test_pages_name_no_path_of_one_machine():
    for path in sources():
        assert not re.search(r"/(home|work|tmp|Users|root)/", path.read_text("utf-8")), path
