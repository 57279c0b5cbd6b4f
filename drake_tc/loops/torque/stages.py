"""The stages between reference and guard, each a system, wired for one scenario."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.estimation.wrench_tare import WrenchTare
from drake_tc.loops.ports import first_imu, picked
from drake_tc.loops.torque.observer import connect_observer, prediction
from drake_tc.loops.torque.parts import TorqueLoopBuilder, actuator_models, believed_robot, sensor_suite, torque_gains
from drake_tc.loops.torque.ports import base_now, zeroed
from drake_tc.loops.torque.references import References, table_source
from drake_tc.loops.torque.rigid_torque import rigid_torque
from drake_tc.robot.plant import joint_limits
from drake_tc.sensor_validation.fault_monitor import FaultMonitor


def servo_command(parts: TorqueLoopBuilder, wanted: References) -> OutputPort:
    """The reference itself; the vendor's servo does the rest."""
    n = len(parts.robot.joints)
    source = parts.builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion))
    split = parts.builder.AddNamedSystem("reference_position", Demultiplexer([n, 2 * n]))
    parts.builder.Connect(source.get_output_port(), split.get_input_port())
    nothing: Any = np.zeros(1)
    sound = parts.builder.AddNamedSystem("no_fault", ConstantVectorSource(nothing))
    parts.signals["reference"] = source.get_output_port()
    return _guarded(parts, split.get_output_port(0), sound.get_output_port())


def torque_command(parts: TorqueLoopBuilder, wanted: References) -> OutputPort:
    """Reference to command through filters, estimator, inverse dynamics and torque control."""
    builder, scenario = parts.builder, parts.scenario
    reference = builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion)).get_output_port()
    estimates, ports = _estimation(parts)
    sensed = parts.sensors.joint_torque.GetOutputPort("reading")
    torque = estimates["estimated_torque"]
    delayed = {
        "joint_estimate": ports["joint_estimate"],
        "estimated_torque": sensed if scenario.torque_from == "sensor" else torque,
        "position": parts.sensors.encoder.GetOutputPort("reading"),
    }
    models = list(actuator_models(scenario, parts.robot, controller=True).values())
    known, observer = prediction(parts, models, delayed)
    moved = {name: known[name] for name in ("joint_estimate", "position")} | {"reference": reference}
    if not believed_robot(parts).fixed_base:
        predicted = scenario.predictor is not None
        moved["base_joint_estimate"] = known["joint_estimate"]
        moved["imu_estimate"] = base_now(parts) if predicted else ports["imu_estimate"]
    dynamics = _inverse_dynamics(parts, wanted, estimates, moved)
    control = _torque_control(parts, models, known, dynamics, reference)
    monitor = _monitor(parts, estimates, reference)
    parts.signals |= {
        "reference": reference,
        "desired_torque": dynamics.GetOutputPort("desired_torque"),
        "estimated_torque": torque,
        "flags": monitor.GetOutputPort("flags"),
    }
    if scenario.log_components:
        parts.signals["components"] = control.GetOutputPort("components")
    command = _guarded(parts, control.GetOutputPort("command"), monitor.GetOutputPort("any_fault"))
    if observer is not None:
        feedforward = dynamics.GetOutputPort("feedforward_torque")
        connect_observer(parts, observer, delayed, known, control, feedforward, reference, command)
    return command


def _torque_control(
    parts: TorqueLoopBuilder,
    models: list[ActuatorModel],
    known: Mapping[str, OutputPort],
    dynamics: InverseDynamics,
    reference: OutputPort,
) -> TorqueControl:
    """The torque control, which compensates a disturbance where one is known."""
    scenario = parts.scenario
    limit, gains = joint_limits(parts.robot).effort, torque_gains(scenario, parts.robot)
    disturbed = "disturbance" in known
    control = TorqueControl(models, gains, limit, scenario.dt, scenario.compensation, disturbance=disturbed)
    wires = dict(known) | {name: dynamics.GetOutputPort(name) for name in ("desired_torque", "torque_terms")}
    if scenario.compensation.wants_reference:
        wires["reference"] = reference
    return parts.add("torque_control", control, **wires)  # type: ignore[no-any-return]


