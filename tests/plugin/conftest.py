"""The plug-in package of this folder, installed as an installer would leave it, without a network."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

import drake_tc

PACKAGE = Path(__file__).parent / "package"
ROOT = Path(drake_tc.__file__).parents[1]


def install(package: Path, site: Path) -> None:
    """Copy the package into `site` and write the .dist-info folder that declares its entry points."""
    project = tomllib.loads((package / "pyproject.toml").read_text("utf-8"))["project"]
    shutil.copytree(package / "joint_extras", site / "joint_extras", ignore=shutil.ignore_patterns("__pycache__"))
    info = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    metadata = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    lines = []
    for group, points in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items()), ""]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    install(PACKAGE, folder)
    return folder


@pytest.fixture(scope="session")
def python(site) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run Python where the plug-in is installed: an environment of its own, so that this process never sees it."""

    def call(*arguments: object, cwd: Path | None = None, path: Path = site) -> subprocess.CompletedProcess[str]:
        paths = [str(path), str(ROOT), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        command = [sys.executable, *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=cwd, timeout=300)

    return call


COMMANDS = """
import contextlib, io, json, sys
from drake_tc.cli.main import run

said = []
for arguments in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        code = run(arguments)
    said.append((code, out.getvalue()))
print(json.dumps(said))
"""


@pytest.fixture(scope="session")
def commands(python) -> Callable[..., list[str]]:
    """commands(arguments, ...): what each `drake-tc` prints there, all of them in one process."""

    def call(*calls: list[str]) -> list[str]:
        ran = python("-c", COMMANDS, json.dumps(calls))
        assert ran.returncode == 0, ran.stderr
        said = json.loads(ran.stdout)
        assert [code for code, _ in said] == [0] * len(calls), ran.stderr
        return [out for _, out in said]

    return call
