"""The torque loop of Del Prete et al. (2016) around any robot file, as a scenario describes it, and its runs.

The wiring is that of `add_torque_loop` (`drake_tc.loops.torque.wiring`); here stand the scenario's robot, its
surroundings and its references. `controller: servo` leaves out all between the reference and the guard: the vendor's
position servo alone. A recorded run comes with its log and rig file as `close-loop` reads them, and with what a
simulation comes to: tracking by joint, and faults by time.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from drake_tc.actuation.free_run import simulated_inertia
from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import LogError, SimulationError
from drake_tc.estimation.off_line import OffLineFilter, SensorLog, TorqueLog, estimate_log, wrench_bias
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.loop_builder import behind
from drake_tc.loops.plant import add_objects, add_pushes, add_robot_plant, add_suspension, check_masses, set_masses
from drake_tc.loops.recording import Progress, Recording, write_log, write_rig
from drake_tc.loops.torque.references import References, posture, references, table_source
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import LoopDesign
from drake_tc.loops.torque.wiring import Desired, wire_torque_loop
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray, IntArray


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
    design = LoopDesign.of_scenario(scenario)
    robot = design.plant_robot
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
    source = behind(builder, "reference", table_source(path.time, path.motion))
    forces = _force_reference(builder, scenario, robot, path)
    asked = bool(scenario.force) or bool(design.gains.kf.any()) or scenario.log_components
    desired = Desired(source, forces if asked else None)
    loop = wire_torque_loop(builder, plant, design, desired)
    left_out = {"joint_estimate", "unknown_wrench", "fault", *(() if scenario.log_truth else ("joint_torque",))}
    if forces is not None:
        loop.signals["force_reference"] = forces
    diagram, log = loop.build(builder, f"{robot.name}_{scenario.controller}_loop", left_out, fused=fused)
    return Loop(
        scenario=scenario,
        robot=robot,
        models=dict(zip(robot.joints, design.actuators, strict=True)),
        diagram=diagram,
        plant=plant,
        log=log,
        flag_names=loop.flag_names,
    )


def _force_reference(builder: DiagramBuilder, scenario: Scenario, robot: Robot, path: References) -> OutputPort | None:
    """The forces that the scenario asks for; None without F/T sensors or without a torque loop."""
    if scenario.controller == "servo" or not robot.force_torque:
        return None
    return behind(builder, "force_reference", table_source(path.time, path.force))


IMU_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
WRENCH_AXES = ("fx", "fy", "fz", "tx", "ty", "tz")


@dataclass(frozen=True, eq=False, kw_only=True)
class TorqueRecording(Recording):
    """A run of the torque loop.

    Attributes:
        robot: Whose.
        models: Joint to the simulated actuator.
        plant_step: Of plant and actuators [s], for the rig file.
    """

    robot: Robot
    models: Mapping[str, ActuatorModel]
    plant_step: float = 1e-3

    @property
    def size(self) -> int:
        """Number of joints n."""
        return len(self.robot.joints)

    @property
    def position(self) -> FloatArray:
        """True joint positions (T, n) [rad]."""
        return self["joint_state"][:, : self.size]

    @property
    def velocity(self) -> FloatArray:
        """True joint velocities (T, n) [rad/s]."""
        return self["joint_state"][:, self.size :]

    @property
    def tracking_error(self) -> FloatArray:
        """q_d - q (T, n) [rad], of the true positions."""
        return np.asarray(self["reference"][:, : self.size] - self.position)


def log_columns(recording: TorqueRecording, torque: FloatArray | None = None) -> dict[str, FloatArray]:
    """Canonical columns of what the robot's own sensors saw, and the commands.

    Args:
        recording: The simulation.
        torque: (T, n) link-side torques to write [N m]; None leaves them out.
    """
    columns: dict[str, FloatArray] = {"time": recording.time}
    for i, joint in enumerate(recording.robot.joints):
        kind = recording.models[joint].drive.kind
        columns[f"{joint}/position"] = recording["encoder"][:, i]
        columns[f"{joint}/{COMMAND_COLUMN[kind]}"] = recording["command"][:, i]
        if torque is not None:
            columns[f"{joint}/torque"] = torque[:, i]
    imus, wrenches = (
        [mount.name for mount in mounts] for mounts in (recording.robot.imu, recording.robot.force_torque)
    )
    for prefix, signal, names, axes in (("imu", "imu", imus, IMU_AXES), ("ft", "force_torque", wrenches, WRENCH_AXES)):
        if signal in recording.signals:
            for i, name in enumerate(names):
                for j, axis in enumerate(axes):
                    columns[f"{prefix}_{name}/{axis}"] = recording[signal][:, 6 * i + j]
    return columns


def rig_of(recording: TorqueRecording, *, torque: bool = True) -> dict[str, Any]:
    """The rig file of such a log: joints, drives, known rotor inertias as the simulated log has them.

    Args:
        recording: The simulation.
        torque: Whether the log has torque columns; without them the load is unknown.
    """
    joints = list(recording.robot.joints)
    drives = {joint: recording.models[joint].drive.kind for joint in joints}
    step = recording.plant_step
    inertia = {joint: {"rotor_inertia": simulated_inertia(recording.models[joint], step)} for joint in joints}
    same = set(drives.values())
    return {
        "joints": joints,
        "drive": same.pop() if len(same) == 1 else drives,
        "load": "torque" if torque else "unknown",
        "declared": inertia,
    }


RUNAWAY_SPEED = 100.0
"""A joint that is faster [rad/s] has run away: no geared joint gets there."""


def simulate_scenario(
    scenario: Scenario, progress: Progress | None = None, *, meshcat: bool = False, allow_runaway: bool = False
) -> TorqueRecording:
    """Build a scenario's loop, run it, and return what was logged.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.
        meshcat: Show the robot in a browser.
        allow_runaway: Stop quietly where a joint runs away, and return what was logged until then.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed, or the state left all bounds; names the system and the time.
    """
    if progress:
        progress("building", 0.0)
    return run_loop(build_loop(scenario, meshcat=meshcat, fused=True), progress, allow_runaway=allow_runaway)


def run_loop(loop: Loop, progress: Progress | None = None, *, allow_runaway: bool = False) -> TorqueRecording:
    """As `simulate_scenario`, for a loop that is built."""

    def watch(context: Context) -> Callable[[float], bool]:
        def goes_on(now: float) -> bool:
            if _bounded(loop, context):
                return True
            if allow_runaway:
                return False
            raise _runaway(loop, context)

        return goes_on

    found = loop.run(watch, progress)
    signals = dict(found.signals)
    order = joint_order(loop)
    places = np.array([loop.plant.GetJointByName(name).position_start() for name in loop.robot.joints])
    states = signals["joint_state"]
    if not loop.robot.fixed_base:
        signals["base_state"] = np.delete(states, np.concatenate([places, order + loop.plant.num_positions()]), axis=1)
    signals["joint_state"] = states[:, np.concatenate([places, order + loop.plant.num_positions()])]
    signals["acceleration"] = signals["acceleration"][:, order]
    return TorqueRecording(
        **vars(found) | {"signals": signals}, robot=loop.robot, models=loop.models, plant_step=loop.plant.time_step()
    )


def joint_order(loop: Loop) -> IntArray:
    """(n,) where the plant has the robot's joints in its velocities."""
    return np.array([loop.plant.GetJointByName(name).velocity_start() for name in loop.robot.joints])


