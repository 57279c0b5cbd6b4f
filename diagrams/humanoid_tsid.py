"""A legged robot on a floor under robust TSID (paper B), from a controller file alone.

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

`state: plant` hands the plant's own state to the controller, `torque: direct` its torques to the joints. Paper C's loop
is `state: base_estimator` with `torque: series_elastic`.
"""

from dataclasses import dataclass
from typing import Any

from drake_tc.diagrams.loop.signal_log import SignalLog, add_log
from drake_tc.diagrams.loop.surroundings import add_pushes, check_masses, set_masses
from drake_tc.diagrams.tsid.base_estimation import base_state
from drake_tc.diagrams.tsid.drives import add_drives
from drake_tc.diagrams.tsid.ground import add_ground
from drake_tc.diagrams.tsid.references import contact_source, task_source
from drake_tc.diagrams.tsid.scenario import TsidScenario
from drake_tc.diagrams.tsid.senses import Wiring, add_senses, estimated_state
from drake_tc.diagrams.tsid.series_elastic_drives import (
    SpringDrives,
    Start,
    add_spring_drives,
    control_springs,
    link_position,
)
from drake_tc.diagrams.tsid.torque_noise import TorqueNoise
from drake_tc.diagrams.tsid.trust.faults import Trusted, add_flags, add_trust, stopped
from drake_tc.diagrams.tsid.trust.stopping_reference import StoppingReference
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuite
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid, reference_port
from drake_tc.tsid.law import Law


@dataclass(frozen=True, eq=False)
class TsidLoop:
    """A built diagram.

    Attributes:
        scenario, law: What it was built from.
        diagram, plant, controller: The systems.
        log: Of all recorded signals.
        starts: Put parts of a context where the robot starts, in this order.
        flag_names: Of the recorded signal "flags"; empty without one.
    """

    scenario: TsidScenario
    law: Law
    diagram: Diagram
    plant: MultibodyPlant
    controller: RobustTsid
    log: SignalLog
    starts: tuple[Start, ...] = ()
    flag_names: tuple[str, ...] = ()

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
    law = load_law(scenario.path(scenario.controller), scenario.changes)
    steps = law.period / scenario.plant_step
    if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
        raise ParamsError(
            f"plant_step: wanted the controller's period, {law.period:g} s, or a whole part of it;"
            f" got {scenario.plant_step:g}"
        )
    if not law.model.contacts:
        raise ParamsError(f"{scenario.path(scenario.controller)}: contacts: wanted at least one to stand on; got none")
    builder = DiagramBuilder()
    plant = _add_plant(builder, scenario, law, meshcat=meshcat)
    controller = RobustTsid(law)
    touched = plant.get_generalized_contact_forces_output_port(plant.GetModelInstanceByName(law.model.robot.name))
    wiring = Wiring(builder, scenario, law, plant, {"state": plant.get_state_output_port(), "contact": touched})
    senses = scenario.state != "plant" or scenario.torque == "drives"
    sensors = add_senses(wiring) if senses else None
    springs = add_spring_drives(wiring) if scenario.torque == "series_elastic" else None
    builder.AddNamedSystem("tsid", controller)
    contacts = _connect_references(builder, scenario, controller)
    trusted = _trusted(wiring, sensors, springs, contacts)
    position = None
    if trusted is not None:
        sensors, springs, contacts = trusted.sensors, trusted.springs, trusted.contacts
        position = trusted.position
    elif springs is not None and sensors is not None:
        position = link_position(wiring, springs, sensors.encoder.GetOutputPort("reading"))
    state, starts = _known_state(wiring, sensors, position, contacts)
    if trusted is not None:
        state, springs = stopped(wiring, trusted, state)
    builder.Connect(state, controller.GetInputPort("estimated_state"))
    torque = _with_error(builder, scenario, law, controller.GetOutputPort("torque"))
    if springs is not None:
        starts.append(control_springs(wiring, springs, torque))
    elif sensors is not None and scenario.torque == "drives":
        add_drives(wiring, sensors, torque, state)
    else:
        wiring.signals["applied_torque"] = torque
        builder.Connect(torque, plant.get_actuation_input_port())
    outputs = ("torque", "acceleration", "contact_force", "status")
    wiring.signals |= {name: controller.GetOutputPort(name) for name in outputs}
    flag_names = () if trusted is None else add_flags(wiring, trusted)
    log = add_log(builder, wiring.signals, law.period)
    diagram = builder.Build()
    diagram.set_name(f"{law.model.robot.name}_tsid")
    return TsidLoop(scenario, law, diagram, plant, controller, log, tuple(starts), flag_names)


def _checked(scenario: TsidScenario) -> bool:
    """Whether senses are checked, and motions stop where they are lost: in paper C's loop."""
    return bool(scenario.state == "base_estimator" and scenario.torque == "series_elastic")


def _trusted(
    wiring: Wiring, sensors: SensorSuite | None, springs: SpringDrives | None, contacts: OutputPort | None
) -> Trusted | None:
    """What checks the senses, in paper C's loop."""
    if sensors is None or springs is None or not _checked(wiring.scenario):
        return None
    return add_trust(wiring, sensors, springs, contacts)


def _known_state(
    wiring: Wiring, sensors: SensorSuite | None, position: OutputPort | None, contacts: OutputPort | None
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
