"""The pages of `docs/` that build diagrams: files and scripts run as they stand, on an arm, a leg and a humanoid."""

import json
import re
import runpy
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from optional import skip_without_robots

import drake_tc
from drake_tc.cli.main import run

ROOT = Path(drake_tc.__file__).parents[1]
PAGES = (
    "your_own_robot",
    "your_own_diagram",
    "your_own_humanoid",
    "diagram_commands",
    "random_contexts",
    "your_own_controller",
)


def blocks(page: str) -> list[tuple[str, str]]:
    """(the file that the line before names, or "" for a script, text) of each block of YAML or Python."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    return re.findall(r"(?:File `([^`]+)`:\n\n)?```(?:yaml|python)\n(.*?)```", text, flags=re.DOTALL)


def scripts(page: str) -> list[str]:
    return [text for name, text in blocks(page) if not name]


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    """A folder with the files of the pages."""
    skip_without_robots()
    path = tmp_path_factory.mktemp("pages")
    for page in PAGES:
        for name, text in blocks(page):
            if name:
                (path / name).write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def folder(pages, monkeypatch) -> Path:
    """The same, as the folder in which a reader works: its files are importable."""
    monkeypatch.chdir(pages)
    monkeypatch.syspath_prepend(pages)
    return pages


@pytest.fixture
def ran(folder, capsys, monkeypatch) -> Callable[..., str]:
    """ran(script): what a script prints, with arguments where it is a file; ran(command, ...): what `drake-tc` does."""

    def call(*words: str) -> str:
        if words[0].endswith(".py"):
            monkeypatch.setattr(sys, "argv", list(words))
            runpy.run_path(words[0], run_name="__main__")
        elif "\n" in words[0]:
            exec(compile(words[0], "script", "exec"), {"__name__": "__main__"})
        else:
            assert run(list(words)) == 0, words
        return capsys.readouterr().out

    return call


def numbers(text: str, unit: str) -> list[float]:
    return [float(value) for value in re.findall(rf"([-+.\d]+) {unit}", text)]


def test_robots_load_and_their_models_are_written(ran, folder):
    first, second = scripts("your_own_robot")
    found = ran(first)
    assert re.findall(r"(\w+): (\d+) joints", found) == [("arm", "7"), ("leg", "6"), ("humanoid", "12")]
    assert all(1.0 < mass < 120.0 for mass in numbers(found, "kg"))
    ran(second)
    assert (folder / "humanoid_actuators.yaml").exists()


@pytest.mark.parametrize("robot", ["arm", pytest.param("leg", marks=pytest.mark.slow)])
def test_the_diagram_tracks_better_than_the_servo(ran, folder, robot):
    torque, servo = numbers(ran("own_loop.py", f"{robot}.yaml"), "mrad")
    assert torque < 0.5 * servo
    assert (folder / "own_loop.svg").stat().st_size > 10_000


def test_the_script_is_short():
    """25 lines build the loop, 60 lines are the whole script with its plots."""
    text = dict(blocks("your_own_diagram"))["own_loop.py"]
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) <= 60
    build = re.search(r"def build.*?\n\n", text, flags=re.DOTALL)[0].splitlines()
    assert len([line for line in build if line.strip()]) <= 25


@pytest.mark.slow
def test_changes_of_the_diagram_run(ran):
    for script in scripts("your_own_diagram"):
        (error,) = numbers(ran(script), "mrad")
        assert 0.0 < error < 30.0


@pytest.mark.slow
def test_the_humanoid_lowers_its_centre_of_mass(ran):
    (script,) = scripts("your_own_humanoid")
    (lower,) = numbers(ran(script), "mm lower")
    assert lower == pytest.approx(30.0, abs=2.0)


@pytest.mark.slow
def test_contexts_are_random_and_the_plant_is_optimised_over(ran):
    draws, optimised = scripts("random_contexts")
    sag = json.loads(ran(draws).replace("'", '"'))
    assert len(sag) == 4 and len(set(sag)) > 1
    assert ran(optimised).strip() == "True"


def commands(page: str) -> list[list[str]]:
    """The page's indented `drake-tc` commands."""
    text = (ROOT / "docs" / f"{page}.md").read_text("utf-8")
    return [shlex.split(line)[1:] for line in text.splitlines() if line.startswith("    drake-tc ")]


@pytest.mark.slow
def test_commands_take_the_diagrams_of_the_page(ran, folder):
    """The arm with a short filter window is stable; the response to its command falls from 1 to 20 Hz.

    The next test calls `tune`.
    """
    said = {words[0]: ran(*words) for words in commands("diagram_commands") if words[0] != "tune"}
    assert set(said) == {"graph", "simulate", "stability", "bode"}
    assert (folder / "loop.svg").exists() and (folder / "out" / "log.csv").exists()
    assert "verdict: stable" in said["stability"]
    decibels = [float(line.split()[1]) for line in said["bode"].splitlines() if re.match(r" *[\d.]+ +-?[\d.]+ ", line)]
    assert len(decibels) == 3 and decibels[-1] < decibels[0] - 10.0


@pytest.mark.slow
def test_the_loop_of_a_function_is_tuned_and_simulated(ran, capsys):
    """The tuned joint tracks better in the simulation too; a function that returns its diagram alone is refused."""
    words = next(words for words in commands("diagram_commands") if words[0] == "tune")
    found = json.loads(ran(*words, "--json"))
    before, after = (found["simulated"][side] for side in ("before", "after"))
    joint = found["simulated"]["joints"].index("panda_joint2")
    assert after[joint] < 0.8 * before[joint]
    assert found["joints"][0]["after"]["sensitivity_peak"] <= 1.01 * found["joints"][0]["before"]["sensitivity_peak"]
    assert run(["tune", "own_loop:diagram"]) == 2
    assert "as (diagram, loop), which tune needs" in capsys.readouterr().err


@pytest.mark.slow
def test_own_controllers_run(ran):
    arm, humanoid = scripts("your_own_controller")
    (deviation,) = numbers(ran(arm), "mrad")
    assert deviation < 20.0
    heights = numbers(ran(humanoid), "m high")
    assert len(heights) == 2 and all(0.7 < height < 1.0 for height in heights)
