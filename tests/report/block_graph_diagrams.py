"""Diagrams to draw: a torque control loop, the joint bench, nested diagrams, and one of odd names."""

import re

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Gain,
    LogVectorOutput,
    PassThrough,
    TrajectorySource,
    ZeroOrderHold,
)
from pydrake.systems.sensors import Accelerometer, Gyroscope
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.actuation.recorded_run import Link
from drake_tc.loops.joint_bench import Rates, Table, build_bench

ODD = 'a "b" <c>|{d} \\e; %% --> ]) end é 関節 #35;'
N = 3


class Stage(LeafSystem):
    """Inputs and outputs of given sizes; outputs named in `held` follow a state, the others every input."""

    def __init__(self, inputs, outputs, held=(), period=1e-3):
        super().__init__()
        tickets = {self.DeclareVectorInputPort(name, size).ticket() for name, size in inputs.items()}
        self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, lambda context, state: None)
        for name, size in outputs.items():
            after = {self.xd_ticket()} if name in held else tickets
            self.DeclareVectorOutputPort(name, size, lambda context, output: None, after)


def staged(kind, module, *arguments, **named):
    return type(kind, (Stage,), {"__module__": f"drake_tc.{module}"})(*arguments, **named)


def chain(links: int) -> MultibodyPlant:
    plant = MultibodyPlant(1e-3)
    parent = plant.world_body()
    for i in range(links):
        body = plant.AddRigidBody(f"link_{i}", SpatialInertia(1.0, np.zeros(3), UnitInertia(1.0, 1.0, 1.0)))
        axis = np.array([0.0, 1.0, 0.0])
        joint = plant.AddJoint(RevoluteJoint(f"joint_{i}", parent.body_frame(), body.body_frame(), axis))
        plant.AddJointActuator(f"joint_{i}", joint)
        parent = body
    plant.Finalize()
    return plant


