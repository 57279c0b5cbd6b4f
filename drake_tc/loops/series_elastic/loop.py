"""One voltage-driven series-elastic joint under torque control (paper C): held, moved by a hand, or with a free link.

    wanted torque --> torque_control --> loop_delay --> actuators (motor, gear, spring) --> plant (link) <-- hand
                           ^                                |
                           |---- motor_encoder, torque -----|

`wanted: {of: position}` puts a soft position loop around it, whose link speed comes from the motor's encoder less the
spring's deflection.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import (
    Demultiplexer,
    DiscreteTimeDelay,
    MatrixGain,
    Multiplexer,
    TrajectorySource,
)

from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.series_elastic.control import SeriesElasticControl
from drake_tc.loops.joint_bench.diagram import JOINT, make_plant
from drake_tc.loops.series_elastic.scenario import HandSpec, SeaScenario, spring_compliance
from drake_tc.loops.series_elastic.surroundings import Hand, LinkState, PositionLoop, hand_path, wanted_path
from drake_tc.loops.signal_log import SignalLog, add_log
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.suite import sensor_seed


@dataclass(frozen=True, eq=False)
class SeaLoop:
    """A built diagram.

    Attributes:
        scenario: What it was built from.
        diagram, plant, control: The systems.
        log: Of all recorded signals.
    """

    scenario: SeaScenario
    diagram: Diagram
    plant: MultibodyPlant
    control: SeriesElasticControl
    log: SignalLog

    def start(self, context: Context) -> None:
        """The joint starts at rest, its link hanging, where the hand is."""


def build_sea(scenario: SeaScenario, *, meshcat: bool = False) -> SeaLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Not of use here: the joint has no shape.

    Raises:
        ParamsError: values that do not fit.
    """
    builder = DiagramBuilder()
    plant = make_plant(scenario.link, scenario.dt)
    builder.AddNamedSystem("plant", plant)
    believed = scenario.believed_actuator()
    models = {JOINT: replace(scenario.actuator(), joint=JOINT)}
    actuators = add_actuators(builder, plant, models, scenario.dt)
    control = SeriesElasticControl(scenario.control, [believed], scenario.dt)
    builder.AddNamedSystem("torque_control", control)
    signals = {
        "link_state": plant.get_state_output_port(),
        "motor_state": actuators.GetOutputPort("motor_state"),
        "spring_torque": actuators.GetOutputPort("transmitted_torque"),
    }
    angle, torque = _add_sensors(builder, scenario, signals)
    builder.Connect(angle, control.GetInputPort("motor_angle"))
    builder.Connect(torque, control.GetInputPort("torque"))
    _connect_delayed(builder, scenario, control.GetOutputPort("voltage"), actuators.GetInputPort("command"))
    signals["reference_torque"] = _add_wanted(builder, scenario, control, signals)
    if scenario.hand is not None:
        signals["hand_torque"] = _add_hand(builder, scenario, scenario.hand, plant)
    signals |= {name: control.GetOutputPort(name) for name in ("voltage", "friction", "shaped_reference", "fault")}
    signals["measured_torque"] = torque
    signals["friction_torque"] = actuators.GetOutputPort("friction_torque")
    log = add_log(builder, signals, scenario.dt)
    diagram = builder.Build()
    diagram.set_name("sea_joint")
    return SeaLoop(scenario, diagram, plant, control, log)


