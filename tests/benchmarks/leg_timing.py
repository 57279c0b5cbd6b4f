"""What a tick costs: the leg's loops, and the torque estimate of the leg and of a floating humanoid.

Beside them stand references that no change of this library moves: a system in Python that only copies, and Drake's own
functions for the same robots. All are measured in turn, so that a busy machine slows each of them alike.
"""

import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.loops.torque.running import build_loop
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from tests.benchmarks.figures import BenchmarkRow

MODELS = Path(str(files("drake_tc.models"))) / "hrp2_like"
LEG, HUMANOID = MODELS / "hrp2_like_leg.yaml", MODELS / "hrp2_like.yaml"
TICKS, CHUNKS, WARM_UP = 20, 125, 0.1
"""Ticks of 1 ms in one measurement, measurements, and simulated time before them [s]."""
Measure = Callable[[], float]
"""Own time of the thread for a tick [s], the mean over a few."""


def loop_ticks(scenario_name: str, *, fused: bool = True) -> Measure:
    """Ticks of the hanging leg's loop: plant, actuators, sensors, estimator, controller, logs.

    Args:
        scenario_name: Of the diagram `hrp2_leg`.
        fused: All stages in one system, as `drake-tc simulate` has them; otherwise each is a system.
    """
    duration = WARM_UP + (CHUNKS + 1) * TICKS * 1e-3
    scenario = diagram_entry("hrp2_leg").scenario(scenario_name).changed(duration=duration)
    loop = build_loop(scenario, fused=fused)
    simulator = Simulator(loop.diagram)
    loop.start(simulator.get_mutable_context())
    return _advancing(simulator)


class Copying(LeafSystem):
    """Its input as output and as state, updated every millisecond: what a system in Python costs at least."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self._input: Any = self.DeclareVectorInputPort("input", size)
        self.DeclareVectorOutputPort("output", size, self._copy, {self._input.ticket()})
        self._state = int(self.DeclareDiscreteState(size))
        self.DeclarePeriodicDiscreteUpdateEvent(1e-3, 0.0, self._update)

    def _copy(self, context: Context, vector: Any) -> None:
        vector.set_value(self._input.Eval(context))

    def _update(self, context: Context, values: Any) -> None:
        values.set_value(self._state, self.GetOutputPort("output").Eval(context))


def copying_ticks(size: int = 18) -> Measure:
    """Ticks of one `Copying` system."""
    builder: Any = DiagramBuilder()
    ones: Any = np.ones(size)
    source = builder.AddSystem(ConstantVectorSource(ones))
    builder.Connect(source.get_output_port(), builder.AddSystem(Copying(size)).get_input_port())
    return _advancing(Simulator(builder.Build()))


def _advancing(simulator: Any) -> Measure:
    """Ticks of a simulator, from after the warm-up on."""
    simulator.Initialize()
    simulator.AdvanceTo(WARM_UP)

    def measure() -> float:
        end = simulator.get_context().get_time() + TICKS * 1e-3
        begin = time.thread_time()
        simulator.AdvanceTo(end)
        return (time.thread_time() - begin) / TICKS

    return measure


def estimates(robot_file: Path) -> Measure:
    """Torque estimates by their system: inputs changed, every output evaluated."""
    system = JointTorqueEstimator(TorqueModel(load_robot(robot_file)))
    context, generator = system.CreateDefaultContext(), np.random.default_rng(0)
    ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
    values = [[generator.normal(size=port.size()) for port in ports] for _ in range(TICKS)]
    outputs = [system.get_output_port(i) for i in range(system.num_output_ports())]

    def measure() -> float:
        total = 0.0
        for given in values:
            for port, value in zip(ports, given, strict=True):
                port.FixValue(context, value)
            begin = time.thread_time()
            for output in outputs:
                output.Eval(context)
            total += time.thread_time() - begin
        return total / TICKS

    return measure


def drakes_recursions(robot_file: Path) -> Measure:
    """Drake's inverse dynamics of the same robot, and its Jacobian of each F/T sensor's contact link."""
    robot = load_robot(robot_file)
    plant: Any = make_plant(robot, 0.0)
    context, forces, world = plant.CreateDefaultContext(), MultibodyForces(plant), plant.world_frame()
    links = [plant.GetBodyByName(mount.contact.link).body_frame() for mount in robot.force_torque]
    generator, origin = np.random.default_rng(0), np.zeros((3, 1))
    start = plant.GetPositions(context)
    moves = generator.normal(scale=0.1, size=(TICKS, 2, plant.num_velocities()))
    quaternion = 4 if plant.num_positions() > plant.num_velocities() else 0

    def measure() -> float:
        begin = time.thread_time()
        for v, vdot in moves:
            q = start.copy()
            q[quaternion:] += v[v.size - (q.size - quaternion) :]
            plant.SetPositionsAndVelocities(context, np.concatenate((q, v)))
            plant.CalcForceElementsContribution(context, forces)
            plant.CalcInverseDynamics(context, vdot, forces)
            for link in links:
                by = JacobianWrtVariable.kV
                plant.CalcJacobianSpatialVelocity(context, by, link, origin, world, world)
        return (time.thread_time() - begin) / TICKS

    return measure


PIECES: dict[str, Callable[[], Measure]] = {
    "leg under the vendor's servo, a tick of 1 ms": lambda: loop_ticks("stairs_swing_servo"),
    "leg in torque control, a tick of 1 ms": lambda: loop_ticks("stairs_swing"),
    "leg in torque control, each stage a system": lambda: loop_ticks("stairs_swing", fused=False),
    "torque estimate, leg": lambda: estimates(LEG),
    "torque estimate, floating 30 joints": lambda: estimates(HUMANOID),
    "reference: a system in Python that copies, a tick": copying_ticks,
    "reference: Drake's inverse dynamics and Jacobians, leg": lambda: drakes_recursions(LEG),
    "reference: the same, floating 30 joints": lambda: drakes_recursions(HUMANOID),
}


def leg_timings(progress: Callable[[str, float], None], chunks: int = CHUNKS) -> list[BenchmarkRow]:
    """The rows of `python -m tests.benchmarks leg`.

    Args:
        progress: Told what is timed and which share is done.
        chunks: Measurements of each piece, `CHUNKS` at most.
    """
    progress("building", 0.0)
    measures = {name: make() for name, make in PIECES.items()}
    times: dict[str, list[float]] = {name: [] for name in measures}
    for measure in measures.values():
        measure()  # the first one imports or compiles
    for chunk in range(chunks):
        progress("measuring in turn", chunk / chunks)
        for name, measure in measures.items():
            times[name].append(measure())
    return [BenchmarkRow.of_values(name, "us", values, 1e6) for name, values in times.items()]
