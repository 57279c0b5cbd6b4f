"""`torque_controller`: the torque control of a robot as a Diagram without a plant, from readings to commands.

    position, imu, force_torque --> filter, torque_estimator, inverse_dynamics, torque_control, guard --> command

The stages are wired by the same function as those of the simulated loop (`drake_tc.loops.torque.wiring`): fed with the
readings of a simulated loop, the commands are the same to the last bit.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from pydrake.systems.framework import DiagramBuilder, System
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.control.gains import TorqueGains
from drake_tc.loops.boundary import ControlledJoints, Controller, add_input
from drake_tc.loops.torque.default_gains import torque_design, warn_of_weak_joints
from drake_tc.loops.torque.parts import actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.references import references, table_source
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec
from drake_tc.loops.torque.stages import TorqueLoopBuilder
from drake_tc.loops.torque.wiring import Reference, add_torque_controller
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import Readings
from drake_tc.sensor_validation.monitor_spec import LATE

INPUTS = {"encoder": "position", "imu": "imu", "force_torque": "force_torque", "joint_torque": "joint_torque"}
"""Field of `Readings` to the input port that brings it."""


def torque_controller(
    robot: Robot,
    models: Models,
    motion: Trajectory | System | Literal["input"] | None = None,
    spec: TorqueLoopSpec | None = None,
    *,
    gains: TorqueGains | None = None,
    free: bool = False,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
    fused: bool = False,
) -> Controller:
    """The torque control of a robot as a Diagram from readings to commands, without a plant.

    Input ports of the Diagram, each read every `spec.dt`:
        position (n): of the joints, in the order of the robot file [rad].
        imu (6 per IMU): [gyro; accel] in the IMU's frame [rad/s, m/s^2]; where the robot has an IMU.
        force_torque (6 per sensor): [force; torque] in the sensor's frame [N, N m]; where it has F/T sensors.
        joint_torque (n): of joint-torque sensors [N m]; with `spec.torque_from: sensor`.
        reference (3n): [q_d; qdot_d; qddot_d]; with `motion` "input".
        force_reference (6 per F/T sensor): f_d [N, N m]; where the gains feed forces back.
    Output ports of the Diagram:
        command (n): of the drives: q_d [rad], i [A] or V [V]. Finite whatever comes in, except before the first
            position has come in: a servo's command is then 0 (`CommandGuard`).
        and the signals of the stages: `mode` of the guard, `flags`, `estimated_torque`, `desired_torque`, ...

    Args:
        robot: From `load_robot`.
        models: What the controller takes the drives for, by joint or in the order of the robot's joints.
        motion: What the joints shall do: positions (n) over time, or a system with one output [q_d; qdot_d; qddot_d]
            (3n); None: the robot's posture; "input": what the input port `reference` says.
        spec: How the joints are controlled; None: the defaults, as in `add_torque_loop`. Its `sensors` say what noise
            the fault monitor expects, its `faults` are those of simulated sensors and are not used.
        gains: Feedback gains; None: those that leave each joint its margins, as in `add_torque_loop`.
        free: Whether nothing may touch the robot; a contact wrench then counts as a fault.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`.
        between: "stage.port" to a system of your own behind that output port.
        fused: Run the stages in one system, which gives the same numbers in less time.

    Raises:
        ParamsError: models or gains that do not fit the robot, a motion of another size, or a stage or place that the
            controller does not have.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> controller = torque_controller(robot, load_models(robot.actuators))
        >>> controller.GetInputPort("position").size(), controller.GetOutputPort("command").size()
        (6, 6)
    """
    assumed = model_list(models, robot.joints)
    design = torque_design(robot, spec, assumed, assumed, gains)
    warn_of_weak_joints(design, (*(stages or {}), *(between or {})))
    spec, gains = design.spec, design.gains
    if spec.monitor.encoder_timing == 0.0:
        spec = replace(spec, monitor=replace(spec.monitor, encoder_timing=LATE))
    builder, n = DiagramBuilder(), len(robot.joints)
    sizes = {"encoder": n, "imu": 6 * len(robot.imu), "force_torque": 6 * len(robot.force_torque)}
    sizes["joint_torque"] = n if spec.torque_from == "sensor" else 0
    ports = {name: add_input(builder, INPUTS[name], size) for name, size in sizes.items() if size}
    forced = bool(gains.kf.any()) and bool(robot.force_torque)
    if isinstance(motion, System):
        reference: Reference = builder.AddNamedSystem("reference", motion).get_output_port(0)
    else:
        reference = add_input(builder, "reference", 3 * n) if isinstance(motion, str) else motion
    parts = TorqueLoopBuilder(
        builder,
        spec,
        None,
        spec.dt,
        stages=stages or {},
        between=between or {},
        robot=robot,
        readings=Readings(**ports),
        models=list(assumed),
        gains=gains,
        force_reference=add_input(builder, "force_reference", sizes["force_torque"]) if forced else None,
        free=free,
    )
    add_torque_controller(parts, reference)
    servo = tuple(model.drive.kind == "position_servo" for model in assumed)
    limits = joint_limits(robot)
    controlled = ControlledJoints(
        joints=robot.joints,
        servo=servo,
        lower=limits.lower,
        upper=limits.upper,
        period=spec.dt,
        flag_names=parts.flag_names,
    )
    return Controller(builder, f"{robot.name}_controller", controlled, parts.signals, left_out=ports, fused=fused)


def scenario_controller(scenario: Scenario) -> Controller:
    """The controller of a scenario's loop, in one system: its robot, models, gains and references, without its plant.

    Args:
        scenario: Of the torque loop; forces that it commands at a contact come in through `force_reference`.

    Raises:
        ParamsError: a file that cannot be read, or names that do not fit.
    """
    robot = loop_robot(scenario, controller=True)
    path = references(scenario, robot)
    return torque_controller(
        robot,
        actuator_models(scenario, robot, controller=True),
        table_source(path.time, path.motion),
        scenario,
        gains=torque_gains(scenario, robot),
        free=not (scenario.objects or scenario.pushes),
        fused=True,
    )
