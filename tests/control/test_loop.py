"""The systems wired: a pendulum with friction tracks better than its own servo, and survives a lost encoder."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, MatrixGain, Multiplexer, TrajectorySource

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard, GuardMode, GuardSpec
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.robot.plant import make_plant

from .robots import dynamics, pendulum

K_TAU = np.array([1e-3, 2e-3])
DT = 1e-3
MODELS = {
    name: ActuatorModel(
        name,
        Drive("position_servo", k),
        (
            EffectValue("viscous", {"viscous": 30.0}),
            EffectValue("coulomb", {"coulomb": 2.0}),
            EffectValue("rotor_inertia", {"rotor_inertia": 0.4}),
        ),
    )
    for name, k in zip(("shoulder", "elbow"), K_TAU, strict=True)
}
MOTION = knot_trajectory([0.0, 0.5, 1.3, 2.0], [[0.2, 0.3], [0.2, 0.3], [-0.5, 1.0], [0.4, 0.2]])


class Loop:
    def __init__(self, robot, *, torque: bool):
        builder = DiagramBuilder()
        self.plant = builder.AddNamedSystem("plant", make_plant(robot, DT))
        self.actuators = add_actuators(builder, self.plant, MODELS, DT)
        self.guard = builder.AddNamedSystem("guard", CommandGuard(2, DT, GuardSpec(start_time=0.2)))
        source = builder.AddNamedSystem("reference", TrajectorySource(MOTION, 2))
        encoder = builder.AddNamedSystem("encoder", MatrixGain(np.eye(2, 4)))
        builder.Connect(self.plant.get_state_output_port(), encoder.get_input_port())
        if torque:
            command = self.add_torque_control(builder, robot, source, encoder)
        else:
            servo = builder.AddNamedSystem("servo", MatrixGain(np.eye(2, 6)))  # the reference position itself
            builder.Connect(source.get_output_port(), servo.get_input_port())
            command = servo.get_output_port()
        builder.Connect(command, self.guard.GetInputPort("command"))
        builder.Connect(encoder.get_output_port(), self.guard.GetInputPort("position"))
        builder.ExportInput(self.guard.GetInputPort("fault"), "fault")
        builder.Connect(self.guard.GetOutputPort("command"), self.actuators.GetInputPort("command"))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.diagram.GetInputPort("fault").FixValue(self.context, [0.0])
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.plant.SetPositions(self.plant_context, [0.2, 0.3])

    def add_torque_control(self, builder, robot, source, encoder):
        gains = TorqueGains.from_servo([MODELS[name] for name in robot.joints], 1.0, 15.0 * K_TAU, 2.0, kf=np.zeros(6))
        dynamics_system = builder.AddNamedSystem("inverse_dynamics", InverseDynamics(robot, gains))
        spec = CompensationSpec(velocity="reference")
        models = [MODELS[name] for name in robot.joints]
        control = builder.AddNamedSystem("torque", TorqueControl(models, gains, np.full(2, 200.0), DT, spec))
        nothing = builder.AddNamedSystem("nothing", ConstantVectorSource(np.zeros(6)))
        still = builder.AddNamedSystem("still", ConstantVectorSource(np.zeros(2)))
        estimate = builder.AddNamedSystem("estimate", Multiplexer([4, 2]))
        builder.Connect(self.plant.get_state_output_port(), estimate.get_input_port(0))
        builder.Connect(still.get_output_port(), estimate.get_input_port(1))
        for system in (dynamics_system, control):
            builder.Connect(estimate.get_output_port(), system.GetInputPort("joint_estimate"))
            builder.Connect(source.get_output_port(), system.GetInputPort("reference"))
        for name in ("force_reference", "contact_wrench"):
            builder.Connect(nothing.get_output_port(), dynamics_system.GetInputPort(name))
        builder.Connect(encoder.get_output_port(), control.GetInputPort("position"))
        for name in ("desired_torque", "torque_terms"):
            builder.Connect(dynamics_system.GetOutputPort(name), control.GetInputPort(name))
        # an estimate that agrees with what is wanted: feedforward and position feedback alone
        builder.Connect(dynamics_system.GetOutputPort("desired_torque"), control.GetInputPort("estimated_torque"))
        return control.GetOutputPort("command")

    def errors(self, ticks=2000):
        rows = []
        for k in range(1, ticks + 1):
            self.simulator.AdvanceTo(k * DT)
            rows.append(self.plant.GetPositions(self.plant_context) - MOTION.value(k * DT).ravel())
        return np.array(rows)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return pendulum(tmp_path_factory.mktemp("pendulum"))


def test_torque_control_tracks_better_than_the_servo(robot):
    servo, torque = (np.sqrt(np.mean(Loop(robot, torque=t).errors() ** 2, axis=0)) for t in (False, True))
    assert np.all(torque < 0.2 * servo), (torque, servo)


def test_a_fault_for_good_is_held_and_then_damped(robot):
    loop = Loop(robot, torque=True)
    loop.simulator.AdvanceTo(1.0)
    loop.diagram.GetInputPort("fault").FixValue(loop.context, [1.0])
    speeds = []
    for k in range(1001, 6000, 5):
        loop.simulator.AdvanceTo(k * DT)
        speeds.append(loop.plant.GetVelocities(loop.plant_context))
    assert np.all(np.abs(speeds[60:]) < 0.55)  # damp_rate and what friction gives beyond it
    guard_context = loop.guard.GetMyContextFromRoot(loop.context)
    assert loop.guard.GetOutputPort("mode").Eval(guard_context)[0] == GuardMode.DAMP


def test_at_rest_the_feedforward_is_gravity(robot):
    """A closed form for the whole way: at rest on the reference, q_d - q = K_tau h."""
    loop = Loop(robot, torque=True)
    control = loop.diagram.GetSubsystemByName("torque")
    context = control.GetMyContextFromRoot(loop.context)
    q = np.array([0.2, 0.3])
    expected = q + K_TAU * dynamics(q, np.zeros(2))[1]
    assert_allclose(control.GetOutputPort("command").Eval(context), expected, rtol=1e-7)
