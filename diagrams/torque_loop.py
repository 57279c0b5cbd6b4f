"""The loop of paper A around any robot file: each stage a system, all wired to a MultibodyPlant.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

`controller: servo` leaves out all between the reference and the guard: the vendor's position servo alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from drake_tc.diagrams.references import References, posture, references, table_source
from drake_tc.diagrams.scenario import Scenario
from drake_tc.diagrams.surroundings import Pushes, add_objects
from pydrake.geometry import MeshcatVisualizer, StartMeshcat
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    ConstantVectorSource,
    Demultiplexer,
    LogVectorOutput,
    Multiplexer,
    Selector,
    SelectorParams,
    VectorLogSink,
)

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.errors import ParamsError
from drake_tc.estimation.fault_monitor import FaultMonitor
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.estimation.wrench_tare import WrenchTare
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.robot.plant import add_robot, joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.sensing.suite import SensorSuite, SensorSuiteSpec, add_sensors, load_suite


@dataclass(frozen=True, eq=False)
class Loop:
    """A built loop.

    Attributes:
        scenario, robot: What it was built from.
        models: Joint to the simulated actuator.
        diagram, plant: The systems.
        logs: Signal name to its log.
        flag_names: Of the fault monitor's flags, in order; empty without one.
    """

    scenario: Scenario
    robot: Robot
    models: Mapping[str, ActuatorModel]
    diagram: Diagram
    plant: MultibodyPlant
    logs: Mapping[str, VectorLogSink]
    flag_names: tuple[str, ...] = ()

    def start(self, context: Context) -> None:
        """Put the robot at rest in the scenario's posture, with the masses that the scenario gives its links."""
        own = self.plant.GetMyContextFromRoot(context)
        for joint, position in zip(self.robot.joints, posture(self.scenario.motion, self.robot), strict=True):
            self.plant.GetJointByName(joint).set_angle(own, position)
        for link, factor in self.scenario.masses.items():
            body = self.plant.GetBodyByName(link)
            inertia = body.CalcSpatialInertiaInBodyFrame(own)
            body.SetMass(own, factor * inertia.get_mass())


@dataclass
class _Parts:
    """What the stages need of each other while the loop is being wired."""

    builder: DiagramBuilder
    scenario: Scenario
    robot: Robot
    plant: MultibodyPlant
    sensors: SensorSuite
    signals: dict[str, OutputPort] = field(default_factory=dict)
    flag_names: tuple[str, ...] = ()

    def add(self, name: str, system: Any, **inputs: OutputPort) -> Any:
        """Add a system and connect its named inputs."""
        self.builder.AddNamedSystem(name, system)
        for port, source in inputs.items():
            self.builder.Connect(source, system.GetInputPort(port))
        return system


