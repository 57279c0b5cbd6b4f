"""What all loops share: wiring, running, recording, scenarios from files."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LinearSystem

from drake_tc.errors import LogError, ParamsError
from drake_tc.loops.built_loop import BuiltLoop, WiredLoop
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.recording import CHUNK, Recording, write_log, write_rig
from drake_tc.loops.scenarios import ScenarioBase

PERIOD = 0.01


@dataclass(frozen=True)
class Short(ScenarioBase):
    duration: float = 0.3
    plant_step: float = PERIOD
    source: str = "."


@dataclass(frozen=True)
class WithoutFolder(ScenarioBase):
    duration: float = 0.3


def counting(scenario):
    """A loop whose states count ticks, x[n+1] = x[n] + u, beside a plant without anything in it."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(scenario.plant_step))
    plant.Finalize()
    loop = LoopBuilder(builder, scenario, plant, PERIOD)
    steps = [builder.AddNamedSystem(f"step_{i}", ConstantVectorSource(np.array(v))) for i, v in enumerate(STEPS)]
    joined = loop.join("joined", [step.get_output_port() for step in steps])
    one = np.eye(3)
    counter = loop.add("counter", LinearSystem(one, one, one, 0.0 * one, PERIOD), u0=joined)
    loop.signals |= {"count": counter.get_output_port(), "step": joined}
    wired = WiredLoop(systems=loop.systems, signals=loop.signals, period=PERIOD)
    diagram, log = wired.build(loop.builder, "counting")
    return BuiltLoop(scenario=scenario, diagram=diagram, plant=plant, log=log)


STEPS = ([1.0, 2.0], [4.0])


def test_signals_are_joined_in_order_and_recorded_every_period():
    loop = counting(Short())
    recording = loop.run(lambda context: lambda now: True)
    assert loop.diagram.get_name() == "counting"
    assert_allclose(recording.time, PERIOD * np.arange(31), rtol=0, atol=1e-12)
    assert_allclose(recording["count"], np.outer(np.arange(31), [1.0, 2.0, 4.0]), rtol=0, atol=0)
    assert_allclose(recording["step"], np.tile([1.0, 2.0, 4.0], (31, 1)), rtol=0, atol=0)
    assert recording.seconds > 0.0 and recording.raised_flags() == []


def test_a_run_ends_where_what_is_watched_ends():
    seen = []

    def watch(context):
        seen.append(context.get_time())
        return lambda now: seen.append(now) or now < 0.1 - 1e-9

    recording = counting(Short()).run(watch)
    assert seen[0] == 0.0 and np.allclose(seen[1:], CHUNK * np.arange(1, 6))
    assert recording.time[-1] == pytest.approx(0.1)


def test_flags_are_told_by_name_with_the_time_at_which_they_rose():
    flags = np.zeros((4, 3))
    flags[2:, 0], flags[1, 2] = 1.0, 1.0
    time = np.array([0.0, 0.1, 0.2, 0.3])
    recording = Recording(time=time, signals={"flags": flags}, seconds=0.1, flag_names=("a", "b", "c"))
    assert recording.raised_flags() == [{"name": "a", "first": 0.2}, {"name": "c", "first": 0.1}]
    assert recording.real_time_factor == pytest.approx(3.0)
    with pytest.raises(LogError, match="no signal 'torque' recorded; recorded: flags"):
        recording["torque"]


def test_a_scenario_is_read_from_its_file_and_changed(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text("one: {duration: 1.0}\ntwo: {extends: one, duration: 2.0}\n")
    two = Short.load(file, "two", "{plant_step: 0.02}")
    assert two == Short(2.0, 0.02, str(tmp_path)) and two.path("robot.yaml") == tmp_path / "robot.yaml"
    assert two.changed(duration=3.0, plant_step=None) == Short(3.0, 0.02, str(tmp_path))
    assert WithoutFolder.load(file, "one") == WithoutFolder(1.0)
    with pytest.raises(ParamsError, match=r"own\.yaml: one: unknown key 'dt'"):
        WithoutFolder.load(file, "one", "{dt: 0.1}")


def test_files_that_cannot_be_written_are_refused(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(LogError, match="cannot be written"):
        write_rig({}, tmp_path / "taken" / "rig.yaml")
    with pytest.raises(LogError, match=r"ends in \.csv, \.parquet, \.npz, got \.doc"):
        write_log({}, tmp_path / "log.doc")
