"""Pages of the repository outside of docs/ that the site shows too, and links between repository files.

Every page is written with links that work in the repository. On the site a link to a file that the site shows leads to
its page, and a link to any other file of the repository becomes the name of that file.
"""

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHOWN = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "drake_tc/diagnosis/README.md": "methods/diagnosis.md",
    "drake_tc/experiments/README.md": "methods/experiments.md",
    "drake_tc/analysis/README.md": "methods/analysis.md",
    "drake_tc/analysis/TUNING.md": "methods/tuning.md",
    "drake_tc/tsid/README.md": "methods/tsid.md",
    "drake_tc/tsid/qp.md": "methods/qp.md",
    "drake_tc/estimation/base.md": "methods/base_estimation.md",
    "tests/benchmarks/REAL_LOGS.md": "real_logs.md",
    "diagrams/README.md": "methods/diagrams.md",
    "diagrams/limits.md": "methods/diagram_limits.md",
    "diagrams/humanoid_tsid.md": "methods/humanoid_tsid.md",
    "diagrams/sea_joint.md": "methods/sea_joint.md",
    "diagrams/papers/faraji2015/README.md": "methods/faraji2015.md",
    "models/README.md": "methods/models.md",
    "drake_tc/logs/RIG.md": "reference/rig.md",
    "diagrams/one_page.py": "one_page.md",
}
"""File of the repository to its page."""
IMAGES = ("notebooks/images", "docs/images")
"""Folders whose pictures the site shows, as images/NAME."""
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"(^```.*?^```$)", re.M | re.S)


def page_of(path: str) -> str | None:
    """Site page of a file of the repository; None where the site does not show it."""
    if path in SHOWN:
        return SHOWN[path]
    if path.startswith("docs/") and path.endswith(".md"):
        return path.removeprefix("docs/")
    if path.startswith("notebooks/") and path.endswith(".ipynb"):
        return path.removesuffix(".ipynb") + ".md"
    folder, _, name = path.rpartition("/")
    return f"images/{name}" if folder in IMAGES else None


def source_of(page: str) -> str:
    """File of the repository behind a site page."""
    if page.startswith("notebooks/"):
        return page.removesuffix(".md") + ".ipynb"
    return next((path for path, shown in SHOWN.items() if shown == page), f"docs/{page}")


def with_site_links(text: str, page: str) -> str:
    """The text of a page, its links turned to pages of the site. Code blocks stay as they are."""
    source = source_of(page)
    parts = _FENCE.split(text)
    parts[::2] = [_LINK.sub(lambda found: _link(found, source, page), part) for part in parts[::2]]
    return "".join(parts)


def _link(found: re.Match[str], source: str, page: str) -> str:
    mark, shown, target = found.groups()
    path, hash_, anchor = target.partition("#")
    if not path or ":" in path:
        return found[0]
    file = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    target_page = page_of(file)
    if target_page is not None:
        relative = posixpath.relpath(target_page, posixpath.dirname(page) or ".")
        return f"{mark}[{shown}]({relative}{hash_}{anchor})"
    return found[0] if not (ROOT / file).exists() else shown if shown.startswith("`") else f"`{shown}`"