def build_loop(scenario: Scenario, *, meshcat: bool = False) -> Loop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a file that cannot be read, a robot without what the scenario needs, or names that do not fit.
    """
    robot = loop_robot(scenario)
    models = actuator_models(scenario, robot)
    wanted = references(scenario, robot)
    builder = DiagramBuilder()
    plant = _add_plant(builder, scenario, robot, meshcat=meshcat)
    sensors = _add_sensors(builder, scenario, robot, plant)
    parts = _Parts(builder, scenario, robot, plant, sensors)
    command = _torque_command(parts, wanted) if scenario.controller == "torque" else _servo_command(parts, wanted)
    _add_drives(parts, models, command)
    logs = {name: LogVectorOutput(port, builder, scenario.dt) for name, port in parts.signals.items()}
    for name, sink in logs.items():
        sink.set_name(f"log_{name}")
    diagram = builder.Build()
    diagram.set_name("torque_loop" if scenario.controller == "torque" else "servo_loop")
    return Loop(scenario, robot, models, diagram, plant, logs, parts.flag_names)


def loop_robot(scenario: Scenario) -> Robot:
    """The scenario's robot, without joint stops where it says so.

    Raises:
        ParamsError: a file that cannot be read, or a robot whose base floats.
    """
    robot = load_robot(scenario.path(scenario.robot))
    if not robot.fixed_base:
        raise ParamsError(f"{robot.source}: wanted a robot whose base is fixed, for this diagram; its base floats")
    if scenario.joint_stops == "none":
        endless = {"lower": -np.inf, "upper": np.inf}
        robot = replace(robot, limits={joint: {**robot.limits.get(joint, {}), **endless} for joint in robot.joints})
    return robot


def actuator_models(scenario: Scenario, robot: Robot, *, controller: bool = False) -> dict[str, ActuatorModel]:
    """The simulated actuators, or those that the controller compensates, joint by joint.

    Raises:
        ParamsError: no model file at all, or one that lacks a joint.
    """
    named = scenario.actuators if not (controller and scenario.model) else scenario.model
    path = robot.actuators if named is None else scenario.path(named)
    if path is None:
        raise ParamsError(f"{robot.source}: wanted `actuators`, here or in the scenario; got neither")
    models = load_models(path)
    missing = [joint for joint in robot.joints if joint not in models]
    if missing:
        raise ParamsError(f"{path}: no joint {missing[0]!r}; joints there: {', '.join(models)}")
    return {joint: models[joint] for joint in robot.joints}


def _add_plant(builder: DiagramBuilder, scenario: Scenario, robot: Robot, *, meshcat: bool) -> MultibodyPlant:
    """The robot in its surroundings; with geometry only where something is to be touched or seen."""
    plant: Any
    if scenario.objects or meshcat:
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, scenario.plant_step)
        add_robot(plant, robot, visuals=meshcat, collisions=bool(scenario.objects))
        add_objects(plant, scenario.objects)
        if meshcat:
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, StartMeshcat())
    else:
        plant = builder.AddNamedSystem("plant", MultibodyPlant(scenario.plant_step))
        add_robot(plant, robot)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    plant.set_name("plant")
    for link in scenario.masses:
        if not plant.HasBodyNamed(link):
            raise ParamsError(f"masses: no link {link!r} in {robot.name}")
    if scenario.pushes:
        pushes = builder.AddNamedSystem("pushes", Pushes(plant, scenario.pushes))
        builder.Connect(pushes.get_output_port(), plant.get_applied_spatial_force_input_port())
    built: MultibodyPlant = plant
    return built


def _add_sensors(builder: DiagramBuilder, scenario: Scenario, robot: Robot, plant: MultibodyPlant) -> SensorSuite:
    return add_sensors(builder, plant, robot, sensor_suite(scenario), scenario.dt, scenario.seed, scenario.faults)


def sensor_suite(scenario: Scenario) -> SensorSuiteSpec:
    """What the scenario's sensors do; joint torques that are fed back are at least one tick old.

    Raises:
        ParamsError: an unknown preset or field.
    """
    entry = {"preset": scenario.sensors} if isinstance(scenario.sensors, str) else scenario.sensors
    suite = load_suite("sensors", entry)
    if scenario.torque_from == "sensor" and suite.joint_torque.latency == 0.0:
        suite = replace(suite, joint_torque=replace(suite.joint_torque, latency=scenario.dt))
    return suite


def _servo_command(parts: _Parts, wanted: References) -> OutputPort:
    """The reference itself; the vendor's servo does the rest."""
    n = len(parts.robot.joints)
    source = parts.builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion))
    split = parts.builder.AddNamedSystem("reference_position", Demultiplexer([n, 2 * n]))
    parts.builder.Connect(source.get_output_port(), split.get_input_port())
    nothing: Any = np.zeros(1)
    sound = parts.builder.AddNamedSystem("no_fault", ConstantVectorSource(nothing))
    parts.signals["reference"] = source.get_output_port()
    return _guarded(parts, split.get_output_port(0), sound.get_output_port())


def _torque_command(parts: _Parts, wanted: References) -> OutputPort:
    """Reference to command through filters, estimator, inverse dynamics and torque control."""
    builder, scenario, robot = parts.builder, parts.scenario, parts.robot
    reference = builder.AddNamedSystem("reference", table_source(wanted.time, wanted.motion)).get_output_port()
    estimator, joint_estimate = _estimation(parts)
    gains = torque_gains(scenario, robot)
    encoder = parts.sensors.encoder.GetOutputPort("reading")
    inputs = {"joint_estimate": joint_estimate, "reference": reference, "position": encoder}
    if robot.force_torque:
        force = builder.AddNamedSystem("force_reference", table_source(wanted.time, wanted.force)).get_output_port()
        inputs |= {"force_reference": force, "contact_wrench": estimator.GetOutputPort("contact_wrench")}
        parts.signals |= {"force_reference": force, "contact_wrench": estimator.GetOutputPort("contact_wrench")}
    dynamics = parts.add(
        "inverse_dynamics",
        InverseDynamics(robot, gains, configuration=scenario.configuration, position_error="encoder"),
        **inputs,
    )
    models = actuator_models(scenario, robot, controller=True)
    limits = joint_limits(robot)
    control = TorqueControl(list(models.values()), gains, limits.effort, scenario.dt, scenario.compensation)
    sensed = scenario.torque_from == "sensor"
    estimated = estimator.GetOutputPort("estimated_torque")
    torque = parts.sensors.joint_torque.GetOutputPort("reading") if sensed else estimated
    wires = {
        "desired_torque": dynamics.GetOutputPort("desired_torque"),
        "torque_terms": dynamics.GetOutputPort("torque_terms"),
        "estimated_torque": torque,
        "joint_estimate": joint_estimate,
        "position": encoder,
    }
    if scenario.compensation.wants_reference:
        wires["reference"] = reference
    parts.add("torque_control", control, **wires)
    monitor = _monitor(parts, estimator, reference)
    parts.signals |= {
        "reference": reference,
        "desired_torque": dynamics.GetOutputPort("desired_torque"),
        "estimated_torque": estimated,
        "flags": monitor.GetOutputPort("flags"),
    }
    if scenario.log_components:
        parts.signals["components"] = control.GetOutputPort("components")
    return _guarded(parts, control.GetOutputPort("command"), monitor.GetOutputPort("any_fault"))