def _speeds(loop: Loop, context: Context) -> FloatArray:
    plant = loop.plant
    return np.asarray(plant.GetVelocities(plant.GetMyContextFromRoot(context)))


def _bounded(loop: Loop, context: Context) -> bool:
    speeds = _speeds(loop, context)
    return bool(np.all(np.isfinite(speeds)) and np.abs(speeds).max(initial=0.0) < RUNAWAY_SPEED)


def _runaway(loop: Loop, context: Context) -> SimulationError:
    speeds = _speeds(loop, context)
    worst = int(np.argmax(np.where(np.isfinite(speeds), np.abs(speeds), np.inf)))
    names = loop.plant.GetVelocityNames()
    at = context.get_time()
    return SimulationError(
        f"system 'plant' ran away by t = {at:.3f} s: {names[worst]} is {speeds[worst]:.3g}, beyond"
        f" {RUNAWAY_SPEED:g} rad/s; the loop is unstable, or plant_step {loop.scenario.plant_step:g} s too large"
    )


SETTLED = 0.7
"""Tracking is evaluated from here on [s]: the guard has let go of the start."""
WINDOW = 41
"""Of the filters without delay by which a log's torques are estimated [samples]."""
ZEROED = (0.05, 0.5)
"""The F/T sensors are zeroed within these times [s]."""


