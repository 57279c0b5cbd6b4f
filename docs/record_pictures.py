"""Store when pictures of docs/pictures.yaml were made, and a digest of each file that draws them at that commit.

A picture that is committed was made at its last commit, one that is not at the commit which is checked out.

usage: record_pictures.py [NAME ...]        all groups without a name
"""

import json
import subprocess
import sys
from pathlib import PurePosixPath
from typing import Any

from site_pages.pictures import RECORD, ROOT, drawing_digest, listed, picture_digest


def record(name: str, known: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """What pictures.json says of one group.

    Args:
        name: A key of pictures.yaml.
        known: What pictures.yaml says.

    Raises:
        SystemExit: no such name, or new pictures with uncommitted changes of the files that draw them.
    """
    if name not in known:
        sys.exit(f"no group {name!r}; groups of pictures: {', '.join(known)}")
    said = known[name]
    commit = _git("log", "-1", "--format=%H", "--", *said["pictures"])
    if _git("status", "--porcelain", "--", *said["pictures"]):
        if _git("status", "--porcelain", "--", *(f":(glob){pattern}" for pattern in said["drawn_by"])):
            sys.exit(f"{name}: what draws the pictures has uncommitted changes: commit them first")
        commit = _git("rev-parse", "HEAD")
    drawing = {path: drawing_digest(path, _content(commit, path)) for path in _files(commit, said["drawn_by"])}
    pictures = {path: picture_digest((ROOT / path).read_bytes()) for path in said["pictures"]}
    date = _git("log", "-1", "--format=%cs", commit)
    return {"commit": commit, "date": date, "pictures": pictures, "drawn_by": drawing}


def _files(commit: str, patterns: list[str]) -> list[str]:
    paths = _git("ls-tree", "-r", "--name-only", commit).splitlines()
    return [path for path in paths if any(PurePosixPath(f"/{path}").match(f"/{p}") for p in patterns)]


def _content(commit: str, path: str) -> bytes:
    return subprocess.run(["git", "show", f"{commit}:{path}"], cwd=ROOT, check=True, capture_output=True).stdout


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    groups = listed()
    stored = json.loads(RECORD.read_text("utf-8")) if RECORD.exists() else {}
    stored |= {each: record(each, groups) for each in sys.argv[1:] or groups}
    RECORD.write_text(json.dumps({each: stored[each] for each in groups}, indent=1) + "\n", encoding="utf-8")
