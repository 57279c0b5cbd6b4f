"""A legged robot on a floor under robust TSID (Del Prete and Mansard, 2015), as a scenario describes it.

The wiring is that of `add_whole_body_loop` (`drake_tc.loops.whole_body.wiring`); here stand the floor, what pushes, and
what the tasks follow.
"""

from dataclasses import dataclass, replace

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from drake_tc.actuation.joint_effects import Models
from drake_tc.errors import ParamsError
from drake_tc.loops.boundary import Start
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.fused import StageValues, fused_stages
from drake_tc.loops.plant import add_pushes, add_robot_plant, check_masses, set_masses
from drake_tc.loops.whole_body.drives import drive_models, known_drives
from drake_tc.loops.whole_body.ground import add_ground
from drake_tc.loops.whole_body.references import contact_source, task_source
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.loops.whole_body.series_elastic_drives import spring_models
from drake_tc.loops.whole_body.wiring import add_whole_body_loop
from drake_tc.robot.link_changes import link_changes
from drake_tc.robot.robot import Robot
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
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
        values = StageValues(context, fused_stages(self.diagram))
        for start in self.starts:
            start(values)


def build_tsid(scenario: TsidScenario, *, meshcat: bool = False, fused: bool = False) -> TsidLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Show the robot in a browser.
        fused: Run the stages in one system, which gives the same numbers in less time (`drake_tc.loops.fused`).

    Raises:
        ParamsError: a file that cannot be read, or names or times that do not fit.
    """
    law = _law(scenario)
    robot = law.model.robot
    builder = DiagramBuilder()
    plant = add_grounded_plant(builder, scenario, law, meshcat=meshcat)
    models, controller_models = _models(scenario, robot)
    loop = add_whole_body_loop(
        builder,
        plant,
        law,
        scenario,
        models=models,
        controller_models=controller_models,
        references={name: task_source(law, name, spec) for name, spec in scenario.motion.items()},
        contacts=_contacts(builder, scenario, law),
    )
    diagram, log = loop.build(builder, f"{robot.name}_tsid", fused=fused)
    return TsidLoop(
        scenario=scenario,
        law=law,
        controller=loop.systems["tsid"],
        diagram=diagram,
        plant=plant,
        log=log,
        starts=loop.starts,
        flag_names=loop.flag_names,
    )


def add_grounded_plant(
    builder: DiagramBuilder, scenario: TsidScenario, law: Law, *, meshcat: bool = False
) -> MultibodyPlant:
    """Add a scenario's plant: the robot on its floor, and what pushes it.

    Args:
        builder: Takes the plant.
        scenario: With floor, step and pushes.
        law: Of the controller.
        meshcat: Show the robot in a browser.

    Raises:
        ParamsError: a file that cannot be read, or links that the robot does not have.
    """

    def surround(plant: MultibodyPlant) -> None:
        add_ground(plant, law.model.contacts, scenario.ground)

    robot, drives = law.model.robot, scenario.drives.actuators
    if scenario.torque == "drives" and drives is not None:
        robot = replace(robot, changes=link_changes(scenario.path(drives)))
    plant = add_robot_plant(builder, robot, scenario.plant_step, scene=True, meshcat=meshcat, prepare=surround)
    check_masses(plant, robot, scenario.masses)
    add_pushes(builder, plant, scenario.pushes)
    return plant


def _models(scenario: TsidScenario, robot: Robot) -> tuple[Models | None, Models | None]:
    """The simulated drives and what the torque control takes them for; None where there are no drives.

    Raises:
        ParamsError: a file that is missing or cannot be read.
    """
    if scenario.torque == "direct":
        return None, None
    if scenario.torque == "series_elastic":
        return spring_models(scenario, robot), None
    return drive_models(scenario, robot), drive_models(scenario, robot, controller=True)


def _contacts(builder: DiagramBuilder, scenario: TsidScenario, law: Law) -> OutputPort | None:
    """The contacts on which the controller stands; None where it stands on all of them."""
    if not scenario.lifted:
        return None
    switch = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    contacts: OutputPort = builder.AddNamedSystem("contacts", switch).get_output_port()
    return contacts


def _law(scenario: TsidScenario) -> Law:
    """The controller's law.

    Raises:
        ParamsError: a file that cannot be read, a step that does not divide the period, or no contacts.
    """
    law = load_law(scenario.path(scenario.controller), scenario.changes, known_drives(scenario))
    steps = law.period / scenario.plant_step
    if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
        raise ParamsError(
            f"plant_step: expected the controller's period, {law.period:g} s, or a whole part of it,"
            f" got {scenario.plant_step:g}"
        )
    if not law.model.contacts:
        raise ParamsError(
            f"{scenario.path(scenario.controller)}: contacts: expected at least one to stand on, got none"
        )
    return law