def summarise(recording: TorqueRecording) -> dict[str, Any]:
    """Tracking errors [rad], largest torque of each joint's drive [N m], and faults, as plain data.

    Errors are evaluated from `SETTLED` on, or over the second half of a run that is shorter than twice that.
    """
    begin = min(SETTLED, 0.5 * recording.time[-1])
    late = recording.time >= begin
    error, torque = recording.tracking_error[late], np.abs(recording["actuation"])
    joints = [
        {
            "joint": joint,
            "rms_error": float(np.sqrt(np.mean(error[:, i] ** 2))),
            "max_error": float(np.abs(error[:, i]).max()),
            "max_torque": float(torque[:, i].max()),
        }
        for i, joint in enumerate(recording.robot.joints)
    ]
    return {
        "robot": recording.robot.name,
        "duration": float(recording.time[-1]),
        "errors_from": float(begin),
        "real_time_factor": recording.real_time_factor,
        "joints": joints,
        "faults": recording.raised_flags(),
    }


def estimated(recording: TorqueRecording) -> TorqueLog:
    """Link-side torques and contact wrenches from the log's own sensors, without delay.

    Source: Del Prete et al., 2016, Algorithm 1.

    The F/T sensors are zeroed between 0.05 s and a tenth of the run, at most 0.5 s, when nothing touches the robot; a
    run of less than half a second has no such span, and its F/T biases stay in. A robot without IMU is taken to have a
    base at rest.

    Args:
        recording: The simulation.

    Raises:
        LogError: a log with lost samples, or one shorter than the window, from which nothing can be estimated.
        ParamsError: a floating robot without IMU.
    """
    robot, samples = recording.robot, recording.time.size
    if samples < WINDOW:
        raise LogError(f"torque column: expected at least {WINDOW} samples; the log has {samples}")
    model = _torque_model(robot)
    period = float(recording.time[1] - recording.time[0])
    wrench = recording["force_torque"] if robot.force_torque else np.zeros((samples, 0))
    log = SensorLog(recording["encoder"], recording["imu"][:, :6] if robot.imu else None, wrench, period)
    filters = OffLineFilter.of(WINDOW)
    still = slice(round(ZEROED[0] / period), min(round(ZEROED[1] / period), samples // 10))
    zero = robot.force_torque and still.stop > still.start
    return estimate_log(model, log, filters, wrench_bias(model, log, still, filters) if zero else None)


def _torque_model(robot: Robot) -> TorqueModel:
    if not robot.fixed_base:
        return TorqueModel(robot)
    return TorqueModel(robot, base="imu" if robot.imu else "fixed", angular_acceleration="zero")


def write_results(
    recording: TorqueRecording, folder: Path, ending: str, tell: Callable[[str], None] | None = None
) -> list[Path]:
    """Write `log.ENDING` and `rig.yaml`, which `close-loop` reads.

    A log with lost samples, or one too short, has no torque columns; its rig file then says that the load is unknown.

    Args:
        recording: The simulation.
        folder: Made where it is not there.
        ending: csv, parquet or npz.
        tell: Told why the torque is left out, where it is.

    Returns:
        The files.

    Raises:
        LogError: a file that cannot be written.
    """
    try:
        torque = estimated(recording).torque
    except LogError as error:
        torque = None
        if tell:
            tell(f"no torque columns in the log: {error}")
    log = write_log(log_columns(recording, torque), folder / f"log.{ending}")
    return [log, write_rig(rig_of(recording, torque=torque is not None), folder / "rig.yaml")]
