"""The torque loop of Del Prete et al. (2016) around any robot file, as a scenario describes it.

The wiring is that of `add_torque_loop` (`drake_tc.loops.torque.wiring`); here stand the scenario's robot, its
surroundings and its references. `controller: servo` leaves out all between the reference and the guard: the vendor's
position servo alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from drake_tc.actuation.model import ActuatorModel
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.plant import add_objects, add_pushes, add_robot_plant, add_suspension, check_masses, set_masses
from drake_tc.loops.torque.references import References, posture, references, table_source
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import LoopDesign, actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.wiring import wire_torque_loop
from drake_tc.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class Loop(BuiltLoop[Scenario]):
    """A built torque loop.

    Attributes:
        robot: What it was built around.
        models: Joint to the simulated actuator.
    """

    robot: Robot
    models: Mapping[str, ActuatorModel]

    @property
    def period(self) -> float:
        """Period of the control [s]."""
        return self.scenario.dt

    def start(self, context: Context) -> None:
        """Put the robot at rest in the scenario's posture, with the masses that the scenario gives its links."""
        own = self.plant.GetMyContextFromRoot(context)
        positions = self.plant.GetPositions(own)
        for joint, position in zip(self.robot.joints, posture(self.scenario.motion, self.robot), strict=True):
            positions[self.plant.GetJointByName(joint).position_start()] = position
        self.plant.SetPositions(own, positions)
        set_masses(self.plant, own, self.scenario.masses)


def build_loop(scenario: Scenario, *, meshcat: bool = False, fused: bool = False) -> Loop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Show the robot in a browser.
        fused: Run the stages in one system, which gives the same numbers in less time (`drake_tc.loops.fused`).

    Raises:
        ParamsError: a file that cannot be read, a robot without what the scenario needs, or names that do not fit.
    """
    robot = loop_robot(scenario)
    models = actuator_models(scenario, robot)
    path = references(scenario, robot)
    builder = DiagramBuilder()

    def surround(plant: MultibodyPlant) -> None:
        add_objects(plant, scenario.objects)
        if scenario.suspension is not None:
            add_suspension(plant, robot, scenario.suspension)

    touch = bool(scenario.objects)
    plant = add_robot_plant(builder, robot, scenario.plant_step, collisions=touch, meshcat=meshcat, prepare=surround)
    check_masses(plant, robot, scenario.masses)
    add_pushes(builder, plant, scenario.pushes)
    source = builder.AddNamedSystem("reference", table_source(path.time, path.motion))
    forces = _force_reference(builder, scenario, robot, path)
    gains = torque_gains(scenario, robot)
    asked = bool(scenario.force) or bool(gains.kf.any()) or scenario.log_components
    loop = wire_torque_loop(
        builder,
        plant,
        LoopDesign.of_scenario(scenario),
        source.get_output_port(),
        forces if asked else None,
        free=not (scenario.objects or scenario.pushes),
    )
    left_out = {"joint_estimate", "unknown_wrench", "fault", *(() if scenario.log_truth else ("joint_torque",))}
    if forces is not None:
        loop.signals["force_reference"] = forces
    diagram, log = loop.build(builder, f"{robot.name}_{scenario.controller}_loop", left_out, fused=fused)
    return Loop(
        scenario=scenario,
        robot=robot,
        models=models,
        diagram=diagram,
        plant=plant,
        log=log,
        flag_names=loop.flag_names,
    )


def _force_reference(builder: DiagramBuilder, scenario: Scenario, robot: Robot, path: References) -> OutputPort | None:
    """The forces that the scenario asks for; None without F/T sensors or without a torque loop."""
    if scenario.controller == "servo" or not robot.force_torque:
        return None
    source = builder.AddNamedSystem("force_reference", table_source(path.time, path.force))
    port: OutputPort = source.get_output_port()
    return port
