"""The stages between reference and guard, each a system, wired for one scenario."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from drake_tc.diagrams.loop_parts import Parts, actuator_models, sensor_suite, torque_gains
from drake_tc.diagrams.references import References, table_source
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Multiplexer, Selector, SelectorParams

from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.estimation.fault_monitor import FaultMonitor
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.estimation.wrench_tare import WrenchTare
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.robot.plant import joint_limits


def servo_command(parts: Parts, wanted: References) -> OutputPort:
    """The reference itself; the vendor's servo does the rest."""
    n = len(parts.robot.joints)
    source = parts.builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion))
    split = parts.builder.AddNamedSystem("reference_position", Demultiplexer([n, 2 * n]))
    parts.builder.Connect(source.get_output_port(), split.get_input_port())
    nothing: Any = np.zeros(1)
    sound = parts.builder.AddNamedSystem("no_fault", ConstantVectorSource(nothing))
    parts.signals["reference"] = source.get_output_port()
    return _guarded(parts, split.get_output_port(0), sound.get_output_port())


def torque_command(parts: Parts, wanted: References) -> OutputPort:
    """Reference to command through filters, estimator, inverse dynamics and torque control."""
    builder, scenario = parts.builder, parts.scenario
    reference = builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion)).get_output_port()
    estimator, joint_estimate = _estimation(parts)
    dynamics = _inverse_dynamics(parts, wanted, estimator, {"joint_estimate": joint_estimate, "reference": reference})
    models = list(actuator_models(scenario, parts.robot, controller=True).values())
    limit = joint_limits(parts.robot).effort
    control = TorqueControl(models, torque_gains(scenario, parts.robot), limit, scenario.dt, scenario.compensation)
    estimated = estimator.GetOutputPort("estimated_torque")
    sensed = scenario.torque_from == "sensor"
    wires = {
        "desired_torque": dynamics.GetOutputPort("desired_torque"),
        "torque_terms": dynamics.GetOutputPort("torque_terms"),
        "estimated_torque": parts.sensors.joint_torque.GetOutputPort("reading") if sensed else estimated,
        "joint_estimate": joint_estimate,
        "position": parts.sensors.encoder.GetOutputPort("reading"),
    }
    if scenario.compensation.wants_reference:
        wires["reference"] = reference
    parts.add("torque_control", control, **wires)
    monitor = _monitor(parts, estimator, reference)
    parts.signals |= {
        "reference": reference,
        "desired_torque": wires["desired_torque"],
        "estimated_torque": estimated,
        "flags": monitor.GetOutputPort("flags"),
    }
    if scenario.log_components:
        parts.signals["components"] = control.GetOutputPort("components")
    return _guarded(parts, control.GetOutputPort("command"), monitor.GetOutputPort("any_fault"))


def _inverse_dynamics(
    parts: Parts, wanted: References, estimator: JointTorqueEstimator, inputs: dict[str, OutputPort]
) -> InverseDynamics:
    """The inverse dynamics, with a force task where the robot has F/T sensors."""
    inputs = inputs | {"position": parts.sensors.encoder.GetOutputPort("reading")}
    if parts.robot.force_torque:
        source = parts.builder.AddNamedSystem("force_reference", table_source(wanted.time, wanted.force))
        forces = {
            "force_reference": source.get_output_port(),
            "contact_wrench": estimator.GetOutputPort("contact_wrench"),
        }
        inputs |= forces
        parts.signals |= forces
    dynamics = InverseDynamics(
        parts.robot,
        torque_gains(parts.scenario, parts.robot),
        configuration=parts.scenario.configuration,
        position_error="encoder",
    )
    return parts.add("inverse_dynamics", dynamics, **inputs)  # type: ignore[no-any-return]


