"""How functions on arrays are compiled, and where the machine code is kept.

Modules of compiled functions import Numba, so nobody imports them but through `calls.Kernel`, at the first call: a
command that needs none of them does not pay for Numba's import. Rules for a compiled function:

- An entry has an explicit signature of read-only C-contiguous inputs (`kernel`), so that no array compiles it again.
  Entries are compiled where their module is imported, so helpers stand above the entries that call them.
- What entries share are plain functions on arrays and scalars (`helper`), compiled into each entry. Arrays that differ
  in layout or in being read-only compile a helper once more, which costs seconds.
- Functions that call entries of other stages, and one-line equations, are put into their caller (`inlined`).
- The cache's folder has in its name the hash of all sources that an entry is made of: Numba itself does not notice
  that a helper in another file has changed. Where no cache can be written, every process compiles for itself; so does
  one whose sources are edited while it runs, as it may have loaded them before.

With the environment variable NUMBA_DISABLE_JIT=1 all of them run as Python, for coverage and for debuggers.
"""

import ast
import hashlib
import logging
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

from drake_tc.kernels import AT_IMPORT, states

F = TypeVar("F", bound=Callable[..., Any])

_LOG = logging.getLogger(__name__)
_SOURCES = Path(__file__).parent
_PACKAGE = "drake_tc.kernels."
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False}

REAL, WHOLE, FLAG = numba.float64, numba.int64, numba.boolean
"""Scalars of a signature."""


def _array(kind: Any, dimensions: int, *, readonly: bool) -> Any:
    return numba.types.Array(kind, dimensions, "C", readonly=readonly)


VECTOR, MATRIX = _array(REAL, 1, readonly=True), _array(REAL, 2, readonly=True)
"""Inputs of real numbers."""
INDEX, TABLE = _array(WHOLE, 1, readonly=True), _array(WHOLE, 2, readonly=True)
"""Inputs of whole numbers."""
OUT_VECTOR, OUT_MATRIX = _array(REAL, 1, readonly=False), _array(REAL, 2, readonly=False)
"""Arrays that are written."""


def together(*types: Any) -> Any:
    """Several inputs as one tuple; the entry gives them names: `Robot(*robot)`."""
    return numba.types.Tuple(types)


def interpreted() -> bool:
    """Whether all of them run as Python."""
    return bool(numba.config.DISABLE_JIT)


def helper(function: F) -> F:
    """A function that compiled functions call; compiled with each of them, for the types with which it is called."""
    compiled: F = numba.njit(**_OPTIONS)(function)
    return compiled


def kernel(*arguments: Any) -> Callable[[F], F]:
    """An entry: compiled for these types of arguments alone, or loaded from the cache.

    Args:
        arguments: Types, see the constants of this module.
    """

    def compiled(function: F) -> F:
        if numba.config.DISABLE_JIT:
            return function
        folder = cache_folder(function.__module__.removeprefix(_PACKAGE))
        if folder is None or not _is_cached(function, folder):
            _tell_once()
        if folder is None:
            without: F = numba.njit([arguments], **_OPTIONS)(function)
            return without
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            entry: F = numba.njit([arguments], cache=True, **_OPTIONS)(function)
        finally:
            numba.config.CACHE_DIR = before
        return entry

    return compiled


def sources_of(module: str, folder: Path = _SOURCES) -> tuple[Path, ...]:
    """The files that a module of compiled functions is made of: its own and, in turn, those that it imports."""
    found: dict[str, Path] = {}
    left = [module]
    while left:
        name = left.pop()
        path = folder / f"{name.replace('.', '/')}.py"
        if name in found or not path.is_file():
            continue
        found[name] = path
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith(_PACKAGE):
                names = [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
                left += [each.removeprefix(_PACKAGE) for each in names]
    return tuple(found[name] for name in sorted(found))


def sources_hash(module: str, folder: Path = _SOURCES) -> str:
    """Of the statements of these files, without comments and docstrings, and of Numba's version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sources_of(module, folder):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
                node.body = [part for part in node.body if not _is_text(part)]
        digest.update(f"{path.name}: {ast.dump(tree)}\n".encode())
    return digest.hexdigest()[:16]


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


@cache
def cache_folder(module: str) -> Path | None:
    """Where machine code is kept: `$NUMBA_CACHE_DIR`, else `$XDG_CACHE_HOME/drake_tc` or `~/.cache/drake_tc`.

    Returns:
        The folder of these sources below it; None where it cannot be written, or where a source was edited since this
        process started.
    """
    now = states(_SOURCES)
    if any(AT_IMPORT.get(path, now[path]) != now[path] for path in sources_of(module, _SOURCES)):
        _LOG.info("compiled kernels are not cached: their sources have changed since this process started")
        return None
    root = os.environ.get("NUMBA_CACHE_DIR")
    try:
        base = Path(root) if root else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drake_tc"
        folder = base / f"{module}-{sources_hash(module)}"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, RuntimeError) as error:
        _LOG.info("compiled kernels are not cached: %s", error)
        return None
    return folder


def _is_cached(function: Callable[..., Any], folder: Path) -> bool:
    return next(folder.rglob(f"*.{function.__qualname__}-*.nbi"), None) is not None


@cache
def _tell_once() -> None:
    sys.stderr.write("Compiling kernels (once) ...\n")
    sys.stderr.flush()


def inlined(function: F) -> F:
    """A part of an entry or of a helper, put into it before it is compiled.

    As a `compiling.helper` it would be a library of its own with a copy of each entry that it calls, and these copies
    would all be optimised anew: a dozen of them around Newton's method take minutes.
    """
    part: F = numba.njit(inline="always", error_model="numpy")(function)
    return part
