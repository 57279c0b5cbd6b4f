"""The stages between reference and guard, each a system, wired for one robot."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer

from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.estimation.wrench_tare import WrenchTare
from drake_tc.loops.ports import first_imu, picked
from drake_tc.loops.torque.builder import TorqueLoopBuilder
from drake_tc.loops.torque.observer import connect_observer, prediction
from drake_tc.loops.torque.ports import base_now, zeroed
from drake_tc.loops.torque.spec import sensor_suite
from drake_tc.robot.plant import joint_limits
from drake_tc.sensor_validation.fault_monitor import FaultMonitor


def servo_command(parts: TorqueLoopBuilder, reference: OutputPort) -> OutputPort:
    """The reference itself; the vendor's servo does the rest."""
    n = len(parts.robot.joints)
    split = parts.builder.AddNamedSystem("reference_position", Demultiplexer([n, 2 * n]))
    parts.builder.Connect(reference, split.get_input_port())
    nothing: Any = np.zeros(1)
    sound = parts.builder.AddNamedSystem("no_fault", ConstantVectorSource(nothing))
    parts.signals["reference"] = reference
    return _guarded(parts, split.get_output_port(0), sound.get_output_port())


def torque_command(parts: TorqueLoopBuilder, reference: OutputPort) -> OutputPort:
    """Reference to command through filters, estimator, inverse dynamics and torque control."""
    scenario = parts.scenario
    estimates, ports = _estimation(parts)
    sensed = parts.sensors.joint_torque.GetOutputPort("reading")
    torque = estimates["estimated_torque"]
    parts.signals |= {"reference": reference, **estimates}
    delayed = {
        "joint_estimate": ports["joint_estimate"],
        "estimated_torque": sensed if scenario.torque_from == "sensor" else torque,
        "position": parts.sensors.encoder.GetOutputPort("reading"),
    }
    known, observer = prediction(parts, delayed)
    moved = {name: known[name] for name in ("joint_estimate", "position")} | {"reference": reference}
    if not parts.controller_robot.fixed_base:
        predicted = scenario.predictor is not None
        moved["base_joint_estimate"] = known["joint_estimate"]
        moved["imu_estimate"] = base_now(parts) if predicted else ports["imu_estimate"]
    _inverse_dynamics(parts, estimates, moved)
    parts.signals["desired_torque"] = desired = parts.output("inverse_dynamics", "desired_torque")
    _torque_control(parts, known, desired, reference)
    flags = _monitor(parts, estimates, reference)
    if scenario.log_components:
        parts.signals["components"] = parts.output("torque_control", "components")
    command = _guarded(parts, parts.output("torque_control", "command"), flags)
    if observer is not None:
        connect_observer(parts, observer, delayed, known, reference, command)
    return command


def _torque_control(
    parts: TorqueLoopBuilder, known: Mapping[str, OutputPort], desired: OutputPort, reference: OutputPort
) -> None:
    """The torque control, which compensates a disturbance where one is known."""
    scenario = parts.scenario
    limit, disturbed = joint_limits(parts.robot).effort, "disturbance" in known
    wires = dict(known) | {"desired_torque": desired}
    if parts.systems["inverse_dynamics"].HasOutputPort("torque_terms"):
        wires["torque_terms"] = parts.output("inverse_dynamics", "torque_terms")
    if scenario.compensation.needs_reference:
        wires["reference"] = reference
    parts.add(
        "torque_control",
        lambda: TorqueControl(
            parts.models, parts.gains, limit, scenario.dt, scenario.compensation, disturbance=disturbed
        ),
        **wires,
    )


def _inverse_dynamics(
    parts: TorqueLoopBuilder, estimates: Mapping[str, OutputPort], inputs: dict[str, OutputPort]
) -> None:
    """The inverse dynamics, with a force task where a force is commanded or its share of the command is recorded."""
    scenario, robot = parts.scenario, parts.controller_robot
    asked = parts.force_reference if robot.force_torque else None
    if asked is not None:
        inputs |= {"force_reference": asked, "contact_wrench": estimates["contact_wrench"]}
    if "inverse_dynamics" in parts.stages:
        parts.add("inverse_dynamics", None, **inputs)
        return
    dynamics = InverseDynamics(
        robot,
        parts.gains,
        configuration=scenario.configuration,
        position_error="encoder",
        angular_acceleration="neglected" if scenario.angular_acceleration == "neglected" else "gyro",
        force_task=asked is not None,
    )
    parts.add("inverse_dynamics", dynamics, **inputs)


