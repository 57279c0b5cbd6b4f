"""Recordings for motor identification: a joint under a low-gain position loop in volts, and a hand that pulls.

reference --> position loop (PD, volts) --> actuators (motor, gear, spring) --> plant (link) <-- hand's torque
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.wiring import add_actuators
from drake_tc.identification.excitation import Motion, MotionLimits, growing_sinusoid, trapezoids
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig
from drake_tc.loops.joint_bench import JOINT, make_plant
from drake_tc.loops.recording import add_log
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.sensing.corruption import corrupt
from drake_tc.sensing.suite import sensor_seed
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Excitation:
    """How a joint is moved.

    Attributes:
        stiffness, damping: Of the position loop [V/rad, V s/rad].
        limits: Of the motion.
        pull: Amplitude of the hand's torque [N m].
        duration: Of each run [s].
        step: Of motor and link [s]: finer than the scenario's, as a step h adds F_v h/2 to the motor's inertia.
    """

    stiffness: float = 40.0
    damping: float = 0.5
    limits: MotionLimits = field(default_factory=lambda: MotionLimits((-0.8, 0.8), 3.0, 40.0))
    pull: float = 12.0
    duration: float = 10.0
    step: float = 2.5e-4


def motions(excitation: Excitation, time: FloatArray) -> dict[str, Motion]:
    """Growing sines and trapezoids, as the paper's, and a sine of another frequency to judge by."""
    limits = excitation.limits
    targets = [0.0, 0.7, -0.7, 0.4, -0.5, 0.1, 0.6, -0.2, -0.7, 0.0] * 3
    slow = MotionLimits(limits.position, 0.5 * limits.velocity, 0.3 * limits.acceleration)
    return {
        "sines": growing_sinusoid(time, 0.7, 0.1, 0.04, limits),
        "faster_sines": growing_sinusoid(time, 1.7, 0.05, 0.01, limits),
        "trapezoids": trapezoids(time, targets, slow, 0.3),
        "held_out": growing_sinusoid(time, 1.1, 0.6, -0.02, limits),
    }


def record_excitation(scenario: SeaScenario, excitation: Excitation | None = None) -> tuple[dict[str, Run], Rig]:
    """Runs by name, as the joint's own sensors see them, and their rig.

    Args:
        scenario: Motor, link and sensors; its torque law plays no part.
        excitation: How it is moved.

    Returns:
        Runs with the motor's position, the voltage and the spring's torque; the last one, `held_out`, to judge by. The
        rig declares the motor's inertia.
    """
    how = excitation or Excitation()
    time = np.arange(round(how.duration / scenario.dt) + 1, dtype=np.float64) * scenario.dt
    runs = {name: _record(scenario, how, name, time, motion) for name, motion in motions(how, time).items()}
    inertia = scenario.actuator().inertia
    declared = {scenario.joint: {"rotor_inertia": inertia}}
    rig = parse_rig({"joints": [scenario.joint], "drive": "voltage", "load": "torque", "declared": declared})
    return runs, rig


def _record(scenario: SeaScenario, how: Excitation, name: str, time: FloatArray, motion: Motion) -> Run:
    builder = DiagramBuilder()
    plant = make_plant(scenario.link, how.step)
    builder.AddNamedSystem("plant", plant)
    actuators = add_actuators(builder, plant, {JOINT: replace(scenario.actuator(), joint=JOINT)}, how.step)
    gains: Any = [np.array([how.stiffness]), np.array([0.0]), np.array([how.damping])]
    loop = PidController(*gains)
    builder.AddNamedSystem("position_loop", loop)
    desired = _line(time, np.stack([motion.position, motion.velocity]))
    source = builder.AddNamedSystem("reference", TrajectorySource(desired))
    pull = how.pull * np.sin(2.0 * np.pi * 0.31 * time) * np.clip(time, 0.0, 1.0)
    hand = builder.AddNamedSystem("hand", TrajectorySource(_line(time, pull[None, :])))
    builder.Connect(source.get_output_port(), loop.get_input_port_desired_state())
    builder.Connect(actuators.GetOutputPort("motor_state"), loop.get_input_port_estimated_state())
    builder.Connect(loop.get_output_port(), actuators.GetInputPort("command"))
    builder.Connect(hand.get_output_port(), plant.get_applied_generalized_force_input_port())
    signals = {
        "motor_state": actuators.GetOutputPort("motor_state"),
        "torque": actuators.GetOutputPort("transmitted_torque"),
        "voltage": loop.get_output_port(),
    }
    log = add_log(builder, signals, scenario.dt)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(how.duration)
    _, found = log.recorded(simulator.get_context())
    sensors, seeds = scenario.sensors, sensor_seed(scenario.seed, name)
    position = corrupt(found["motor_state"][:, :1], sensors.motor_encoder, scenario.dt, (), seeds)[:, 0]
    torque = corrupt(found["torque"], sensors.torque, scenario.dt, (), seeds + 1)[:, 0]
    columns = {
        f"{scenario.joint}/position": position,
        f"{scenario.joint}/voltage": found["voltage"][:, 0],
        f"{scenario.joint}/torque": torque,
    }
    usable = np.zeros(time.size, dtype=np.int64)
    return Run(name, None, time, scenario.dt, columns, usable)


def _line(time: FloatArray, values: FloatArray) -> PiecewisePolynomial:
    make: Any = PiecewisePolynomial.FirstOrderHold
    path: PiecewisePolynomial = make(np.append(time, time[-1] + 1.0), np.append(values, values[:, -1:], axis=1))
    return path
