"""A legged robot on a floor under robust TSID (Del Prete and Mansard, 2015), from a controller file alone.

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

`state: plant` hands the plant's own state to the controller, `torque: direct` its torques to the joints. The loop of
Faraji et al. (2015) is `state: base_estimator` with `torque: series_elastic`.
"""

from dataclasses import dataclass
from typing import Any

from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from drake_tc.control.stopping_reference import StoppingReference
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.surroundings import add_pushes, check_masses, set_masses
from drake_tc.loops.whole_body.base_estimation import base_state
from drake_tc.loops.whole_body.drives import add_drives
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.references import contact_source, task_source
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.loops.whole_body.sensor_validation import ValidatedSensors, add_flags, add_sensor_validation, stopped
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, add_whole_body_sensors, estimated_state
from drake_tc.loops.whole_body.series_elastic_drives import (
    SpringDrives,
    Start,
    add_spring_drives,
    control_springs,
    link_position,
)
from drake_tc.loops.whole_body.torque_noise import TorqueNoise
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuite
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid, reference_port
from drake_tc.tsid.law import Law


@dataclass(frozen=True, eq=False, kw_only=True)
class TsidLoop(BuiltLoop[TsidScenario]):
    """A built whole-body loop.

    Attributes:
        law, controller: What it was built around.
        starts: Put parts of a context where the robot starts, in this order.
    """

    law: Law
    controller: RobustTsid
    starts: tuple[Start, ...] = ()

    @property
    def period(self) -> float:
        """Period of the controller [s]."""
        return self.law.period

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.law.model.robot

    def start(self, context: Context) -> None:
        """Give the links the scenario's masses; the robot starts at rest in its posture."""
        set_masses(self.plant, self.plant.GetMyContextFromRoot(context), self.scenario.masses)
        for start in self.starts:
            start(context)


def build_tsid(scenario: TsidScenario, *, meshcat: bool = False) -> TsidLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a file that cannot be read, or names or times that do not fit.
    """
    law = _law(scenario)
    builder = DiagramBuilder()
    plant = _add_plant(builder, scenario, law, meshcat=meshcat)
    controller = RobustTsid(law)
    touched = plant.get_generalized_contact_forces_output_port(plant.GetModelInstanceByName(law.model.robot.name))
    signals = {"state": plant.get_state_output_port(), "contact": touched}
    wiring = WholeBodyBuilder(builder, scenario, plant, law.period, signals, law=law)
    sensed = scenario.state != "plant" or scenario.torque == "drives"
    sensors = add_whole_body_sensors(wiring) if sensed else None
    springs = add_spring_drives(wiring) if scenario.torque == "series_elastic" else None
    builder.AddNamedSystem("tsid", controller)
    contacts = _connect_references(builder, scenario, controller)
    validated = _validated(wiring, sensors, springs, contacts)
    position = None
    if validated is not None:
        sensors, springs, contacts = validated.sensors, validated.springs, validated.contacts
        position = validated.position
    elif springs is not None and sensors is not None:
        position = link_position(wiring, springs, sensors.encoder.GetOutputPort("reading"))
    state, starts = _known_state(wiring, sensors, position, contacts)
    if validated is not None:
        state, springs = stopped(wiring, validated, state)
    builder.Connect(state, controller.GetInputPort("estimated_state"))
    torque = _with_error(builder, scenario, law, controller.GetOutputPort("torque"))
    starts += _apply_torque(wiring, sensors, springs, torque, state)
    outputs = ("torque", "acceleration", "contact_force", "status")
    wiring.signals |= {name: controller.GetOutputPort(name) for name in outputs}
    if validated is not None:
        wiring.flag_names = add_flags(wiring, validated)
    diagram, log = wiring.build(f"{law.model.robot.name}_tsid")
    return TsidLoop(
        scenario=scenario,
        law=law,
        controller=controller,
        diagram=diagram,
        plant=plant,
        log=log,
        starts=tuple(starts),
        flag_names=wiring.flag_names,
    )


def _law(scenario: TsidScenario) -> Law:
    """The controller's law.

    Raises:
        ParamsError: a file that cannot be read, a step that does not divide the period, or no contacts.
    """
    law = load_law(scenario.path(scenario.controller), scenario.changes)
    steps = law.period / scenario.plant_step
    if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
        raise ParamsError(
            f"plant_step: wanted the controller's period, {law.period:g} s, or a whole part of it;"
            f" got {scenario.plant_step:g}"
        )
    if not law.model.contacts:
        raise ParamsError(f"{scenario.path(scenario.controller)}: contacts: wanted at least one to stand on; got none")
    return law


def _apply_torque(
    wiring: WholeBodyBuilder,
    sensors: SensorSuite | None,
    springs: SpringDrives | None,
    torque: OutputPort,
    state: OutputPort,
) -> list[Start]:
    """The torques on their way to the joints: directly, or through drives; what has to be started for it."""
    if springs is not None:
        return [control_springs(wiring, springs, torque)]
    if sensors is not None and wiring.scenario.torque == "drives":
        add_drives(wiring, sensors, torque, state)
    else:
        wiring.signals["applied_torque"] = torque
        wiring.builder.Connect(torque, wiring.plant.get_actuation_input_port())
    return []


def _checked(scenario: TsidScenario) -> bool:
    """Whether sensors are checked, and motions stop where they are lost: with base estimator and series springs."""
    return bool(scenario.state == "base_estimator" and scenario.torque == "series_elastic")


def _validated(
    wiring: WholeBodyBuilder, sensors: SensorSuite | None, springs: SpringDrives | None, contacts: OutputPort | None
) -> ValidatedSensors | None:
    """The checks of the sensors, where the scenario has them."""
    if sensors is None or springs is None or not _checked(wiring.scenario):
        return None
    return add_sensor_validation(wiring, sensors, springs, contacts)


def _known_state(
    wiring: WholeBodyBuilder, sensors: SensorSuite | None, position: OutputPort | None, contacts: OutputPort | None
) -> tuple[OutputPort, list[Start]]:
    """[q; v] as the controller gets it, and what has to be started for it; joints' encoders where no `position` is."""
    if sensors is None or wiring.scenario.state == "plant":
        return wiring.plant.get_state_output_port(), []
    position = sensors.encoder.GetOutputPort("reading") if position is None else position
    starts: list[Start] = []
    if wiring.scenario.state == "base_estimator":
        state, start = base_state(wiring, sensors, position, contacts)
        starts.append(start)
    else:
        state = estimated_state(wiring, sensors, contacts)
    wiring.signals["estimated_state"] = state
    return state, starts


