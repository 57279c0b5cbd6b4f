"""MkDocs hooks: pages that are generated when the site is built, its navigation, and links between repository files."""

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from site_pages import (
    api,
    benchmarks,
    commands,
    effects,
    graphs,
    papers,
    pictures,
    real_logs,
    references,
    repository,
    scripts,
)
from site_pages.navigation import navigation
from site_pages.units import UnitBrackets

ROOT = Path(__file__).resolve().parents[1]


def on_config(config: Any) -> Any:
    """The navigation lists the pages that exist; brackets with units are text."""
    config.markdown_extensions.append(UnitBrackets())
    config.nav = navigation(generated())
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add generated pages, and pages and pictures of the repository outside of docs/."""
    texts = generated()
    for page, text in texts.items():
        files.append(File.generated(config, page, content=text))
    for picture, text in graphs.pictures().items():
        files.append(File.generated(config, picture, content=text))
    for source, page in repository.SHOWN.items():
        if page not in texts:
            files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    for folder in repository.IMAGES:
        for picture in sorted((ROOT / folder).glob("*.*")):
            name = f"images/{picture.name}"
            if files.get_file_from_path(name) is None:
                files.append(File.generated(config, name, abs_src_path=str(picture)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links of repository files lead to pages of the site, and generated parts of a page take their places."""
    text = repository.with_site_links(markdown, page.file.src_uri)
    for name, part in PARTS.items():
        if (mark := f"<!-- generated: {name} -->") in text:
            text = text.replace(mark, part())
    return text


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """Options of a command are not broken at their hyphens."""
    return OPTIONS_IN_CODE.sub(lambda code: OPTION.sub(r'<span class="option">\1</span>', code[0]), html)


OPTIONS_IN_CODE = re.compile(r"(?<=<code>)(?:drake-tc |--)[^<]*")
OPTION = re.compile(r"(--[a-z-]+)")
PARTS = {
    "papers": papers.overview,
    "benchmarks": benchmarks.overview,
    "graphs": graphs.overview,
    "comparison": graphs.comparison,
    "pictures": pictures.overview,
    "real_logs": real_logs.overview,
}
"""Name in a comment `<!-- generated: NAME -->` of a page to what stands there on the site."""


_generated: dict[str, str] = {}


def generated() -> dict[str, str]:
    """Page to its text, made once a build."""
    if not _generated:
        for module in (effects, references, commands, papers, api, scripts):
            _generated.update(module.pages())
    return _generated
