"""The loop of Del Prete et al. (2016) around any robot file: each stage a system, all wired to a MultibodyPlant.

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

Between the stages stand blocks of Drake's own that join, split and add signals; a signal that a stage has beside others
is taken from one port, as every call into Python costs a tick some microseconds. What a table of wanted motions asks of
the links of a welded robot comes from Drake's InverseDynamics, the block `rigid_torque`.

`controller: servo` leaves out all between the reference and the guard: the vendor's position servo alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.wiring import add_actuators
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.surroundings import add_objects, add_pushes, add_suspension, check_masses, set_masses
from drake_tc.loops.torque.parts import TorqueLoopBuilder, actuator_models, loop_robot, sensor_suite
from drake_tc.loops.torque.references import posture, references
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import servo_command, torque_command
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import add_sensors


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
    suite = sensor_suite(scenario)
    sensors = add_sensors(builder, plant, robot, suite, scenario.dt, scenario.seed, scenario.faults)
    parts = TorqueLoopBuilder(builder, scenario, plant, scenario.dt, robot=robot, sensors=sensors)
    command = torque_command(parts, wanted) if scenario.controller == "torque" else servo_command(parts, wanted)
    _add_drives(parts, models, command)
    diagram, log = parts.build(f"{robot.name}_{scenario.controller}_loop")
    return Loop(
        scenario=scenario,
        robot=robot,
        models=models,
        diagram=diagram,
        plant=plant,
        log=log,
        flag_names=parts.flag_names,
    )


def _add_plant(builder: DiagramBuilder, scenario: Scenario, robot: Robot, *, meshcat: bool) -> MultibodyPlant:
    """The robot in its surroundings; with geometry only where something is to be touched or seen."""
    plant: Any
    if scenario.objects or meshcat:
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, scenario.plant_step)
        add_robot(plant, robot, visuals=meshcat, collisions=bool(scenario.objects))
        add_objects(plant, scenario.objects)
        if meshcat:
            MeshcatVisualizer.AddToBuilder(builder, scene_graph, Meshcat())
    else:
        plant = builder.AddNamedSystem("plant", MultibodyPlant(scenario.plant_step))
        add_robot(plant, robot)
    if scenario.suspension is not None:
        add_suspension(plant, robot, scenario.suspension)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    plant.set_name("plant")
    check_masses(plant, robot, scenario.masses)
    add_pushes(builder, plant, scenario.pushes)
    built: MultibodyPlant = plant
    return built


def _add_drives(parts: TorqueLoopBuilder, models: Mapping[str, ActuatorModel], command: OutputPort) -> None:
    """The actuators between command and plant, and the signals that every run records."""
    plant, sensors = parts.plant, parts.sensors
    actuators = add_actuators(parts.builder, plant, models, parts.scenario.plant_step)
    parts.builder.Connect(command, actuators.GetInputPort("command"))
    parts.signals |= {
        "joint_state": plant.get_state_output_port(),
        "acceleration": plant.get_generalized_acceleration_output_port(),
        "actuation": parts.builder.GetSubsystemByName("actuation").get_output_port(0),
        "command": command,
        "encoder": sensors.encoder.GetOutputPort("reading"),
    }
    if sensors.imu is not None:
        parts.signals["imu"] = sensors.imu.GetOutputPort("reading")
    if sensors.force_torque is not None:
        parts.signals["force_torque"] = sensors.force_torque.GetOutputPort("reading")
    if parts.scenario.log_truth:
        parts.signals["joint_torque"] = sensors.joint_torque.GetOutputPort("reading")