def torque_loop():
    """A torque control loop with two feedback paths, a monitor, logs and an exported input."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", chain(N))
    knots = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], np.zeros((N, 2)))
    blocks = {
        "reference": TrajectorySource(knots, 2),
        "inverse_dynamics": staged(
            "InverseDynamics",
            "control.inverse_dynamics",
            {"joint_estimate": 3 * N, "reference": 3 * N, "contact_wrench": 6},
            {"desired_torque": N, "torque_terms": 6 * N},
        ),
        "torque_control": staged(
            "TorqueControl",
            "control.torque_control",
            {"desired_torque": N, "torque_terms": 6 * N, "estimated_torque": N, "position": N},
            {"command": N, "components": 6 * N},
        ),
        "guard": staged("CommandGuard", "control.guard", {"command": N, "position": N, "fault": 1}, {"command": N}),
        "actuators": staged("ActuatorPlant", "actuation.plant", {"command": N, "state": 2 * N}, {"actuation": N}),
        "positions": Gain(np.ones(2 * N)),
        "encoder": staged("Encoder", "sensing.encoder", {"truth": 2 * N}, {"reading": N}),
        "accelerometer": Accelerometer(plant.GetBodyByName("link_0"), RigidTransform()),
        "gyroscope": Gyroscope(plant.GetBodyByName("link_0"), RigidTransform()),
        "joint_filter": staged(
            "Filter", "filtering.savitzky_golay", {"signal": N}, {"estimate": 3 * N}, held=("estimate",)
        ),
        "imu_filter": staged("Filter", "filtering.savitzky_golay", {"signal": 3}, {"estimate": 9}, held=("estimate",)),
        "estimator": staged(
            "JointTorqueEstimator",
            "estimation.joint_torque",
            {"joint_estimate": 3 * N, "imu_estimate": 9},
            {"estimated_torque": N, "contact_wrench": 6},
        ),
        "monitor": staged(
            "FaultMonitor",
            "sensor_validation.fault_monitor",
            {"encoder": N, "imu": 3, "gyro": 3, "unknown_wrench": 6},
            {"fault": 1, "flags": 5},
            held=("fault", "flags"),
        ),
    }
    for name, system in blocks.items():
        builder.AddNamedSystem(name, system)
    connections = """
        reference.y0 inverse_dynamics.reference; inverse_dynamics.desired_torque torque_control.desired_torque
        inverse_dynamics.torque_terms torque_control.torque_terms; torque_control.command guard.command
        guard.command actuators.command; actuators.actuation plant.actuation; plant.state actuators.state
        plant.state positions.u0; positions.y0 encoder.truth; encoder.reading joint_filter.signal
        encoder.reading torque_control.position; encoder.reading guard.position; encoder.reading monitor.encoder
        plant.body_poses accelerometer.body_poses; accelerometer.measurement imu_filter.signal
        plant.body_spatial_velocities accelerometer.body_spatial_velocities
        plant.body_spatial_accelerations accelerometer.body_spatial_accelerations
        plant.body_poses gyroscope.body_poses; gyroscope.measurement monitor.gyro
        plant.body_spatial_velocities gyroscope.body_spatial_velocities
        accelerometer.measurement monitor.imu; joint_filter.estimate estimator.joint_estimate
        imu_filter.estimate estimator.imu_estimate; joint_filter.estimate inverse_dynamics.joint_estimate
        estimator.estimated_torque torque_control.estimated_torque; monitor.fault guard.fault
        estimator.contact_wrench inverse_dynamics.contact_wrench; estimator.contact_wrench monitor.unknown_wrench
    """
    blocks["plant"] = plant
    for source, target in (line.split() for line in re.split(r"[;\n]", connections) if line.strip()):
        (a, out), (b, into) = source.split("."), target.split(".")
        out_port = blocks[a].get_output_port() if (a, out) == ("reference", "y0") else _port(blocks[a], out)
        builder.Connect(out_port, _entry(blocks[b], into))
    for port in (plant.get_state_output_port(), blocks["torque_control"].GetOutputPort("components")):
        LogVectorOutput(port, builder)
    builder.ExportInput(plant.get_applied_generalized_force_input_port(), "push")
    diagram = builder.Build()
    diagram.set_name("torque_loop")
    return diagram


def _port(system, name):
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    return next((p for p in ports if p.get_name() == name), ports[0])


def _entry(system, name):
    ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
    return next((p for p in ports if p.get_name() == name), ports[0])


def bench():
    time = np.arange(0.0, 0.1, 1e-2)
    table = Table(time, 0.0 * time, applied=0.0 * time)
    return build_bench(ActuatorModel("j", Drive("current", 1.0), ()), Link(1.0), table, Rates(1e-3, 1e-2), 0.1).diagram


def nested(depth: int = 3):
    """A gain in a diagram in a diagram …, each exporting both ports."""
    inner = Gain(2.0, 2)
    inner.set_name("gain")
    for level in range(depth):
        builder = DiagramBuilder()
        builder.AddSystem(inner)
        builder.ExportInput(inner.get_input_port(0), "u")
        builder.ExportOutput(inner.get_output_port(0), "y")
        inner = builder.Build()
        inner.set_name(f"level_{level}")
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("reference", ConstantVectorSource([1.0, 2.0]))
    builder.AddSystem(inner)
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(0.02, 2))
    builder.Connect(source.get_output_port(), inner.get_input_port(0))
    builder.Connect(inner.get_output_port(0), hold.get_input_port())
    return builder.Build()


def odd():
    builder = DiagramBuilder()
    system = staged("Filter", "filtering.x", {ODD: 2, "plain": 1}, {f"{ODD} out": 2})
    builder.AddNamedSystem(ODD, system)
    source = builder.AddNamedSystem('say "hi" & <bye>', ConstantVectorSource([0.0, 1.0]))
    builder.AddNamedSystem("end", PassThrough(2))
    builder.Connect(source.get_output_port(), system.get_input_port(0))
    builder.Connect(system.get_output_port(0), builder.GetSubsystemByName("end").get_input_port())
    diagram = builder.Build()
    diagram.set_name(ODD)
    return diagram


DIAGRAMS = {"torque_loop": torque_loop, "bench": bench, "nested": nested, "odd": odd}
