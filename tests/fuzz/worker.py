"""Runs cases in one process, with a line before and after each: `python -m fuzz.worker FIRST LAST` in tests/."""

import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import yaml

from drake_tc.cli.main import run

from .cases import Case, case
from .sound import sound

LONGEST_LINE = 1500
SHORTENED = 40
LEAKS = re.compile(
    r"Traceback|has no attribute|NoneType|<class |KeyError|\bErrno\b|site-packages|not subscriptable|unhashable"
    r"|invalid literal|could not convert|expected str|must be str|argument of type|\bdict\b|\bndarray\b|object at 0x"
    r"|positional argument|zero-size array|broadcast|numpy array|\bpandas\b|codec can't|not iterable|Series|DataFrame"
    r"|math domain"
)
"""What only a Python programmer understands."""


@contextmanager
def captured(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Both streams of the process, C++ included, go to files; yields their paths."""
    paths = folder / "stdout", folder / "stderr"
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(stream) for stream in (1, 2)]
    old = sys.stdout, sys.stderr
    try:
        for stream, path in zip((1, 2), paths, strict=True):
            file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(file, stream)
            os.close(file)
        sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8", errors="surrogateescape")
        sys.stderr = os.fdopen(os.dup(2), "w", encoding="utf-8", errors="backslashreplace")
        yield paths
    finally:
        sys.stdout.close()
        sys.stderr.close()
        sys.stdout, sys.stderr = old
        for stream, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, stream)
            os.close(copy)


def evaluated(each: Case, code: int, out: str, err: str, folder: Path) -> list[str]:
    """What is wrong with the outcome of a case; nothing if it is right."""
    wrong = [] if code in (0, 2) else [f"exit code {code}"]
    lines = err.splitlines()
    if code == 2:
        ours = [line for line in lines if line.startswith("drake-tc: ")]
        if len(ours) != 1 or lines[-1] != ours[0]:
            wrong.append(f"{len(ours)} lines of ours of {len(lines)}")
        if out and not out.startswith("{"):
            wrong.append("stdout of a refusal")
        wrong += _line(ours[-1], each, folder) if ours else []
    said = ("drake-tc: ", "reading ", "next: ", each.arguments[0] if each.arguments else "-")
    wrong += [f"line on stderr: {line[:200]}" for line in lines if not line.startswith(said)]
    if re.search(r"Warning|Traceback", err):
        wrong.append("a warning or traceback on stderr")
    return wrong + _cut(folder)


def _line(line: str, each: Case, folder: Path) -> list[str]:
    """What is wrong with the one line of a refusal."""
    wrong = []
    if len(line) > LONGEST_LINE:
        wrong.append(f"a line of {len(line)} characters")
    if found := LEAKS.search(line):
        wrong.append(f"leaks Python: {found[0]}")
    if not line.isprintable():
        wrong.append("characters that are not printable")
    given = {*each.arguments, *(str(Path(argument)) for argument in each.arguments)}
    arguments = {argument[:SHORTENED] for argument in given}  # a line quotes the begin of a long one
    names = {path.name for path in folder.rglob("*")} | arguments | set(map(_escaped, arguments))
    told = any(name and name in line for name in names) or "--" in line or "scenario text" in line
    if not told:
        wrong.append("names no file and no argument")
    return wrong


def _escaped(text: str) -> str:
    return ascii(text)[1:-1]


def _cut(folder: Path) -> list[str]:
    """Results that are not whole, and scratch folders that were left."""
    wrong = [f"left behind: {path.name}" for path in folder.rglob(".drake-tc-*")]
    for path in (folder / "out").rglob("*"):
        try:
            if path.suffix == ".yaml":
                yaml.safe_load(path.read_text(encoding="utf-8"))
            elif path.suffix == ".json" and path.is_file():
                json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, yaml.YAMLError):
            wrong.append(f"cut: {path.name}")
    return wrong


def run_case(number: int, files: "object", folder: Path) -> dict[str, object]:
    """Run one case; what it was and what is wrong with it."""
    place = folder / "case"
    place.mkdir()
    each = case(number, files, place)  # type: ignore[arg-type]
    begin = time.monotonic()
    with captured(folder) as (out, err):
        try:
            code = run(each.arguments)
        except BaseException as error:
            print(f"Traceback: {type(error).__name__}: {error}", file=sys.stderr)
            code = -1
    texts = [path.read_text(encoding="utf-8", errors="replace") for path in (out, err)]
    wrong = evaluated(each, code, texts[0], texts[1], place)
    return {
        "number": number,
        "kind": each.kind,
        "code": code,
        "seconds": round(time.monotonic() - begin, 3),
        "wrong": wrong,
        "arguments": [argument[:200] for argument in each.arguments],
        "err": texts[1][-2000:],
    }


def main(arguments: Sequence[str]) -> None:
    """Run the cases FIRST to LAST - 1."""
    first, last = map(int, arguments)
    files = sound()
    here = Path.cwd()
    for number in range(first, last):
        print(json.dumps({"begin": number}), flush=True)
        with tempfile.TemporaryDirectory(prefix="fuzz") as folder:
            os.chdir(folder)
            found = run_case(number, files, Path(folder))
            os.chdir(here)
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
