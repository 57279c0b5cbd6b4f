"""The diagram of the joint bench, of which a recorded rig and a free run are two uses.

command (table) --> ActuatorPlant --actuation--> MultibodyPlant(one revolute joint) --state--> log
^---------------- state --------|------ reaction torque ----------> torque sensor --> log
applied (table) ------------ torque on the link -------->|

A joint bench as a rig that is being measured: what it is, and one recorded run of it.

Free run: the Drake diagram of a joint driven by a recorded command alone, next to what was recorded.

The load is the recorded torque (rig with a torque column: the plant is the rotor) or the pendulum's own gravity and
inertia (the plant carries them). No recorded motion enters after the first sample. The diagram runs the model of
`model_to_simulate`, so that the run has the model's inertia at any step.

Free run of a recorded run: from a rig's canonical columns to the Drake diagram and back.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.common.value import Value
from pydrake.math import RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, RandomSource, TrajectorySource, VectorLogSink
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.free_run import model_to_simulate
from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.recorded_run import (
    LONGEST,
    Link,
    PlantSide,
    Recording,
    in_plant,
    longest_stretch,
    plant_side,
    recording_of,
)
from drake_tc.actuation.wiring import add_actuators
from drake_tc.config.records import FromZero, Positive
from drake_tc.effects.base import plain_signals
from drake_tc.errors import ParamsError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig
from drake_tc.loops.scenarios import ScenarioBase, Seed
from drake_tc.types import GRAVITY, FloatArray

JOINT = "joint"


@dataclass(frozen=True)
class Table:
    """Recorded or made inputs on one clock.

    Attributes:
        time: (T,) [s], increasing.
        command: (T,) q_d, i or V, held from sample to sample.
        applied: (T,) torque on the link from outside [N m], linear between samples; None: none.
        load_torque: (T,) what the gear is known to transmit [N m], for load-dependent friction, linear between samples;
            None: what the motion says.
        temperature: (T,) [deg C], held; None: 25.
        supply_voltage: (T,) of the drive [V], held; None: its nominal one.
    """

    time: FloatArray
    command: FloatArray
    applied: FloatArray | None = None
    load_torque: FloatArray | None = None
    temperature: FloatArray | None = None
    supply_voltage: FloatArray | None = None


@dataclass(frozen=True)
class Rates:
    """Step of plant and actuator [s], and period of the logs [s]."""

    step: float
    log_period: float


@dataclass(frozen=True)
class Bench:
    """The built diagram and the systems in it that its users need by name."""

    diagram: Diagram
    plant: MultibodyPlant
    actuators: ActuatorPlant
    state_log: VectorLogSink
    torque_log: VectorLogSink | None
    noise: RandomSource | None


def make_plant(link: Link, step: float) -> MultibodyPlant:
    """One link on one actuated revolute joint about y; live (unsampled) output ports, so reactions do not lag."""
    plant = MultibodyPlant(step)
    if link.gravity_moment > 0.0:
        arm = 0.5 * link.inertia * GRAVITY / link.gravity_moment
        mass, radius = link.gravity_moment / (GRAVITY * arm), 2.0 * arm**2
    else:
        arm, mass, radius = 0.0, 1.0, link.inertia
    turned = RotationMatrix.MakeYRotation(-link.zero)
    offset: Any = turned.matrix() @ np.array([0.0, 0.0, -arm])
    inertia = UnitInertia(radius, radius, radius if arm == 0.0 else 0.5 * radius).ReExpress(turned)
    body = plant.AddRigidBody("link", SpatialInertia(mass, offset, inertia))
    axis: Any = np.array([0.0, 1.0, 0.0])
    joint = plant.AddJoint(RevoluteJoint(JOINT, plant.world_frame(), body.body_frame(), axis))
    plant.AddJointActuator(JOINT, joint)
    down: Any = np.array([0.0, 0.0, -GRAVITY])
    plant.mutable_gravity_field().set_gravity_vector(down)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    return plant


class TorqueSensor(LeafSystem):
    """The torque that the gear passes to the link, with noise.

    Inputs: reaction_forces (of the plant), noise (1) [-], standard normal, applied_torque (1) [N m] on the link from
    outside; optional.
    Output: torque (1) [N m]: tau_meas = axis . reaction torque - applied + deviation * noise. The plant takes a
    generalized force for part of the joint, and counts it into the joint's reaction.
    """

    def __init__(self, deviation: float, index: int) -> None:
        """Declare the ports; `deviation` [N m], `index` of the joint in the reactions."""
        super().__init__()
        self._deviation, self._index = deviation, index
        self._reactions: Any = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self._noise: Any = self.DeclareVectorInputPort("noise", 1)
        self._applied: Any = self.DeclareVectorInputPort("applied_torque", 1)
        tickets = {self._reactions.ticket(), self._noise.ticket(), self._applied.ticket()}
        self.DeclareVectorOutputPort("torque", 1, self._measure, tickets)

    def _measure(self, context: Context, torque: BasicVector) -> None:
        reaction = self._reactions.Eval(context)[self._index]
        outside = self._applied.Eval(context)[0] if self._applied.HasValue(context) else 0.0
        torque.SetAtIndex(0, reaction.rotational()[1] - outside + self._deviation * self._noise.Eval(context)[0])


def _source(builder: DiagramBuilder, name: str, trajectory: Any) -> Any:
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def build_bench(model: ActuatorModel, link: Link, table: Table, rates: Rates, deviation: float | None) -> Bench:
    """Build the diagram: see the module.

    Args:
        model: The actuator; its sensor effects play no part here.
        link: What the joint carries.
        table: Its inputs.
        rates: Step of plant and actuator, period of the logs [s].
        deviation: Standard deviation of the torque sensor [N m]; None leaves the sensor out.
    """
    builder = DiagramBuilder()
    plant = make_plant(link, rates.step)
    builder.AddNamedSystem("plant", plant)
    actuators = add_actuators(builder, plant, {JOINT: replace(model, joint=JOINT)}, rates.step)
    held = np.append(table.time - 0.25 * rates.step, table.time[-1] + 1.0)  # a sample holds from just before its tick

    polynomial: Any = PiecewisePolynomial  # the stubs ask for lists; the functions take arrays too

    def hold(values: FloatArray) -> Any:
        return polynomial.ZeroOrderHold(held, np.append(values, values[-1])[None, :])

    def line(values: FloatArray) -> Any:
        ends = np.append(table.time, table.time[-1] + 1.0)
        return polynomial.FirstOrderHold(ends, np.append(values, values[-1])[None, :])

    builder.Connect(_source(builder, "command", hold(table.command)), actuators.GetInputPort("command"))
    for name in ("temperature", "supply_voltage"):
        values = getattr(table, name)
        if values is not None:
            builder.Connect(_source(builder, name, hold(values)), actuators.GetInputPort(name))
    outside = None
    if table.applied is not None:
        outside = _source(builder, "applied_torque", line(table.applied))
        builder.Connect(outside, plant.get_applied_generalized_force_input_port())
    if table.load_torque is not None:
        builder.Connect(_source(builder, "load_torque", line(table.load_torque)), actuators.GetInputPort("load_torque"))
    state_log = LogVectorOutput(plant.get_state_output_port(), builder, rates.log_period)
    torque_log = noise = None
    if deviation is not None:
        index = int(plant.GetJointByName(JOINT).index())
        system = builder.AddNamedSystem("torque_sensor", TorqueSensor(deviation, index))
        noise = RandomSource(RandomDistribution.kGaussian, 1, rates.log_period)
        builder.AddNamedSystem("noise", noise)
        builder.Connect(noise.get_output_port(), system.GetInputPort("noise"))
        builder.Connect(plant.get_reaction_forces_output_port(), system.GetInputPort("reaction_forces"))
        if outside is not None:
            builder.Connect(outside, system.GetInputPort("applied_torque"))
        torque_log = LogVectorOutput(system.get_output_port(), builder, rates.log_period)
    diagram = builder.Build()
    diagram.set_name("joint_bench")
    return Bench(diagram, plant, actuators, state_log, torque_log, noise)


def start_bench(bench: Bench, position: float, velocity: float, seed: int = 0) -> Simulator:
    """A simulator of the bench at a start position [rad] and velocity [rad/s]; `seed` of the sensor's noise."""
    simulator = Simulator(bench.diagram)
    context = simulator.get_mutable_context()
    start: Any = np.array([position, velocity])
    bench.plant.SetPositionsAndVelocities(bench.plant.GetMyMutableContextFromRoot(context), start)
    if bench.noise is not None:
        bench.noise.SetRandomContext(bench.noise.GetMyMutableContextFromRoot(context), RandomGenerator(seed))
    own = bench.actuators.GetMyMutableContextFromRoot(context)
    bench.actuators.set_initial_velocity(own, np.array([velocity]))
    return simulator


