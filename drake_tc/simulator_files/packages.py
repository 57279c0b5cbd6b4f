"""Find a URDF: beside its YAML, or in an installed package."""

import os
import sys
from pathlib import Path

from drake_tc.config.files import is_file
from drake_tc.config.quoted import located
from drake_tc.errors import ParamsError

_SCHEME = "package://"


def _package_folders(name: str) -> list[Path]:
    """Folders that could be the package `name`: those of Python environments first, then ROS_PACKAGE_PATH."""
    shares = [Path(entry) / "cmeel.prefix" / "share" / name for entry in sys.path if entry]
    roots = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    return shares + [root / name for root in roots] + [root for root in roots if root.name == name]


def resolve(reference: str, folder: Path) -> Path:
    """The file that `reference` means.

    Args:
        reference: `package://NAME/path`, or a path relative to `folder`.
        folder: Of the file that holds the reference.

    Raises:
        ParamsError: there is no such file or package; the message says where it was looked for, and what to install.
    """
    if not reference.startswith(_SCHEME):
        path = folder / reference
        if not is_file(path):
            where = "" if Path(reference).is_absolute() else f" in {folder}"
            raise ParamsError(f"{located((reference,))}: no such file{where}")
        return path
    name, _, rest = reference.removeprefix(_SCHEME).partition("/")
    if name in ("", ".", ".."):
        raise ParamsError(f"{located((reference,))}: expected package://NAME/path with the name of a package")
    folders = [candidate for candidate in _package_folders(name) if candidate.is_dir()]
    if not folders:
        raise ParamsError(
            f"{located((reference,))}: package {name!r} is neither installed nor in ROS_PACKAGE_PATH;"
            ' robots of example-robot-data: pip install "drake-tc[robots]"'
        )
    for candidate in folders:
        path = candidate / rest
        if ".." in Path(rest).parts or Path(rest).is_absolute():
            raise ParamsError(f"{located((reference,))}: expected a path that stays inside the package {name!r}")
        if rest and is_file(path):
            return path
    raise ParamsError(f"{located((reference,))}: package {name!r} in {folders[0]} has no file {rest!r}")
