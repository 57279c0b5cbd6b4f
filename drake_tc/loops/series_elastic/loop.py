"""One voltage-driven series-elastic joint under torque control (Faraji et al., 2015): held, moved by a hand, or with a
free link.

    wanted torque --> torque_control --> loop_delay --> actuators (motor, gear, spring) --> plant (link) <-- hand
                           ^                                |
                           |---- motor_encoder, torque -----|

`wanted: {of: position}` puts a soft position loop around it, whose link speed comes from the motor's encoder less the
spring's deflection.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Demultiplexer, DiscreteTimeDelay, MatrixGain, TrajectorySource

from drake_tc.actuation.wiring import add_actuators
from drake_tc.control.series_elastic.control import SeriesElasticControl
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.joint_bench.diagram import JOINT, make_plant
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.series_elastic.scenario import HandSpec, SeaScenario, spring_compliance
from drake_tc.loops.series_elastic.surroundings import Hand, LinkState, PositionLoop, hand_path, wanted_path
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.suite import sensor_seed


@dataclass(frozen=True, eq=False, kw_only=True)
class SeaLoop(BuiltLoop[SeaScenario]):
    """A built loop of one joint, which starts at rest, its link hanging, where the hand is.

    Attributes:
        control: The torque control.
    """

    control: SeriesElasticControl

    @property
    def period(self) -> float:
        """Period of the control [s]."""
        return self.scenario.dt


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
    loop = LoopBuilder(builder, scenario, plant, scenario.dt)
    models = {JOINT: replace(scenario.actuator(), joint=JOINT)}
    actuators = add_actuators(builder, plant, models, scenario.dt)
    loop.signals |= {
        "link_state": plant.get_state_output_port(),
        "motor_state": actuators.GetOutputPort("motor_state"),
        "spring_torque": actuators.GetOutputPort("transmitted_torque"),
    }
    angle, torque = _add_sensors(loop)
    control = SeriesElasticControl(scenario.control, [scenario.believed_actuator()], scenario.dt)
    loop.add("torque_control", control, motor_angle=angle, torque=torque)
    builder.Connect(_delayed(loop, control.GetOutputPort("voltage")), actuators.GetInputPort("command"))
    loop.signals["reference_torque"] = _add_wanted(loop, control)
    if scenario.hand is not None:
        loop.signals["hand_torque"] = _add_hand(loop, scenario.hand)
    loop.signals |= {name: control.GetOutputPort(name) for name in ("voltage", "friction", "shaped_reference", "fault")}
    loop.signals |= {"measured_torque": torque, "friction_torque": actuators.GetOutputPort("friction_torque")}
    diagram, log = loop.build("sea_joint")
    return SeaLoop(scenario=scenario, diagram=diagram, plant=plant, control=control, log=log)


def _add_sensors(loop: LoopBuilder[SeaScenario]) -> tuple[OutputPort, OutputPort]:
    """Encoders before and after the spring and the gauge; what is read as motor angle and torque."""
    scenario, builder = loop.scenario, loop.builder
    first: Any = np.array([[1.0, 0.0]])
    found = {}
    for name, source, spec in (
        ("motor_encoder", "motor_state", scenario.sensors.motor_encoder),
        ("link_encoder", "link_state", scenario.sensors.link_encoder),
        ("torque_sensor", "spring_torque", scenario.sensors.torque),
    ):
        port = loop.signals[source]
        if port.size() == 2:
            pick = builder.AddNamedSystem(f"{name}_angle", MatrixGain(first))
            builder.Connect(port, pick.get_input_port())
            port = pick.get_output_port()
        sensor = loop.add(name, Sensor(1, spec, scenario.dt, (), sensor_seed(scenario.seed, name)), truth=port)
        found[name] = loop.signals[name] = sensor.GetOutputPort("reading")
    if scenario.torque_from == "gauge":
        return found["motor_encoder"], found["torque_sensor"]
    stiffness = 1.0 / spring_compliance(scenario.believed_actuator())
    spring: Any = np.array([[stiffness, -stiffness]])
    deflection = builder.AddNamedSystem("deflection_torque", MatrixGain(spring))
    builder.Connect(loop.join("encoders", [found["motor_encoder"], found["link_encoder"]]), deflection.get_input_port())
    return found["motor_encoder"], deflection.get_output_port()


def _delayed(loop: LoopBuilder[SeaScenario], voltage: OutputPort) -> OutputPort:
    """The voltage of tick k, which acts from tick k + delay/dt on."""
    ticks = round(loop.scenario.delay / loop.scenario.dt)
    if not ticks:
        return voltage
    late = loop.builder.AddNamedSystem("loop_delay", DiscreteTimeDelay(loop.scenario.dt, ticks - 1, 1))
    loop.builder.Connect(voltage, late.get_input_port())
    port: OutputPort = late.get_output_port()
    return port


def _add_wanted(loop: LoopBuilder[SeaScenario], control: SeriesElasticControl) -> OutputPort:
    """The wanted torque, and with a position loop the wanted acceleration of the link."""
    scenario, builder = loop.scenario, loop.builder
    spec = scenario.wanted
    path = wanted_path(spec, scenario.duration, scenario.dt)
    if spec.of == "torque":
        torque: OutputPort = builder.AddNamedSystem("reference", TrajectorySource(path)).get_output_port()
        builder.Connect(torque, control.GetInputPort("reference_torque"))
        return torque
    source = builder.AddNamedSystem("reference", TrajectorySource(path, 2))
    readings = {"motor_angle": loop.signals["motor_encoder"], "torque": loop.signals["torque_sensor"]}
    known = LinkState(spring_compliance(scenario.believed_actuator()), scenario.dt)
    loop.add("link_state", known, **readings)
    position_loop = loop.add(
        "position_loop",
        PositionLoop(scenario.link, spec.stiffness, spec.damping),
        motion=source.get_output_port(),
        state=known.get_output_port(),
    )
    parts = builder.AddNamedSystem("reference_parts", Demultiplexer([2, 1]))
    builder.Connect(source.get_output_port(), parts.get_input_port())
    builder.Connect(parts.get_output_port(1), control.GetInputPort("reference_acceleration"))
    builder.Connect(position_loop.get_output_port(), control.GetInputPort("reference_torque"))
    loop.signals["reference_motion"] = source.get_output_port()
    port: OutputPort = position_loop.get_output_port()
    return port


def _add_hand(loop: LoopBuilder[SeaScenario], spec: HandSpec) -> OutputPort:
    """The hand on the link; its torque is a force from outside."""
    motion = loop.builder.AddNamedSystem(
        "hand_motion", TrajectorySource(hand_path(spec, loop.scenario.duration, loop.scenario.dt))
    )
    hand = loop.add(
        "hand",
        Hand(spec.stiffness, spec.damping),
        motion=motion.get_output_port(),
        state=loop.plant.get_state_output_port(),
    )
    loop.builder.Connect(hand.get_output_port(), loop.plant.get_applied_generalized_force_input_port())
    port: OutputPort = hand.get_output_port()
    return port