@dataclass(frozen=True)
class BenchScenario(ScenarioBase):
    """A rig and how it is recorded.

    Attributes:
        duration: [s].
        log_period: Sampling period of the record [s].
        step: Period of plant and actuator [s]; divides `log_period`.
        link_inertia: Of the link about the joint [kg m^2].
        gravity_moment: m g l [N m]; 0 for a joint about a vertical axis. The link hangs at q = 0.
        encoder_resolution: Step of the encoder [rad]; 0 for a perfect one.
        torque_noise: Standard deviation of the torque sensor [N m], white.
        seed: Seed of all random numbers.

    Raises:
        ParamsError: a value that is not possible.
    """

    duration: Positive = 10.0
    log_period: Positive = 1e-3
    step: Positive = 2.5e-4
    link_inertia: Positive = 0.08
    gravity_moment: FromZero = 9.0
    encoder_resolution: FromZero = 0.0
    torque_noise: FromZero = 0.0
    seed: Seed = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        ratio = self.log_period / self.step
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise ParamsError(
                f"scenario.step: expected log_period {self.log_period} over a whole number, got {self.step}"
            )


def quantise(values: FloatArray, step: float) -> FloatArray:
    """The nearest multiple of `step`; `values` themselves for a step of 0."""
    return values if step == 0.0 else np.asarray(np.round(values / step) * step)