def _inverse_dynamics(
    parts: TorqueLoopBuilder, wanted: References, estimates: Mapping[str, OutputPort], inputs: dict[str, OutputPort]
) -> InverseDynamics:
    """The inverse dynamics, with a force task where the scenario has one or wants to see its share of the command.

    What a table of wanted motions asks of a robot with a welded base is computed by a block of Drake's own.
    """
    scenario, robot, builder = parts.scenario, believed_robot(parts), parts.builder
    gains = torque_gains(scenario, parts.robot)
    force_task = bool(scenario.force) or bool(gains.kf.any()) or scenario.log_components
    if robot.force_torque:
        source = builder.AddNamedSystem("force_reference", table_source(wanted.time, wanted.force))
        forces = {"force_reference": source.get_output_port(), "contact_wrench": estimates["contact_wrench"]}
        inputs |= forces if force_task else {}
        parts.signals |= forces
    from_table = robot.fixed_base and scenario.configuration == "reference"
    dynamics = InverseDynamics(
        robot,
        gains,
        configuration=scenario.configuration,
        position_error="encoder",
        angular_acceleration="neglected" if scenario.angular_acceleration == "neglected" else "gyro",
        inertial="port" if from_table else "own",
        force_task=force_task and bool(robot.force_torque),
    )
    if from_table:
        inputs["inertial_torque"] = rigid_torque(builder, dynamics.terms, inputs["reference"])
    return parts.add("inverse_dynamics", dynamics, **inputs)  # type: ignore[no-any-return]


def _estimation(parts: TorqueLoopBuilder) -> tuple[dict[str, OutputPort], dict[str, OutputPort]]:
    """Filters, tare and torque estimator: the estimator's ports and the filters'."""
    scenario = parts.scenario
    spec = scenario.filters
    orders = (spec.encoder_order, spec.inertial_order)
    ports = parts.filtered_readings(parts.sensors, spec.window, orders, imu=scenario.base_from == "imu")
    robot = believed_robot(parts)
    model = TorqueModel(robot, base=scenario.base_from, angular_acceleration=scenario.angular_acceleration)
    if scenario.tare and parts.robot.force_torque:
        filled = scenario.filters.window * scenario.dt
        tare = WrenchTare(model, filled, filled + scenario.tare)
        wires = {name: ports[name] for name in ("joint_estimate", "imu_estimate") if name in ports}
        parts.add("wrench_tare", tare, wrench=ports["wrench_estimate"], **wires)
        ports["wrench_estimate"] = zeroed(parts, "zeroed_wrench", ports["wrench_estimate"])
    estimator = JointTorqueEstimator(model)
    parts.add("torque_estimator", estimator, **ports)
    places = {name: list(range(part.start, part.stop)) for name, part in estimator.parts.items()}
    return picked(parts.builder, "torque_estimates", estimator.GetOutputPort("estimate"), places), ports


def _monitor(parts: TorqueLoopBuilder, estimates: Mapping[str, OutputPort], reference: OutputPort) -> FaultMonitor:
    """The fault monitor; where nothing is to be touched, a contact wrench is a fault."""
    robot, scenario, sensors = parts.robot, parts.scenario, parts.sensors
    touched = scenario.objects or scenario.pushes
    free = () if touched else tuple(mount.name for mount in robot.force_torque)
    n = len(robot.joints)
    rate = parts.builder.AddNamedSystem("reference_velocity", Demultiplexer([n, n, n]))
    parts.builder.Connect(reference, rate.get_input_port())
    wires = {"encoder": sensors.encoder.GetOutputPort("reading"), "reference_velocity": rate.get_output_port(1)}
    if sensors.imu is not None:
        wires["imu"] = first_imu(parts.builder, sensors.imu.GetOutputPort("reading"))
    if sensors.force_torque is not None:
        wires["wrench"] = sensors.force_torque.GetOutputPort("reading")
        wires["contact_wrench"] = estimates["contact_wrench"]
    spec = scenario.monitor.without_noise(sensor_suite(scenario))
    monitor = FaultMonitor(robot, spec, scenario.dt, free)
    parts.add("fault_monitor", monitor, **wires)
    parts.flag_names = tuple(monitor.flag_names)
    return monitor


def _guarded(parts: TorqueLoopBuilder, command: OutputPort, fault: OutputPort) -> OutputPort:
    """The command behind the guard."""
    encoder = parts.sensors.encoder.GetOutputPort("reading")
    n = len(parts.robot.joints)
    guard = CommandGuard(n, parts.scenario.dt, parts.scenario.guard)
    parts.add("guard", guard, command=command, position=encoder, fault=fault)
    parts.signals |= picked(parts.builder, "guard_state", guard.GetOutputPort("next"), {"mode": [3 * n]})
    return guard.GetOutputPort("command")
