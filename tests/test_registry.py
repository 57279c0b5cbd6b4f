"""The registry: names of the library, of other distributions, and diagrams of one's own as `module:attribute`."""

import json
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from typer.testing import CliRunner

from drake_tc import registry
from drake_tc.cli.main import app
from drake_tc.errors import ParamsError

MODULE = """
from pathlib import Path

from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LinearSystem, LogVectorOutput, MatrixGain

from drake_tc.loops.entries import torque_loop


def low_pass():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    one = builder.AddNamedSystem("low_pass", LinearSystem([[0.9]], [[0.1]], [[1.0]], [[0.0]], 0.01))
    builder.Connect(source.get_output_port(), one.get_input_port())
    LogVectorOutput(one.get_output_port(), builder, 0.01).set_name("log")
    return builder.Build()


def feedback():
    builder = DiagramBuilder()
    one = builder.AddNamedSystem("plant", LinearSystem([[0.9]], [[0.1]], [[1.0]], [[0.0]], 0.01))
    gain = builder.AddNamedSystem("controller", MatrixGain([[-3.0]]))
    builder.Connect(one.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), one.get_input_port())
    return builder.Build()


def number():
    return 3.0


def gain():
    builder = DiagramBuilder()
    builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    return builder.Build()


text = "no diagram"
ENTRY = torque_loop("own", "of my own", Path("own.scenario.yaml"))
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A module in the working folder, as a user has it."""
    (tmp_path / "my_own_diagrams.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return "my_own_diagrams"


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)


def test_a_function_is_simulated_and_its_log_is_written(own, tmp_path):
    outcome = run("simulate", f"{own}:low_pass", "--duration", 0.5, "--out", tmp_path / "out", "--json")
    assert outcome.exit_code == 0
    assert json.loads(outcome.stdout)["duration"] == 0.5
    table = np.genfromtxt(tmp_path / "out" / "log.csv", delimiter=",", names=True)
    assert table["log0"] == pytest.approx(1.0 - 0.9 ** np.arange(51), rel=1e-8)  # of a low pass of gain 1 at a step


def test_a_function_is_drawn(own):
    outcome = run("graph", f"{own}:low_pass", "--format", "json")
    assert {block["name"] for block in json.loads(outcome.stdout)["blocks"]} >= {"source", "low_pass"}


def test_the_response_of_a_function_is_that_of_its_equation(own):
    call = ["bode", f"{own}:low_pass", "--input", "low_pass:u0", "--output", "low_pass:y0", "--from", 1, "--to", 4]
    rows = json.loads(run(*call, "--points", 3, "--settle", 2.0, "--json").stdout)["rows"]
    for row in rows:
        z = np.exp(2j * np.pi * row["frequency_hz"] * 0.01)
        expected = 20.0 * np.log10(abs(0.1 / (z - 0.9)))
        assert row["predicted_magnitude_db"] == pytest.approx(expected, abs=1e-6)
        assert row["magnitude_db"] == pytest.approx(expected, abs=0.01)


def test_the_stability_of_a_function_is_that_of_its_equation(own):
    call = ["stability", f"{own}:feedback", "--open-at", "controller:y0", "--json"]
    found = json.loads(run(*call).stdout)
    assert found["eigenvalues"] == [[pytest.approx(0.9 - 0.3), 0.0]]
    assert found["verdict"] == "stable" and found["agree"]
    assert found["margins"]["gain_margin"] == pytest.approx(1.9 / 0.3, rel=1e-3)  # at the pole -1
    outcome = CliRunner().invoke(app, [*call, "--joint", "knee"])
    assert "the diagram names none" in str(outcome.exception)


def test_the_stability_of_a_series_elastic_joint_is_judged_and_that_of_contacts_is_not():
    call = ["--open-at", "torque_control:voltage", "--at", 0.2, "--json"]
    found = json.loads(run("stability", "sea_joint", *call).stdout)
    assert found["verdict"] == "stable" and found["agree"]
    assert found["margins"]["sensitivity_peak"] <= 2.0  # the rule by which its law is tuned
    outcome = CliRunner().invoke(app, ["stability", "humanoid_tsid"])
    assert "stands on contacts" in str(outcome.exception)


def test_an_entry_of_ones_own_is_taken_as_it_is(own):
    assert registry.diagram_entry(f"{own}:ENTRY").title == "of my own"
    with pytest.raises(ParamsError, match="expected a DiagramEntry of the whole_body loop"):
        registry.tsid_entry(f"{own}:ENTRY")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere_at_all:build", "cannot be loaded"),
        ("{own}:missing", "missing"),
        ("{own}:text", "expected a DiagramEntry or a function that returns a Diagram, got str"),
        ("{own}:", "expected module:attribute"),
    ],
)
def test_what_cannot_be_loaded_is_refused(own, name, message):
    with pytest.raises(ParamsError, match=message):
        registry.runnable(name.format(own=own))


def test_functions_that_give_no_discrete_diagram_are_refused(own):
    for name, message in (("number", "returns a Diagram, got float"), ("gain", "with a discrete period")):
        entry = registry.runnable(f"{own}:{name}")
        with pytest.raises(ParamsError, match=message):
            entry.build(entry.scenario())
    entry = registry.runnable(f"{own}:low_pass")
    with pytest.raises(ParamsError, match="has no scenarios"):
        entry.scenario("stairs")
    with pytest.raises(ParamsError, match="unknown key 'durration'"):
        entry.scenario(text="{durration: 1.0}")


def test_other_distributions_add_diagrams_and_reproductions(own, monkeypatch):
    group = registry.DIAGRAMS
    points = [EntryPoint("my_arm", f"{own}:ENTRY", group)]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == registry.DIAGRAMS else [])
    registry.registered.cache_clear()
    try:
        assert registry.diagram_entry("my_arm").title == "of my own"
        assert "my_arm" in registry.diagrams("torque")
        points.append(EntryPoint("sea_joint", f"{own}:ENTRY", group))
        registry.registered.cache_clear()
        with pytest.raises(ParamsError, match="'sea_joint' is registered twice"):
            registry.diagrams()
    finally:
        monkeypatch.undo()
        registry.registered.cache_clear()


def test_names_that_are_not_there_list_those_that_are():
    with pytest.raises(ParamsError, match=r"no diagram 'dog'; diagrams: hrp2_leg, hrp2_leg_contact$"):
        registry.diagram_entry("dog")
    with pytest.raises(ParamsError, match=r"no reproduction 'A\.fig1'; possible: A\.table1"):
        registry.reproductions("A.fig1")