def record_bench(
    model: ActuatorModel,
    table: Table,
    scenario: BenchScenario,
    generator: np.random.Generator | None = None,
    name: str = "bench",
) -> Run:
    """Run the bench and measure it, with the model's sensor errors, the encoder's steps and the torque sensor's noise.

    Starts at rest where a servo is commanded to be, or hanging for the other drives. The log shows the rotor inertia
    `simulated_inertia(model, scenario.step)`, which its rig file declares; that of `model_to_simulate(model, step)`
    shows the model's own.

    Args:
        model: The actuator.
        table: Command and torque on the link from outside; time from 0.
        scenario: The rig.
        generator: Of the noise; None makes one from the scenario's seed.
        name: Of the run.

    Returns:
        `joint/position`, `joint/torque` (link side) and the command's column; `joint/temperature` and
            `joint/supply_voltage` where they are given.
    """
    rng = np.random.default_rng(scenario.seed) if generator is None else generator
    link = Link(scenario.link_inertia, scenario.gravity_moment)
    rates = Rates(scenario.step, scenario.log_period)
    bench = build_bench(model, link, table, rates, scenario.torque_noise)
    start = float(table.command[0]) if model.drive.kind == "position_servo" else 0.0
    simulator = start_bench(bench, start, 0.0, int(rng.integers(2**31)))
    simulator.AdvanceTo(scenario.duration)
    context = simulator.get_context()
    log = bench.state_log.FindLog(context)
    time = np.asarray(log.sample_times())
    torque = np.asarray(bench.torque_log.FindLog(context).data()[0]) if bench.torque_log else np.zeros_like(time)
    known = {"time": time, "position": np.asarray(log.data()[0]), "load_torque": torque}
    signals = replace(plain_signals(time.size, known), period=float(time[1] - time[0]))
    for effect, parameters in model.sensor_effects:
        signals = effect.corrupt(signals, parameters)
    row = np.clip(np.searchsorted(table.time, time + 0.25 * scenario.step, side="right") - 1, 0, None)
    columns = {
        f"{model.joint}/position": quantise(signals.position, scenario.encoder_resolution),
        f"{model.joint}/{COMMAND_COLUMN[model.drive.kind]}": table.command[row],
        f"{model.joint}/torque": signals.load_torque,
    }
    for channel in ("temperature", "supply_voltage"):
        values = getattr(table, channel)
        if values is not None:
            columns[f"{model.joint}/{channel}"] = values[row]
    usable = np.zeros(time.size, dtype=np.int64)
    return Run(name, None, time, scenario.log_period, columns, usable)


CHUNK = 0.25
"""A run is checked for divergence this often [s]."""
FINEST, COARSEST = 4e-4, 1e-3
"""The steps that are worth their time [s]: a faster log is thinned, a slower one gets substeps."""
RESOLUTION = 0.3
"""Largest product of the step and a servo's angular frequency."""
RUNAWAY = 10.0
"""A run that leaves the recorded span by this factor has diverged."""