def _estimation(parts: TorqueLoopBuilder) -> tuple[dict[str, OutputPort], dict[str, OutputPort]]:
    """Filters, tare and torque estimator: the estimator's ports and the filters'."""
    scenario = parts.scenario
    spec = scenario.filters
    orders = (spec.encoder_order, spec.inertial_order)
    ports = parts.filtered_readings(parts.sensors, spec.window, orders, imu=parts.base_from == "imu")
    parts.signals["joint_estimate"] = ports["joint_estimate"]
    if "torque_estimator" in parts.stages:
        parts.add("torque_estimator", None, **ports)
        needed = ("estimated_torque", *(("contact_wrench",) if parts.robot.force_torque else ()))
        return {name: parts.output("torque_estimator", name) for name in needed}, ports
    model = TorqueModel(
        parts.controller_robot, base=parts.base_from, angular_acceleration=scenario.angular_acceleration
    )
    if scenario.tare and parts.robot.force_torque:
        filled = scenario.filters.window * scenario.dt
        tare = WrenchTare(model, filled, filled + scenario.tare)
        wires = {name: ports[name] for name in ("joint_estimate", "imu_estimate") if name in ports}
        parts.add("wrench_tare", tare, wrench=ports["wrench_estimate"], **wires)
        ports["wrench_estimate"] = zeroed(parts, "zeroed_wrench", ports["wrench_estimate"])
    estimator = JointTorqueEstimator(model)
    parts.add("torque_estimator", estimator, **ports)
    places = {name: list(range(part.start, part.stop)) for name, part in estimator.parts.items()}
    found = picked(parts.builder, "torque_estimates", estimator.GetOutputPort("estimate"), places)
    return {name: parts.passed(f"torque_estimator.{name}", port) for name, port in found.items()}, ports


def _monitor(parts: TorqueLoopBuilder, estimates: Mapping[str, OutputPort], reference: OutputPort) -> OutputPort:
    """The fault monitor's port `any_fault`; where nothing may touch the robot, a contact wrench is a fault."""
    robot, scenario, sensors = parts.robot, parts.scenario, parts.sensors
    free = tuple(mount.name for mount in robot.force_torque) if parts.free else ()
    n = len(robot.joints)
    rate = parts.builder.AddNamedSystem("reference_velocity", Demultiplexer([n, n, n]))
    parts.builder.Connect(reference, rate.get_input_port())
    wires = {"position": sensors.encoder.GetOutputPort("reading"), "reference_velocity": rate.get_output_port(1)}
    if sensors.imu is not None:
        wires["imu"] = first_imu(parts.builder, sensors.imu.GetOutputPort("reading"))
    if sensors.force_torque is not None:
        wires["wrench"] = sensors.force_torque.GetOutputPort("reading")
        wires["contact_wrench"] = estimates["contact_wrench"]
    spec = scenario.monitor.for_sensors(sensor_suite(scenario))
    monitor = parts.add("fault_monitor", lambda: FaultMonitor(robot, spec, scenario.dt, free), **wires)
    if isinstance(monitor, FaultMonitor):
        parts.flag_names = tuple(monitor.flag_names)
        parts.signals["flags"] = monitor.GetOutputPort("flags")
    return parts.output("fault_monitor", "any_fault")


def _guarded(parts: TorqueLoopBuilder, command: OutputPort, fault: OutputPort) -> OutputPort:
    """The command behind the guard."""
    encoder = parts.sensors.encoder.GetOutputPort("reading")
    n = len(parts.robot.joints)
    guard = parts.add(
        "guard",
        lambda: CommandGuard(n, parts.scenario.dt, parts.scenario.guard),
        command=command,
        position=encoder,
        fault=fault,
    )
    if isinstance(guard, CommandGuard):
        parts.signals |= picked(parts.builder, "guard_state", guard.GetOutputPort("next"), {"mode": [3 * n]})
    return parts.output("guard", "command")
