"""What the parts of the humanoid's diagram take without the connections between them: a bound for the whole diagram.

The plant with contact and log runs under the recorded torques, which a source of Drake's plays; the controller ticks at
the recorded states. In turn, each finds the processor's caches as the other one leaves them, as in the diagram.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.loops.recording import add_log
from drake_tc.loops.whole_body.running import TsidRecording, add_grounded_plant
from drake_tc.tsid.tick import TickInput, advance_tick
from drake_tc.types import FloatArray
from tests.benchmarks.figures import BenchmarkRow

PLANT, CONTROLLER = "plant with contact and log", "controller"


def part_timings(
    recording: TsidRecording, references: Sequence[Sequence[FloatArray]], repeats: int
) -> list[BenchmarkRow]:
    """Rows of a tick of the plant alone, and of plant and controller in turn [us].

    Args:
        recording: Of a controller that stands on all contacts and whose torques go to the joints.
        references: One a task, a tick.
        repeats: The motion is run this often, and each tick counts with its fastest run.
    """
    alone = np.stack([_ticks(recording, None)[0] for _ in range(repeats)]).min(axis=0)
    in_turn = np.stack([_ticks(recording, references) for _ in range(repeats)]).min(axis=0)
    return [
        BenchmarkRow.of_values(f"{PLANT}, alone", "us", alone[1:], 1e6),
        BenchmarkRow.of_values(f"{PLANT}, in turn with the controller", "us", in_turn[0, 1:], 1e6),
        BenchmarkRow.of_values(f"{CONTROLLER}, in turn with the plant", "us", in_turn[1, 1:], 1e6),
    ]


def _ticks(recording: TsidRecording, references: Sequence[Sequence[FloatArray]] | None) -> FloatArray:
    """(2, T) own time of each tick of plant and controller [s]; of the plant alone without references."""
    law, period = recording.law, recording.law.period
    simulator, scratch = _plant_under(recording), law.model.create_scratch()
    active, (before, after) = (True,) * len(law.model.contacts), np.zeros((2, law.memory.size))
    seconds = np.zeros((2, recording.time.size - 1))
    for tick in range(1, recording.time.size):
        begin = time.thread_time()
        simulator.AdvanceTo(tick * period)
        seconds[0, tick - 1] = time.thread_time() - begin
        if references is not None:
            begin = time.thread_time()
            advance_tick(law, scratch, TickInput(recording["state"][tick], references[tick], active), before, after)
            seconds[1, tick - 1] = time.thread_time() - begin
            before, after = after, before
    return seconds


def _plant_under(recording: TsidRecording) -> Simulator:
    """The scenario's plant under the recorded torques, with a log."""
    law, scenario, torque = recording.law, recording.scenario, recording["applied_torque"]
    builder = DiagramBuilder()
    plant = add_grounded_plant(builder, scenario, law)
    between: Any = recording.time - 0.5 * law.period
    hold: Any = PiecewisePolynomial.ZeroOrderHold  # the stubs ask for lists; the functions take arrays too
    source: Any = builder.AddSystem(TrajectorySource(hold(between, torque.T)))
    builder.Connect(source.get_output_port(), plant.get_actuation_input_port())
    touched = plant.get_generalized_contact_forces_output_port(plant.GetModelInstanceByName(law.model.robot.name))
    signals = {"state": plant.get_state_output_port(), "contact": touched, "torque": source.get_output_port()}
    add_log(builder, signals, law.period)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    return simulator
