"""`simulate --plot`, `--show` and `--html`: what the pictures hold, and sparing progress where there is no terminal."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, ZeroOrderHold

import drake_tc.models
from drake_tc.cli import terminal
from drake_tc.cli.terminal import progress_bar
from drake_tc.errors import ParamsError
from drake_tc.loops.function_diagram import function_entry
from drake_tc.loops.motion import DiagramPictures, motion_html, torque_motion
from drake_tc.loops.plant import add_robot_plant, start_meshcat
from drake_tc.loops.simulated import RunPlot, TimePanel, speed_line, torque_plot
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.registry import diagram_entry
from drake_tc.report.plots.run_plot import run_figure
from drake_tc.robot.robot import load_robot

MODELS = Path(drake_tc.models.__file__).parent / "hrp2_like"

DROPPED = "{faults: {encoder: [{kind: nan, start: 0.1, duration: 0.05}]}, duration: 0.3}"


@pytest.fixture(scope="module")
def run():
    scenario = diagram_entry("hrp2_leg").scenario(text=DROPPED)
    return scenario, simulate_scenario(scenario)


def test_the_plot_shows_tracking_torques_and_flags(run):
    _, recording = run
    plot = torque_plot(recording)
    error = next(panel for panel in plot.panels if panel.title == "tracking error")
    knee = recording.robot.joints.index("r_knee")
    np.testing.assert_allclose(error.lines["r_knee"], 1e3 * recording.tracking_error[:, knee])
    begin = [float(plot.time[up][0]) for name, up in plot.flags.items() if name.startswith("encoder")]
    assert begin and min(begin) == pytest.approx(0.1, abs=0.03)
    figure = run_figure(plot)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[1:] == ["tracking error", "torque of the drives", "flags"]
    assert figure.axes[-1].get_yticklabels()[0].get_text() in plot.flags


def test_a_flag_is_a_bar_as_long_as_it_was_up():
    time = np.arange(0.0, 1.0, 0.01)
    plot = RunPlot("robot", (), time, {"late": (time > 0.295) & (time < 0.495), "never": time < 0.0})
    (axes,) = run_figure(plot).axes
    (bar,) = axes.patches
    assert bar.get_x() == pytest.approx(0.3) and bar.get_width() == pytest.approx(0.2)


def test_a_plot_without_flags_has_the_panels_alone():
    time = np.arange(3.0)
    panel = TimePanel("torque", "N m", time, {"knee": time}, {})
    assert len(run_figure(RunPlot("robot", (panel,), time, {})).axes) == 1


def test_the_motion_is_one_page_that_fetches_nothing(run):
    scenario, recording = run
    text = motion_html(torque_motion(recording, scenario))
    assert "<html" in text and len(text) > 1e6  # Meshcat's script is part of it
    assert re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=[\"']?http", text) == []
    assert "set_animation" in text or "animation" in text


def test_the_command_writes_both(invoke, tmp_path):
    plot, page = tmp_path / "run.svg", tmp_path / "run.html"
    call = ["simulate", "hrp2_leg", "--duration", 0.2, "--plot", plot, "--html", page, "--json"]
    outcome = invoke(*call)
    assert outcome.code == 0 and outcome.err == ""
    assert json.loads(outcome.out)["files"] == [str(plot), str(page)]
    assert "tracking error" in plot.read_text("utf-8") or "<svg" in plot.read_text("utf-8")
    assert page.stat().st_size > 1e6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("hrp2_leg", "--plot", "run.xyz"), "expected a file that ends in .png, .svg, .pdf"),
        (("sea_joint", "--html", "run.html"), "expected a diagram with a robot, got sea_joint"),
    ],
)
def test_what_cannot_be_drawn_is_refused_before_the_run(invoke, arguments, message):
    assert message in invoke("simulate", *arguments).refusal()


def test_a_window_shows_the_plot(invoke, monkeypatch):
    import matplotlib.pyplot as plt

    shown = []
    monkeypatch.setattr(plt, "show", lambda: shown.append([len(plt.figure(n).axes) for n in plt.get_fignums()]))
    assert invoke("simulate", "sea_joint", "--duration", 0.1, "--show").code == 0
    assert shown and shown[0][-1] >= 3
    plt.close("all")


def test_one_stage_is_told_once_in_ten_seconds_and_at_its_end(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    with progress_bar("simulate") as report:
        report("building", 0.0)
        for step in range(1, 251):
            now[0] = 0.1 * step
            report(f"{0.1 * step:.1f} of 25 s", step / 250)
    told = capsys.readouterr().err.splitlines()
    assert told == ["simulate: building", *(f"simulate: {t} of 25 s" for t in ("0.1", "10.1", "20.1", "25.0"))]


@pytest.mark.parametrize(("factor", "told"), [(0.034, "0.034"), (0.5, "0.5"), (3.21, "3.2"), (125.4, "125.4")])
def test_a_slow_run_is_not_told_as_zero_times_real_time(factor, told):
    assert speed_line(0.5, factor) == f"0.5 s simulated at {told} x real time"


def swinging(*, visuals=False):
    """A leg that falls, with its shapes or without."""
    builder = DiagramBuilder()
    add_robot_plant(builder, load_robot(MODELS / "hrp2_like_leg.yaml"), visuals=visuals)
    system = builder.AddNamedSystem("nothing", ConstantVectorSource(np.zeros(6)))
    builder.Connect(system.get_output_port(), builder.GetSubsystemByName("plant").get_actuation_input_port())
    return builder.Build()


@pytest.mark.parametrize("visuals", [False, True])
def test_a_diagram_of_ones_own_is_shown_with_its_shapes_or_with_frustums(visuals):
    entry = function_entry("mine", lambda: swinging(visuals=visuals))
    simulated = entry.simulate(entry.scenario().changed(duration=0.2), None, False)
    text = simulated.page()
    assert "<html" in text and "set_animation" in text
    diagram, meshcat = swinging(visuals=visuals), start_meshcat(quiet=True)
    pictures = DiagramPictures(diagram, diagram.GetSystems())
    pictures.place(meshcat)
    poses = pictures.poses(diagram.CreateDefaultContext())
    assert len(poses) > 6
    assert all(meshcat.HasPath(path) for path in poses if not path.endswith("world"))


def test_a_diagram_without_a_plant_has_nothing_to_show():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource(np.zeros(1)))
    held = builder.AddNamedSystem("held", ZeroOrderHold(0.1, 1))
    builder.Connect(source.get_output_port(), held.get_input_port())
    entry = function_entry("mine", builder.Build)
    simulated = entry.simulate(entry.scenario(), None, False)
    with pytest.raises(ParamsError, match="expected a diagram with a MultibodyPlant to show, it has none"):
        simulated.page()