def free_run(model: ActuatorModel, recording: Recording, *, substeps: int | None = None) -> FloatArray:
    """Position (T,) [rad], as the rig's encoder would have shown it; NaN from where the run has diverged.

    Args:
        model: The actuator; its sensor effects are taken off the recorded load and put on the simulated position.
        recording: The run.
        substeps: Steps of plant and actuator in one sample; None chooses them by the rate of the log and the stiffness
            of the servo, and simulates only every k-th sample of a log faster than `FINEST` (linear between them).

    Raises:
        ParamsError: nothing that has inertia, no load, or arrays that do not fit.
    """
    if substeps is not None and substeps < 1:
        raise ParamsError(f"free run: expected at least 1 substep, got {substeps}")
    side = plant_side(model, recording)
    period = recording.period
    if substeps is None:
        stride = max(1, int(FINEST / period + 1e-9))
        if stride > 1 and recording.time.size > stride:
            thin = recording.thinned(stride)
            rough = free_run(model, thin)
            return np.asarray(np.interp(recording.time, thin.time, rough))
        substeps = _substeps(model, recording, period)
    bench = _bench(side, recording, period / substeps)
    low, high = recording.position_span
    limit = RUNAWAY * max(high - low, 1e-3)
    start = (side.start, recording.initial_velocity)
    return side.shown(_run(bench, start, (0.5 * (low + high), limit), side.signals.time))


def _substeps(model: ActuatorModel, recording: Recording, period: float) -> int:
    """Enough for `COARSEST`, and for a position servo's own oscillation."""
    requested = period / COARSEST
    if model.drive.kind == "position_servo":
        inertia = model.inertia + (recording.pendulum.inertia if recording.pendulum else 0.0)
        requested = max(requested, period / np.sqrt(model.drive.gain * inertia) / RESOLUTION)
    return int(np.clip(np.ceil(requested - 1e-6), 1, 60))


def _bench(side: PlantSide, recording: Recording, step: float) -> Bench:
    """The diagram; where the load is recorded, it is what the gear passes, and the plant is the motor's side."""
    time = side.signals.time
    model = model_to_simulate(side.model, step)
    rates = Rates(step, recording.period)
    around = {"temperature": recording.temperature, "supply_voltage": recording.supply_voltage}
    if recording.pendulum is not None:
        applied = None if recording.load_torque is None else -side.load
        table = Table(time, recording.command, applied=applied, **around)
        return build_bench(model, recording.pendulum, table, rates, None)
    table = Table(time, recording.command, applied=-side.load, load_torque=side.load, **around)
    return build_bench(model, Link(inertia=1e-6 * side.model.inertia), table, rates, None)


def _run(bench: Bench, start: tuple[float, float], bounds: tuple[float, float], time: FloatArray) -> FloatArray:
    """Simulated position at `time`, NaN from the first sample out of centre +/- limit on."""
    simulator = start_bench(bench, *start)
    context = simulator.get_context()
    centre, limit = bounds
    position = np.full(time.size, np.nan)
    end = 0.0
    while end < time[-1]:
        end = min(end + CHUNK, float(time[-1]))
        try:
            simulator.AdvanceTo(end)
        except (RuntimeError, ArithmeticError, ValueError):  # numbers that ran away inside the chunk: seen below
            break
        angle = bench.plant.GetPositions(bench.plant.GetMyContextFromRoot(context))[0]
        if not abs(angle - centre) <= limit:
            break
    log = np.asarray(bench.state_log.FindLog(context).data()[0])[: time.size]
    position[: log.size] = log
    lost = np.flatnonzero(~(np.abs(log - centre) <= limit))
    if lost.size:
        position[lost[0] :] = np.nan
    return position


LONGEST_STEP = 1.5e-3
"""Logs on slower clocks are simulated in several steps a sample [s]; the command is held between them."""


def rig_free_run(
    model: ActuatorModel, rig: Rig, joint: str, run: Run
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """(time, recorded, simulated position), (T,) each, over the longest usable stretch of `run` up to `LONGEST` [s].

    None where the model has no inertia that a free run could move, or where a load that is a curve over the position
    meets an effect that depends on the load (`in_plant`). A diverged run is NaN from there on.
    """
    stretch = longest_stretch(run, LONGEST)
    if stretch is None:
        return None
    placed = in_plant(model, recording_of(rig, joint, run, stretch))
    if placed is None:
        return None
    try:
        simulated = free_run(*placed, substeps=max(1, math.ceil(run.period / LONGEST_STEP - 1e-9)))
    except ParamsError:
        return None
    recorded = run.columns[f"{joint}/position"][stretch]
    return np.asarray(run.time[stretch] - run.time[0]), recorded, simulated
