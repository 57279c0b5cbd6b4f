"""What a tick costs: the leg's loops, and the torque estimate of the leg and of a floating humanoid."""

import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator

from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.loops.torque.loop import build_loop
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import FigureRow
from drake_tc.robot.robot import load_robot

MODELS = Path(str(files("drake_tc.models"))) / "hrp2_like"
CHUNK = 0.02
"""Simulated time of one timing [s]."""


def loop_timing(scenario_name: str, title: str, duration: float = 2.5) -> FigureRow:
    """A tick of the hanging leg's loop, everything included: plant, actuators, sensors, estimator, controller, logs.

    Args:
        scenario_name: Of the diagram `hrp2_leg`.
        title: Name of the row.
        duration: Simulated [s].
    """
    scenario = diagram_entry("hrp2_leg").scenario(scenario_name).changed(duration=duration)
    loop = build_loop(scenario)
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    simulator.Initialize()
    ticks, times = round(CHUNK / scenario.dt), []
    for chunk in range(1, round(duration / CHUNK) + 1):
        begin = time.perf_counter()
        simulator.AdvanceTo(chunk * CHUNK)
        times.append((time.perf_counter() - begin) / ticks)
    return FigureRow.of_values(title, "us", times, 1e6)


def estimate_timing(robot_file: Path, title: str, repeats: int = 2000) -> FigureRow:
    """One torque estimate by its system: inputs changed, every output evaluated."""
    robot = load_robot(robot_file)
    system = JointTorqueEstimator(TorqueModel(robot))
    context = system.CreateDefaultContext()
    generator = np.random.default_rng(0)
    ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
    values = [[generator.normal(size=port.size()) for port in ports] for _ in range(50)]
    outputs = [system.get_output_port(i) for i in range(system.num_output_ports())]
    times = []
    for repeat in range(repeats):
        for port, value in zip(ports, values[repeat % 50], strict=True):
            port.FixValue(context, value)
        begin = time.perf_counter()
        for output in outputs:
            output.Eval(context)
        times.append(time.perf_counter() - begin)
    return FigureRow.of_values(title, "us", times, 1e6)


def leg_timings(progress: Callable[[str, float], None]) -> list[FigureRow]:
    """The rows of `drake-tc bench leg`.

    Args:
        progress: Told what is timed and which share is done.
    """
    pieces: list[tuple[str, Callable[[str], FigureRow]]] = [
        ("leg under the vendor's servo, a tick of 1 ms", lambda name: loop_timing("stairs_swing_servo", name)),
        ("leg in torque control, a tick of 1 ms", lambda name: loop_timing("stairs_swing", name)),
        ("torque estimate, leg", lambda name: estimate_timing(MODELS / "hrp2_like_leg.yaml", name)),
        (
            "torque estimate, floating 30 joints",
            lambda name: estimate_timing(MODELS / "hrp2_like.yaml", name),
        ),
    ]
    rows = []
    for number, (name, measure) in enumerate(pieces):
        progress(name, number / len(pieces))
        rows.append(measure(name))
    return rows
