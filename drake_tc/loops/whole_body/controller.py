"""`whole_body_controller`: robust TSID as a Diagram without a plant, from readings to commands.

The stages are wired by the same function as those of the simulated loop (`drake_tc.loops.whole_body.control`): fed with
the readings of a simulated loop, the commands are the same to the last bit.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Literal

from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models
from drake_tc.errors import ParamsError
from drake_tc.loops.boundary import CONTACTS, ControlledJoints, Controller, Start, add_input
from drake_tc.loops.fused import StageValues
from drake_tc.loops.whole_body.control import WholeBodyControl, add_whole_body_control
from drake_tc.loops.whole_body.drives import drive_models, known_drives
from drake_tc.loops.whole_body.references import contact_source, task_source
from drake_tc.loops.whole_body.scenario import TsidScenario, WholeBodySpec
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, check_rotors, required_models
from drake_tc.loops.whole_body.series_elastic_drives import SpringReadings, check_springs, spring_models
from drake_tc.loops.whole_body.wiring import by_joint
from drake_tc.robot.plant import joint_limits
from drake_tc.sensing.suite import Readings
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import reference_port
from drake_tc.tsid.law import Law


def whole_body_controller(
    law: Law,
    models: Models | None = None,
    motion: Mapping[str, System | Trajectory | Literal["input"]] | None = None,
    spec: WholeBodySpec | None = None,
    *,
    contacts: System | Literal["input"] | None = None,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
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
        between: "stage.port" to a system of your own behind that output port.
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
        between=between or {},
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
    )
    return Controller(
        builder,
        f"{robot.name}_whole_body_controller",
        controlled,
        wiring.signals | {"command": control.command},
        left_out=inputs,
        starts=(*control.starts, *_hold(wiring, springs, control)),
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
    robot = law.model.robot
    models: Models | None = None
    if scenario.torque == "series_elastic":
        models = spring_models(scenario, robot)
    elif scenario.torque == "drives":
        models = drive_models(scenario, robot, controller=True)
    lifts = contact_source(law.model.contacts, scenario.lifted, scenario.duration, law.period)
    return whole_body_controller(
        law,
        models,
        {name: task_source(law, name, spec) for name, spec in scenario.motion.items()},
        scenario,
        contacts=lifts if scenario.lifted else None,
        fused=True,
    )