def _add_sensors(
    builder: DiagramBuilder, scenario: SeaScenario, signals: dict[str, OutputPort]
) -> tuple[OutputPort, OutputPort]:
    """Encoders before and after the spring and the gauge; what is read as motor angle and torque."""
    first: Any = np.array([[1.0, 0.0]])
    found = {}
    for name, source, spec in (
        ("motor_encoder", "motor_state", scenario.sensors.motor_encoder),
        ("link_encoder", "link_state", scenario.sensors.link_encoder),
        ("torque_sensor", "spring_torque", scenario.sensors.torque),
    ):
        sensor = Sensor(1, spec, scenario.dt, (), sensor_seed(scenario.seed, name))
        builder.AddNamedSystem(name, sensor)
        port = signals[source]
        if port.size() == 2:
            pick = builder.AddNamedSystem(f"{name}_angle", MatrixGain(first))
            builder.Connect(port, pick.get_input_port())
            port = pick.get_output_port()
        builder.Connect(port, sensor.GetInputPort("truth"))
        found[name] = signals[name] = sensor.GetOutputPort("reading")
    if scenario.torque_from == "gauge":
        return found["motor_encoder"], found["torque_sensor"]
    both = builder.AddNamedSystem("encoders", Multiplexer(2))
    stiffness = 1.0 / spring_compliance(scenario.believed_actuator())
    spring: Any = np.array([[stiffness, -stiffness]])
    deflection = builder.AddNamedSystem("deflection_torque", MatrixGain(spring))
    builder.Connect(found["motor_encoder"], both.get_input_port(0))
    builder.Connect(found["link_encoder"], both.get_input_port(1))
    builder.Connect(both.get_output_port(), deflection.get_input_port())
    return found["motor_encoder"], deflection.get_output_port()


def _connect_delayed(builder: DiagramBuilder, scenario: SeaScenario, voltage: OutputPort, command: Any) -> None:
    """The voltage of tick k acts from tick k + delay/dt on."""
    ticks = round(scenario.delay / scenario.dt)
    if ticks:
        late = builder.AddNamedSystem("loop_delay", DiscreteTimeDelay(scenario.dt, ticks - 1, 1))
        builder.Connect(voltage, late.get_input_port())
        voltage = late.get_output_port()
    builder.Connect(voltage, command)


def _add_wanted(
    builder: DiagramBuilder, scenario: SeaScenario, control: SeriesElasticControl, signals: dict[str, OutputPort]
) -> OutputPort:
    """The wanted torque, and with a position loop the wanted acceleration of the link."""
    spec = scenario.wanted
    path = wanted_path(spec, scenario.duration, scenario.dt)
    if spec.of == "torque":
        torque = builder.AddNamedSystem("reference", TrajectorySource(path)).get_output_port()
        builder.Connect(torque, control.GetInputPort("reference_torque"))
        return torque
    source = builder.AddNamedSystem("reference", TrajectorySource(path, 2))
    loop = builder.AddNamedSystem("position_loop", PositionLoop(scenario.link, spec.stiffness, spec.damping))
    builder.Connect(source.get_output_port(), loop.GetInputPort("motion"))
    known = builder.AddNamedSystem(
        "link_state", LinkState(spring_compliance(scenario.believed_actuator()), scenario.dt)
    )
    builder.Connect(signals["motor_encoder"], known.GetInputPort("motor_angle"))
    builder.Connect(signals["torque_sensor"], known.GetInputPort("torque"))
    builder.Connect(known.get_output_port(), loop.GetInputPort("state"))
    parts = builder.AddNamedSystem("reference_parts", Demultiplexer([2, 1]))
    builder.Connect(source.get_output_port(), parts.get_input_port())
    builder.Connect(parts.get_output_port(1), control.GetInputPort("reference_acceleration"))
    builder.Connect(loop.get_output_port(), control.GetInputPort("reference_torque"))
    signals["reference_motion"] = source.get_output_port()
    return loop.get_output_port()


def _add_hand(builder: DiagramBuilder, scenario: SeaScenario, spec: HandSpec, plant: MultibodyPlant) -> OutputPort:
    """The hand on the link; its torque is a force from outside."""
    path = hand_path(spec, scenario.duration, scenario.dt)
    motion = builder.AddNamedSystem("hand_motion", TrajectorySource(path))
    hand = builder.AddNamedSystem("hand", Hand(spec.stiffness, spec.damping))
    builder.Connect(motion.get_output_port(), hand.GetInputPort("motion"))
    builder.Connect(plant.get_state_output_port(), hand.GetInputPort("state"))
    builder.Connect(hand.get_output_port(), plant.get_applied_generalized_force_input_port())
    port: OutputPort = hand.get_output_port()
    return port