def torque_gains(scenario: Scenario, robot: Robot) -> TorqueGains:
    """The scenario's gains in the parametrisation of the torque loop: Ks = K6/(K (1 + Kp)), Kd = K7/(K (1 + Kp)).

    Raises:
        ParamsError: a gain that is not possible, or a joint that the robot does not have.
    """
    models = actuator_models(scenario, robot, controller=True)
    spec = scenario.gains
    of = {name: np.array(spec.of(name, robot.joints)) for name in ("k6", "k7", "kp", "ki")}
    loop = np.array([model.drive.gain for model in models.values()]) * (1.0 + of["kp"])
    kf = np.tile(np.broadcast_to(np.asarray(spec.kf, dtype=np.float64), 6), len(robot.force_torque))
    return TorqueGains(of["kp"], of["ki"], of["k6"] / loop, of["k7"] / loop, kf)


def _filters(parts: _Parts) -> dict[str, OutputPort]:
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


def _first_imu(parts: _Parts) -> OutputPort:
    """The raw reading of the robot's first IMU."""
    reading: OutputPort = parts.sensors.imu.GetOutputPort("reading")  # type: ignore[union-attr]
    others = len(parts.robot.imu) - 1
    if not others:
        return reading
    if parts.builder.HasSubsystemNamed("first_imu"):
        return parts.builder.GetSubsystemByName("first_imu").get_output_port(0)
    split = parts.builder.AddNamedSystem("first_imu", Demultiplexer([6, 6 * others]))
    parts.builder.Connect(reading, split.get_input_port())
    return split.get_output_port(0)


def _estimation(parts: _Parts) -> tuple[JointTorqueEstimator, OutputPort]:
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


def _monitor(parts: _Parts, estimator: JointTorqueEstimator, reference: OutputPort) -> FaultMonitor:
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


def _guarded(parts: _Parts, command: OutputPort, fault: OutputPort) -> OutputPort:
    """The command behind the guard."""
    encoder = parts.sensors.encoder.GetOutputPort("reading")
    guard = CommandGuard(len(parts.robot.joints), parts.scenario.dt, parts.scenario.guard)
    parts.add("guard", guard, command=command, position=encoder, fault=fault)
    parts.signals["mode"] = guard.GetOutputPort("mode")
    return guard.GetOutputPort("command")


def _add_drives(parts: _Parts, models: Mapping[str, ActuatorModel], command: OutputPort) -> None:
    """The actuators between command and plant, and the signals that every run records."""
    plant, sensors = parts.plant, parts.sensors
    actuators = add_actuators(parts.builder, plant, models, parts.scenario.plant_step)
    parts.builder.Connect(command, actuators.GetInputPort("command"))
    parts.signals |= {
        "joint_state": plant.get_state_output_port(),
        "acceleration": plant.get_generalized_acceleration_output_port(),
        "actuation": actuators.GetOutputPort("actuation"),
        "command": command,
        "encoder": sensors.encoder.GetOutputPort("reading"),
    }
    if sensors.imu is not None:
        parts.signals["imu"] = sensors.imu.GetOutputPort("reading")
    if sensors.force_torque is not None:
        parts.signals["force_torque"] = sensors.force_torque.GetOutputPort("reading")
    if parts.scenario.log_truth:
        parts.signals["joint_torque"] = sensors.joint_torque.GetOutputPort("reading")