def _add_plant(builder: DiagramBuilder, scenario: TsidScenario, law: Law, *, meshcat: bool) -> MultibodyPlant:
    robot = law.model.robot
    plant: Any
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, scenario.plant_step)
    add_robot(plant, robot, visuals=meshcat)
    add_ground(plant, law.model.contacts, scenario.ground)
    if meshcat:
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, Meshcat())
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    plant.set_name("plant")
    check_masses(plant, robot, scenario.masses)
    add_pushes(builder, plant, scenario.pushes)
    built: MultibodyPlant = plant
    return built


def _connect_references(builder: DiagramBuilder, scenario: TsidScenario, controller: RobustTsid) -> OutputPort | None:
    """Sources of what moves; what does not stays as the controller has it. The contacts that carry, if they change."""
    law = controller.law
    stops = _checked(scenario)
    for name, spec in scenario.motion.items():
        port, source = reference_port(name), task_source(law, name, spec)
        added = builder.AddNamedSystem(port, StoppingReference(source, law.period) if stops else source)
        builder.Connect(added.get_output_port(), controller.GetInputPort(port))
    if not scenario.lifted:
        return None
    switch = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    contacts: OutputPort = builder.AddNamedSystem("contacts", switch).get_output_port()
    builder.Connect(contacts, controller.GetInputPort("active_contacts"))
    return contacts


def _with_error(builder: DiagramBuilder, scenario: TsidScenario, law: Law, torque: OutputPort) -> OutputPort:
    """The torques with the scenario's errors on them."""
    spec = scenario.torque_error
    if spec is None:
        return torque
    noise = builder.AddNamedSystem("torque_noise", TorqueNoise(law.error, spec.hold, scenario.seed, spec.scale))
    total = builder.AddNamedSystem("erring_torque", Adder(2, law.model.n))
    for number, port in enumerate((torque, noise.get_output_port())):
        builder.Connect(port, total.get_input_port(number))
    return total.get_output_port()
