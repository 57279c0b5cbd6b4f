"""The diagram of the joint bench, of which a recorded rig and a free run are two uses.

command (table) --> ActuatorPlant --actuation--> MultibodyPlant(one revolute joint) --state--> log
^---------------- state --------|------ reaction torque ----------> torque sensor --> log
applied (table) ------------ torque on the link -------->|
"""

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

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.recorded_run import Link
from drake_tc.actuation.wiring import add_actuators
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