def _filters(parts: Parts) -> dict[str, OutputPort]:
    """One Savitzky–Golay filter behind all sensors; the ports that the estimator reads."""
    spec, robot, sensors, builder = parts.scenario.filters, parts.robot, parts.sensors, parts.builder
    readings = {"joint_estimate": sensors.encoder.GetOutputPort("reading")}
    derivatives = {"joint_estimate": 3, "imu_estimate": 2, "wrench_estimate": 1}
    if sensors.imu is not None and parts.scenario.base_from == "imu":
        readings["imu_estimate"] = _first_imu(parts)
    if sensors.force_torque is not None:
        readings["wrench_estimate"] = sensors.force_torque.GetOutputPort("reading")
    sizes = [port.size() for port in readings.values()]
    joined = builder.AddNamedSystem("readings", Multiplexer(sizes))
    for index, port in enumerate(readings.values()):
        builder.Connect(port, joined.get_input_port(index))
    n, total = len(robot.joints), sum(sizes)
    orders = [spec.encoder_order] * n + [spec.inertial_order] * (total - n)
    smooth = SavitzkyGolayFilter(total, spec.window, orders, parts.scenario.dt)
    parts.add("filter", smooth, signal=joined.get_output_port())
    first = dict(zip(readings, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    wanted = {
        name: [d * total + first[name] + i for d in range(derivatives[name]) for i in range(size)]
        for name, size in zip(readings, sizes, strict=True)
    }
    return _picked(builder, "estimates", smooth.GetOutputPort("estimate"), wanted)


def _picked(
    builder: DiagramBuilder, name: str, source: OutputPort, wanted: Mapping[str, list[int]]
) -> dict[str, OutputPort]:
    """Ports with some elements of another one each, by name."""
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="all", size=source.size())]
    pick = SelectorParams.OutputSelection
    params.outputs = [
        SelectorParams.OutputPortParams(
            name=port, selections=[pick(input_port_index=0, input_offset=i) for i in elements]
        )
        for port, elements in wanted.items()
    ]
    selector = builder.AddNamedSystem(name, Selector(params))
    builder.Connect(source, selector.get_input_port(0))
    return {port: selector.GetOutputPort(port) for port in wanted}


def _first_imu(parts: Parts) -> OutputPort:
    """The raw reading of the robot's first IMU."""
    imu: Any = parts.sensors.imu
    others = len(parts.robot.imu) - 1
    port: OutputPort = imu.GetOutputPort("reading")
    if others and parts.builder.HasSubsystemNamed("first_imu"):
        port = parts.builder.GetSubsystemByName("first_imu").get_output_port(0)
    elif others:
        split = parts.builder.AddNamedSystem("first_imu", Demultiplexer([6, 6 * others]))
        parts.builder.Connect(port, split.get_input_port())
        port = split.get_output_port(0)
    return port


def _estimation(parts: Parts) -> tuple[JointTorqueEstimator, OutputPort]:
    """Filters, tare and torque estimator; also the port of the joints' filtered motion."""
    scenario, ports = parts.scenario, _filters(parts)
    model = TorqueModel(parts.robot, base=scenario.base_from, angular_acceleration=scenario.angular_acceleration)
    if scenario.tare and parts.robot.force_torque:
        filled = scenario.filters.window * scenario.dt
        tare = WrenchTare(model, filled, filled + scenario.tare)
        wires = {name: ports[name] for name in ("joint_estimate", "imu_estimate") if name in ports}
        parts.add("wrench_tare", tare, wrench=ports["wrench_estimate"], **wires)
        ports["wrench_estimate"] = tare.GetOutputPort("wrench")
    estimator = parts.add("torque_estimator", JointTorqueEstimator(model), **ports)
    return estimator, ports["joint_estimate"]


def _monitor(parts: Parts, estimator: JointTorqueEstimator, reference: OutputPort) -> FaultMonitor:
    """The fault monitor; where nothing is to be touched, a contact wrench is a fault."""
    robot, scenario, sensors = parts.robot, parts.scenario, parts.sensors
    touched = scenario.objects or scenario.pushes
    free = () if touched else tuple(mount.name for mount in robot.force_torque)
    n = len(robot.joints)
    rate = parts.builder.AddNamedSystem("reference_velocity", Demultiplexer([n, n, n]))
    parts.builder.Connect(reference, rate.get_input_port())
    wires = {"encoder": sensors.encoder.GetOutputPort("reading"), "reference_velocity": rate.get_output_port(1)}
    if sensors.imu is not None:
        wires["imu"] = _first_imu(parts)
    if sensors.force_torque is not None:
        wires["wrench"] = sensors.force_torque.GetOutputPort("reading")
        wires["contact_wrench"] = estimator.GetOutputPort("contact_wrench")
    spec = scenario.monitor.without_noise(sensor_suite(scenario))
    monitor = FaultMonitor(robot, spec, scenario.dt, free)
    parts.add("fault_monitor", monitor, **wires)
    parts.flag_names = tuple(monitor.flag_names)
    return monitor


def _guarded(parts: Parts, command: OutputPort, fault: OutputPort) -> OutputPort:
    """The command behind the guard."""
    encoder = parts.sensors.encoder.GetOutputPort("reading")
    guard = CommandGuard(len(parts.robot.joints), parts.scenario.dt, parts.scenario.guard)
    parts.add("guard", guard, command=command, position=encoder, fault=fault)
    parts.signals["mode"] = guard.GetOutputPort("mode")
    return guard.GetOutputPort("command")
