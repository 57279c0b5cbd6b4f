"""The whole loop on one page: a joint whose model lacks an effect, its logs, the effect, the controller, and MuJoCo.

    joint -> logs -> close_loop -> effect -> model -> torque controller -> MJCF

    python -m drake_tc.diagrams.one_page

The joint is simulated: a pendulum on a position servo, without a torque sensor. Its owner knows of the rotor inertia
and of viscous and Coulomb friction, and not of the Stribeck friction that it has too.
"""

from typing import Any

import numpy as np
import pandas as pd
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Demultiplexer,
    LogVectorOutput,
    Multiplexer,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial

import drake_tc
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.projection import TARGETS, project

STEP, PERIOD = 1e-3, 2e-3
"""Of the simulation, and of the logs [s]."""
MASS, LENGTH = 6.0, 0.3
PENDULUM = f"""<robot name="pendulum"><link name="base"/>
  <link name="shank"><inertial><origin xyz="0 0 {-LENGTH}"/><mass value="{MASS}"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="weld" type="fixed"><parent link="world"/><child link="base"/></joint>
  <joint name="knee" type="revolute"><parent link="base"/><child link="shank"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="1000" velocity="100"/></joint></robot>"""

JOINT = drake_tc.ActuatorModel(
    "knee",
    drake_tc.Drive("position_servo", 5e-4),
    (
        drake_tc.EffectValue("rotor_inertia", {"rotor_inertia": 0.3}),
        drake_tc.EffectValue("viscous", {"viscous": 8.0}),
        drake_tc.EffectValue("coulomb", {"coulomb": 4.0}),
        drake_tc.EffectValue("stribeck", {"stribeck": 3.0, "stribeck_velocity": 0.15, "stribeck_exponent": 2.0}),
    ),
)
FEEDBACK: tuple[Any, Any, Any] = (np.array([100.0]), np.zeros(1), np.array([20.0]))
"""Proportional [N m/rad], integral and derivative [N m s/rad], on the position."""
RIG = {
    "joint": "knee",
    "drive": "position_servo",
    "load": {"pendulum": {"mass": MASS, "length": LENGTH}},
    "declared": {"rotor_inertia": 0.3},
}


def pendulum() -> Any:
    """The link and its ideal actuator."""
    plant: Any = MultibodyPlant(STEP)
    Parser(plant).AddModelsFromString(PENDULUM, "urdf")
    drake_tc.add_joint_actuators(plant, {"knee": JOINT})
    plant.Finalize()
    return plant


def driven(builder: DiagramBuilder) -> tuple[Any, Any]:
    """The link and its simulated drive."""
    plant: Any = builder.AddNamedSystem("plant", pendulum())
    return plant, drake_tc.add_actuators(builder, plant, {"knee": JOINT}, dt=STEP)


def sinusoid(amplitude: float, growth: float, frequency_hz: float, duration: float = 12.0) -> PiecewisePolynomial:
    """(a0 + a t) sin(2 pi f t)."""
    return drake_tc.sinusoid_trajectory(
        drake_tc.Sinusoid((0.0,), (amplitude,), (growth,), frequency_hz=frequency_hz, duration=duration)
    )


def record(motion: PiecewisePolynomial, seed: int) -> pd.DataFrame:
    """A log of the joint under its position servo: what a CSV file of the robot would hold."""
    builder = DiagramBuilder()
    plant, actuators = driven(builder)
    goal = builder.AddSystem(TrajectorySource(motion))
    builder.Connect(goal.get_output_port(), actuators.GetInputPort("command"))
    logs = [LogVectorOutput(port, builder, PERIOD) for port in (goal.get_output_port(), plant.get_state_output_port())]
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(motion.end_time())
    command, state = (log.FindLog(simulator.get_context()) for log in logs)
    noise = np.random.default_rng(seed).normal(0.0, 1e-5, command.num_samples())
    columns = {"knee/position": state.data()[0] + noise, "knee/position_command": command.data()[0]}
    return pd.DataFrame({"time": command.sample_times(), **columns})


def tracking_error(model: drake_tc.ActuatorModel, motion: PiecewisePolynomial) -> float:
    """RMS tracking error [rad] of the torque-controlled joint whose controller has this model of its drive."""
    builder = DiagramBuilder()
    plant, actuators = driven(builder)
    link, still = pendulum(), FEEDBACK[1]  # the controller does not use the acceleration that it is told: 0
    law: Any = builder.AddSystem(InverseDynamicsController(link, *FEEDBACK, True))
    gains = drake_tc.TorqueGains.from_servo([model], kp=0.0)  # feedforward alone: no torque is measured
    torque = builder.AddSystem(drake_tc.TorqueControl([model], gains, torque_limit=200.0, dt=STEP))
    reference = builder.AddSystem(TrajectorySource(motion, output_derivative_order=2))
    desired = builder.AddSystem(Demultiplexer([2, 1]))  # [q_d, v_d] and the acceleration
    measured, estimate = builder.AddSystem(Demultiplexer([1, 1])), builder.AddSystem(Multiplexer([2, 1]))
    state = plant.get_state_output_port()
    for source, target in (
        (reference.get_output_port(), desired.get_input_port()),
        (reference.get_output_port(), torque.GetInputPort("reference")),
        (desired.get_output_port(0), law.get_input_port_desired_state()),
        (desired.get_output_port(1), law.get_input_port_desired_acceleration()),
        (state, law.get_input_port_estimated_state()),
        (state, measured.get_input_port()),
        (state, estimate.get_input_port(0)),
        (builder.AddSystem(ConstantVectorSource(still)).get_output_port(), estimate.get_input_port(1)),
        (law.get_output_port_generalized_force(), torque.GetInputPort("desired_torque")),
        (law.get_output_port_generalized_force(), torque.GetInputPort("estimated_torque")),
        (estimate.get_output_port(), torque.GetInputPort("joint_estimate")),
        (measured.get_output_port(0), torque.GetInputPort("position")),
        (torque.GetOutputPort("command"), actuators.GetInputPort("command")),
    ):
        builder.Connect(source, target)
    logs = [LogVectorOutput(port, builder, PERIOD) for port in (reference.get_output_port(), state)]
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(motion.end_time())
    aim, reached = (log.FindLog(simulator.get_context()).data()[0] for log in logs)
    return float(np.sqrt(np.mean((aim - reached) ** 2)))


def main() -> None:
    """Print what was found, what it is worth in the torque loop, and the joint for MuJoCo."""
    logs = [record(sinusoid(0.9, 0.0, 0.1), 1), record(sinusoid(0.1, 0.06, 0.4), 2)]
    result = drake_tc.close_loop(RIG, logs, holdout=[record(sinusoid(0.5, 0.02, 0.25), 3)])
    print(result)
    knee = result["knee"]
    for name, model in (("before", knee.model_before), ("after", knee.model)):
        error = tracking_error(model, sinusoid(0.0, 0.08, 0.3, 6.0))
        print(f"tracking error of the torque loop with the model {name}: {1e3 * error:.2f} mrad")
    print(to_mjcf([project(knee.model, TARGETS["mjcf"])]))


if __name__ == "__main__":
    main()
