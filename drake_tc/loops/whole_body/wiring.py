"""`add_whole_body_loop`: robust TSID around the plant of a legged robot, in one call.

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

`state: plant` hands the plant's own state to the controller, `torque: direct` its torques to the joints. The loop of
Faraji, Colasanto and Ijspeert (2015) is `state: base_estimator` with `torque: series_elastic`.

All from the readings to the commands is wired by `add_whole_body_control`, also for a controller without a plant.

`whole_body_controller`: robust TSID as a Diagram without a plant, from readings to commands.

Fed with the readings of a simulated loop, its commands are the same to the last bit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort, System
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import add_actuators
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import CONTACTS, ControlledJoints, Controller, Start, WiredLoop, add_input
from drake_tc.loops.fused import FusedStages, StageValues
from drake_tc.loops.loop_builder import product
from drake_tc.loops.plant import require_fitting_plant
from drake_tc.loops.whole_body.control import WholeBodyControl, add_whole_body_control
from drake_tc.loops.whole_body.drives import drive_models, known_drives
from drake_tc.loops.whole_body.references import contact_source, task_source
from drake_tc.loops.whole_body.scenario import TsidScenario, WholeBodySpec
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, add_whole_body_sensors, check_rotors, required_models
from drake_tc.loops.whole_body.series_elastic_drives import (
    SpringReadings,
    add_spring_drives,
    check_springs,
    drive_springs,
)
from drake_tc.robot.plant import joint_limits
from drake_tc.sensing.suite import Readings, SensorSuite
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import reference_port
from drake_tc.tsid.law import Law
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class WholeBodyLoop(WiredLoop):
    """A whole-body loop in a diagram.

    Stages: `tsid`, and as far as there are such stages `standing_state`, `base_estimator`, `torque_estimator`,
    `torque_control`, `guard`, `actuators`. Signals: `state` [q; v] of the plant, `estimated_state`, `torque`,
    `acceleration`, `contact_force`, `status`, `applied_torque`, and more; `flags` with sensor validation.

    Attributes:
        sensors: Encoders, IMU, F/T sensors; None where nothing is sensed.
        starts: Put parts of the diagram's context where the robot starts, in this order.
    """

    sensors: SensorSuite | None
    starts: tuple[Start, ...]

    def start(self, context: Context, stages: FusedStages | None = None) -> None:
        """Put estimators and drives where a robot that has stood for long has them.

        Args:
            context: Of the whole diagram.
            stages: What `fuse` returned for the loop's builder; None where it was not called.
        """
        values = StageValues(context, stages)
        for start in self.starts:
            start(values)


def add_whole_body_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    law: Law,
    spec: WholeBodySpec | None = None,
    *,
    models: Models | None = None,
    controller_models: Models | None = None,
    references: Mapping[str, System | Trajectory] | None = None,
    contacts: OutputPort | None = None,
    stages: Mapping[str, System] | None = None,
) -> WholeBodyLoop:
    """Add controller, and as `spec` says sensors, estimation and drives, to a plant, and connect all of them.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant of the law's robot with live ports, on its floor.
        law: Of the controller, from `load_law`.
        spec: What stands between controller and robot; None: its state is known, its torques go to the joints.
        models: Of the simulated drives; needed unless `torque` is "direct".
        controller_models: What their torque control takes the drives for; None: what they are.
        references: Task to a system whose output it follows, or to a trajectory of its place; others rest.
        contacts: (contacts) 1 where the controller stands on one, else 0; None: it stands on all of them.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`; `tsid` needs the input
            `estimated_state` and the outputs of `OUTPUTS`.

    Raises:
        ParamsError: a plant that is not finalized or whose ports are sampled, models that are missing or whose rotors
            are not those of the law, or a stage or place that the loop does not have.

    Example:
        >>> law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, law.model.robot)
        >>> loop = add_whole_body_loop(builder, plant, law)
        >>> loop.signals["torque"].size() == law.model.n
        True
    """
    robot = law.model.robot
    require_fitting_plant(plant, law.period, robot)
    spec = WholeBodySpec() if spec is None else spec
    touched = plant.get_generalized_contact_forces_output_port(plant.GetModelInstanceByName(robot.name))
    state = plant.get_state_output_port()
    if robot.followers:
        known, moved = _without_followers(plant, law)
        state, touched = (
            product(builder, *each) for each in (("known_state", known, state), ("known_contact", moved, touched))
        )
    named = [None if m is None else by_joint(m, law) for m in (models, controller_models or models)]
    check_rotors(law, named[1])
    wiring = WholeBodyBuilder(
        builder,
        spec,
        plant,
        law.period,
        {"state": state, "contact": touched},
        stages=stages or {},
        law=law,
        models=named[0],
        controller_models=named[1],
    )
    sensed = spec.state != "plant" or spec.torque == "drives"
    sensors = add_whole_body_sensors(wiring, plant) if sensed else None
    readings = None if sensors is None else sensors.readings
    actuators, springs = add_spring_drives(wiring, plant) if spec.torque == "series_elastic" else (None, None)
    control = add_whole_body_control(wiring, readings, springs, references or {}, contacts)
    starts = [*control.starts, *_drive(wiring, plant, actuators, control)]
    return WholeBodyLoop(
        systems=wiring.systems,
        sensors=sensors,
        signals=wiring.signals,
        flag_names=wiring.flag_names,
        period=law.period,
        starts=tuple(starts),
    )


def _without_followers(plant: MultibodyPlant, law: Law) -> tuple[FloatArray, FloatArray]:
    """What the law's [q; v] is of the plant's, and its generalized forces of the plant's, where joints follow others.

    Args:
        plant: With the robot alone.
        law: Of the controller.
    """
    model, robot = law.model, law.model.robot
    whole: Any = plant
    positions, velocities = np.zeros(model.nq, dtype=int), np.zeros(model.nv, dtype=int)
    if not robot.fixed_base:
        body, (q, v) = whole.GetBodyByName(robot.base), model.base_places
        positions[q : q + 7] = body.floating_positions_start() + np.arange(7)
        velocities[v : v + 6] = body.floating_velocities_start_in_v() + np.arange(6)
    joints = [whole.GetJointByName(name) for name in robot.joints]
    positions[model.positions] = [joint.position_start() for joint in joints]
    velocities[model.actuated] = [joint.velocity_start() for joint in joints]
    known = np.eye(whole.num_multibody_states())[[*positions, *(whole.num_positions() + velocities)]]
    moved = np.eye(whole.num_velocities())[velocities]
    for name, follows in robot.followers.items():
        row = model.actuated[robot.joints.index(follows.of)]
        moved[row, whole.GetJointByName(name).velocity_start()] = follows.multiplier
    return known, moved


def by_joint(models: Models, law: Law) -> dict[str, Any]:
    """Joint to its model, of models by joint or in the order of the robot's joints."""
    joints = law.model.robot.joints
    return dict(zip(joints, model_list(models, joints), strict=True))


def _drive(
    wiring: WholeBodyBuilder, plant: MultibodyPlant, actuators: ActuatorPlant | None, control: WholeBodyControl
) -> list[Start]:
    """The commands on their way to the joints: directly, or through drives; what has to be started for it."""
    if actuators is not None and control.springs is not None:
        return [drive_springs(wiring, actuators, control.springs)]
    if wiring.scenario.torque == "drives":
        models = required_models(wiring, "models")
        actuators = add_actuators(wiring.builder, plant, models, plant.time_step() or wiring.period)
        wiring.systems["actuators"] = actuators
        wiring.builder.Connect(control.command, actuators.GetInputPort("command"))
        wiring.signals["applied_torque"] = actuators.GetOutputPort("actuation")
    else:
        wiring.signals["applied_torque"] = control.command
        wiring.builder.Connect(control.command, plant.get_actuation_input_port())
    return []


def whole_body_controller(
    law: Law,
    models: Models | None = None,
    motion: Mapping[str, System | Trajectory | Literal["input"]] | None = None,
    spec: WholeBodySpec | None = None,
    *,
    contacts: System | Literal["input"] | None = None,
    stages: Mapping[str, System] | None = None,
    fused: bool = False,
) -> Controller:
    """The whole-body control of a legged robot as a Diagram from readings to commands, without a plant.

    Input ports of the Diagram, each read every period of the law:
        state (nq + nv): [q; v] in the order of the robot's plant; with `spec.state: plant`.
        position (n), imu (6 per IMU), force_torque (6 per F/T sensor): as in `torque_controller`; with another `state`,
            or `torque: drives`, as far as the robot has such sensors.
        motor_position (n) [rad], spring_torque (n) [N m]: before the springs, and of them; with `torque:
            series_elastic`.
        <task>_reference: of tasks whose motion is "input".
        active_contacts (contacts): 1 where the controller stands on a contact, else 0; with `contacts` "input".
    Output ports of the Diagram:
        command (n): torques [N m] with `torque: direct`, positions of the servos [rad] with `drives`, voltages [V] with
            `series_elastic`.
        and the signals of the stages: `status`, `estimated_state`, `torque`, `flags`, ...

    Args:
        law: From `load_law`.
        models: What the controller takes the drives for; needed unless `torque` is "direct".
        motion: Task to what it follows, "input" for an input port; others rest.
        spec: What stands between controller and robot; None: its state is known, its commands are torques. Its `faults`
            and `torque_error` are those of a simulation and are not used.
        contacts: Which contacts carry: a system with one output (contacts), "input" for the input port
            `active_contacts`; None: all of them.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.
        fused: Run the stages in one system, which gives the same numbers in less time.

    Raises:
        ParamsError: models that are missing or whose rotors are not those of the law, or a stage or place that the
            controller does not have.

    Example:
        >>> law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
        >>> controller = whole_body_controller(law)
        >>> controller.GetOutputPort("command").size() == law.model.n
        True
    """
    spec = replace(WholeBodySpec() if spec is None else spec, faults={}, torque_error=None)
    builder, robot, n = DiagramBuilder(), law.model.robot, law.model.n
    given = None if models is None else by_joint(models, law)
    check_rotors(law, given)
    wiring = WholeBodyBuilder(
        builder,
        spec,
        None,
        law.period,
        stages=stages or {},
        law=law,
        models=given,
        controller_models=given,
    )
    sensed = spec.state != "plant" or spec.torque == "drives"
    inputs: dict[str, OutputPort] = {}

    def port(name: str, size: int) -> OutputPort:
        inputs[name] = add_input(builder, name, size)
        return inputs[name]

    if spec.state == "plant":
        wiring.signals["state"] = port("state", law.model.nq + law.model.nv)
    readings = None
    if sensed:
        sizes = {"imu": 6 * len(robot.imu), "force_torque": 6 * len(robot.force_torque)}
        readings = Readings(port("position", n), *(port(name, size) if size else None for name, size in sizes.items()))
    springs = None
    if spec.torque == "series_elastic":
        check_springs(required_models(wiring, "models"))
        springs = SpringReadings(port("motor_position", n), port("spring_torque", n))
    follows = {name: _follows(law, name, path, port) for name, path in (motion or {}).items()}
    stands: OutputPort | None = None
    if isinstance(contacts, System):
        stands = builder.AddNamedSystem("contacts", contacts).get_output_port(0)
    elif contacts is not None:
        stands = port(CONTACTS, len(law.model.contacts))
    control = add_whole_body_control(wiring, readings, springs, follows, stands)
    limits = joint_limits(robot)
    controlled = ControlledJoints(
        joints=robot.joints,
        servo=_servos(wiring),
        lower=limits.lower,
        upper=limits.upper,
        period=law.period,
        flag_names=wiring.flag_names,
        inputs=tuple(inputs),
        starts=(*control.starts, *_hold(wiring, springs, control)),
    )
    return Controller(
        builder,
        f"{robot.name}_whole_body_controller",
        controlled,
        wiring.signals | {"command": control.command},
        fused=fused,
    )


def _follows(
    law: Law, task: str, path: System | Trajectory | str, port: Callable[[str, int], OutputPort]
) -> System | Trajectory | OutputPort:
    """What a task follows: its path, or an input port.

    Raises:
        ParamsError: a task that the law does not have.
    """
    sizes = {each.name: each.reference_size for each in law.tasks}
    if task not in sizes:
        raise ParamsError(f"motion: no task {task!r} in this law; tasks: {', '.join(sizes)}")
    return port(reference_port(task), sizes[task]) if isinstance(path, str) else path


def _servos(wiring: WholeBodyBuilder) -> tuple[bool, ...]:
    """Whether a joint's command is a position."""
    if wiring.scenario.torque != "drives":
        return (False,) * wiring.law.model.n
    return tuple(model.drive.kind == "position_servo" for model in required_models(wiring, "models").values())


def _hold(wiring: WholeBodyBuilder, springs: SpringReadings | None, control: WholeBodyControl) -> tuple[Start, ...]:
    """The angles at which motors are held are those at the start, with `position_gain`."""
    wound, gain = control.springs, wiring.scenario.series_elastic.position_gain
    if springs is None or wound is None or wound.held is None:
        return ()

    def start(values: StageValues) -> None:
        angle, first = values.output(springs.motor_angle), values.output(wound.torque)
        wound.held.get_mutable_source_value(values.context_of(wound.held)).SetFromVector(angle + first / gain)

    return (start,)


def scenario_controller(scenario: TsidScenario) -> Controller:
    """The controller of a scenario's loop, in one system: its law, models, references and contacts, without its plant.

    Raises:
        ParamsError: a file that cannot be read, or names or times that do not fit.
    """
    law = load_law(scenario.path(scenario.controller), scenario.changes, known_drives(scenario))
    lifts = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    return whole_body_controller(
        law,
        drive_models(scenario, law.model.robot, controller=True),
        {name: task_source(law, name, spec) for name, spec in scenario.motion.items()},
        scenario,
        contacts=lifts if scenario.lifted else None,
        fused=True,
    )
