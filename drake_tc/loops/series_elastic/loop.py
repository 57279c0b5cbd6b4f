"""One voltage-driven series-elastic joint under torque control (Faraji et al., 2015): held, moved by a hand, or free.

The wiring is that of `add_series_elastic_loop` (`drake_tc.loops.series_elastic.wiring`); this file adds the link, the
hand and the reference. `reference: {of: position}` puts a soft position loop around it, whose link speed comes from
the motor's encoder minus the spring's deflection.
"""

from dataclasses import dataclass, replace

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Demultiplexer, TrajectorySource

from drake_tc.control.series_elastic.control import SeriesElasticControl
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.joint_bench.diagram import JOINT, make_plant
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.series_elastic.scenario import HandSpec, SeaScenario, spring_compliance
from drake_tc.loops.series_elastic.surroundings import Hand, LinkState, PositionLoop, hand_path, reference_path
from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop


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
    models, assumed = ([replace(m, joint=JOINT)] for m in (scenario.actuator(), scenario.controller_actuator()))
    loop = add_series_elastic_loop(builder, plant, models, spec=scenario, controller_models=assumed)
    parts = LoopBuilder(builder, scenario, plant, scenario.dt, loop.signals)
    control = loop.systems["torque_control"]
    loop.signals["reference_torque"] = _add_reference(parts, control)
    if scenario.hand is not None:
        loop.signals["hand_torque"] = _add_hand(parts, scenario.hand)
    diagram, log = loop.build(builder, "sea_joint")
    return SeaLoop(
        scenario=scenario, diagram=diagram, plant=plant, control=control, log=log, flag_names=loop.flag_names
    )


def _add_reference(loop: LoopBuilder[SeaScenario], control: SeriesElasticControl) -> OutputPort:
    """The reference torque, and with a position loop the reference acceleration of the link."""
    scenario, builder = loop.scenario, loop.builder
    spec = scenario.reference
    path = reference_path(spec, scenario.duration, scenario.dt)
    if spec.of == "torque":
        torque: OutputPort = builder.AddNamedSystem("reference", TrajectorySource(path)).get_output_port()
        builder.Connect(torque, control.GetInputPort("reference_torque"))
        return torque
    source = builder.AddNamedSystem("reference", TrajectorySource(path, 2))
    readings = {"motor_angle": loop.signals["motor_encoder"], "torque": loop.signals["torque_sensor"]}
    known = LinkState(spring_compliance(scenario.controller_actuator()), scenario.dt)
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
