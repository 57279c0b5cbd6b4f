"""Sensors that fail in the loop of Faraji et al. (2015): their faults put in, what stands in for them, and all flags in
one signal.

    encoders, gauges --> (faults) --> joint_sensors --> link position, torque control
    imu, F/T         --> (faults) --> validated_imu, validated_wrench --> base estimator
    all of them raw  --> fault_monitor, joint_sensors, base estimator --> flags

What stands in for
    one of motor encoder, gauge, link encoder    the other two of its joint (`joint_sensors`)
    two of them                                  their last good values; after 150 ms the joint's torque fades, and its
                                                 motor's back-EMF brakes it; all torques where it is one that the robot
                                                 stands on (`sensor_loss_stop`)
    an IMU missing, frozen, or after a jump      feet: their rates against the base and soles that tilt as their load
    that no F/T sensor feels too                 says (`standing_feet`); after 30 ms the motion stops where it is
    an F/T sensor missing or frozen, or after    its last good reading; its contact carries as long as the controller
    a jump that the other loads belie            stands on it
    `contacts`, what the estimator is told of the controller's contacts: loads, and slip
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem
from drake_tc.control.guard import SensorLossStop
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import COPY_AFTER, KernelCall
from drake_tc.loops.loop_builder import first_imu, picked
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, sensor_of, sensor_specs
from drake_tc.loops.whole_body.series_elastic_drives import SpringReadings, controller_springs
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.sensing.sensor import Sensor
from drake_tc.sensing.spec import SensorSpec
from drake_tc.sensing.suite import Readings, sensor_seed
from drake_tc.sensor_validation.body_sensors import SETTLED, ValidatedImu, ValidatedWrench
from drake_tc.sensor_validation.fault_monitor import FaultMonitor
from drake_tc.sensor_validation.joint_sensors import FLAGS, JointSensors
from drake_tc.sensor_validation.monitor_spec import MonitorSpec
from drake_tc.sensor_validation.standing_feet import StandingFeet
from drake_tc.tsid.controller import reference_port
from drake_tc.tsid.law import Law
from drake_tc.types import BoolArray, Call, FloatArray

MONITOR = MonitorSpec(gyro_jump=0.3, accel_jump=1.5, force_jump=8.0, moment_jump=1.0, wrench_jump_lasts=False)
_SETTLED = SETTLED + MONITOR.hold
"""From when on flags count [s]."""
"""Twice to six times the largest steps in a tick of a robot that stands, turns at 1 Hz or bows, once its soles are
loaded: 0.05 rad/s, 0.42 m/s^2, 4.3 N, 0.25 N m (simulated)."""
_BELIEVED_NOT = ("missing", "frozen")
"""Flags with which an F/T sensor is left out."""
_OWN = {"yaw_drift": "imu/yaw_drift", "load_mismatch": "force_torque/load_mismatch", "failed": "estimator/failed"}
_OF_CONTACT = ("slip", "force_offset")
"""Of the base estimator's flags, those that speak of a sensor."""


@dataclass(frozen=True, eq=False)
class ValidatedSensors:
    """Sensor readings that passed validation, behind the same ports.

    Attributes:
        sensors, springs: With the validated readings.
        position: Of the links (n,) [rad].
        contacts: For the base estimator: 0 held off, 1 by its load, 2 held on.
        flags: Names and ports, (width,) each.
    """

    sensors: Readings
    springs: SpringReadings
    position: OutputPort
    contacts: OutputPort
    flags: dict[tuple[str, ...], OutputPort]


def failing(wiring: WholeBodyBuilder, name: str, port: OutputPort) -> OutputPort:
    """The port with the scenario's faults of that name: through a sensor that does nothing else."""
    faults = wiring.scenario.faults.get(name, ())
    if not faults:
        return port
    seed = sensor_seed(wiring.scenario.seed, f"failing_{name}")
    sensor = Sensor(port.size(), SensorSpec(), wiring.law.period, faults, seed)
    reading: OutputPort = wiring.add(f"failing_{name}", sensor, truth=port).GetOutputPort("reading")
    return reading


def add_sensor_validation(
    wiring: WholeBodyBuilder, sensors: Readings, springs: SpringReadings, contacts: OutputPort | None
) -> ValidatedSensors:
    """Put what checks the senses between them and their users.

    Args:
        wiring: Of the diagram.
        sensors: Their readings.
        springs: Their readings.
        contacts: Which the controller stands on; None: all of them.

    Raises:
        ParamsError: a robot without IMU or F/T sensors.
    """
    law, builder = wiring.law, wiring.builder
    robot, period = law.model.robot, law.period
    if sensors.imu is None or sensors.force_torque is None:
        raise ParamsError(f"{robot.source}: expected an IMU and F/T sensors; one of them is missing")
    suite = sensor_specs(wiring.scenario, period)
    encoder, imu = sensors.encoder, first_imu(builder, sensors.imu)
    wrench = sensors.force_torque
    monitor = FaultMonitor(robot, MONITOR.for_sensors(suite), period)
    wiring.add("fault_monitor", monitor, position=encoder, imu=imu, wrench=wrench)
    raised, names = monitor.GetOutputPort("flags"), monitor.flag_names
    joints = _joint_sensors(wiring, springs, encoder)

    def of(sensor: str) -> list[int]:
        return [names.index(f"{sensor}/{kind}") for kind in _BELIEVED_NOT]

    chosen = {"imu": [names.index("imu/frozen")], "wrench": [i for mount in robot.force_torque for i in of(mount.name)]}
    chosen["jolt"] = [names.index(f"{mount.name}/jump") for mount in robot.force_torque]
    doubts = picked(builder, "doubts", raised, chosen)
    limit = np.repeat([MONITOR.gyro_jump, MONITOR.accel_jump], 3)
    validated_imu = ValidatedImu(limit, 1, len(robot.force_torque), period)
    wiring.add("validated_imu", validated_imu, imu=imu, flagged=doubts["imu"], jolt=doubts["jolt"])
    contacts_of = tuple(sensor_of(robot, contact) for contact in law.model.contacts)
    contact_wrench = ValidatedWrench(len(robot.force_torque), len(_BELIEVED_NOT), contacts_of, period)
    told = {} if contacts is None else {"contacts": failing(wiring, "contacts", contacts)}
    wiring.add("validated_wrench", contact_wrench, wrench=wrench, flagged=doubts["wrench"], **told)
    feet = StandingFeet(robot, law.model.contacts, contacts_of, sole_compliance(wiring), period)
    known = {
        "wrench": contact_wrench.GetOutputPort("reading"),
        "contacts": contact_wrench.GetOutputPort("contacts"),
    }
    known |= {"imu": validated_imu.GetOutputPort("reading"), "link_angle": joints.GetOutputPort("link_angle")}
    wiring.add("standing_feet", feet, **known)
    checked = Readings(
        joints.GetOutputPort("link_angle"), feet.GetOutputPort("reading"), contact_wrench.GetOutputPort("reading")
    )
    return ValidatedSensors(
        checked,
        SpringReadings(joints.GetOutputPort("motor_angle"), joints.GetOutputPort("torque")),
        joints.GetOutputPort("position" if wiring.scenario.series_elastic.link_from == "motor" else "link_angle"),
        contact_wrench.GetOutputPort("contacts"),
        {
            names: raised,
            FLAGS: joints.GetOutputPort("flags"),
            ("imu/left_out",): validated_imu.GetOutputPort("left_out"),
        },
    )


def _joint_sensors(wiring: WholeBodyBuilder, springs: SpringReadings, encoder: OutputPort) -> JointSensors:
    spec, suite = wiring.scenario.series_elastic, sensor_specs(wiring.scenario, wiring.law.period)
    compliance, times = controller_springs(wiring)
    noisy = bool(np.all(np.asarray(spec.gauge.noise) > 0.0)), bool(np.all(np.asarray(suite.encoder.noise) > 0.0))
    senses = JointSensors(compliance, times, wiring.law.period, noisy)
    raw = {
        "motor_angle": failing(wiring, "motor_encoder", springs.motor_angle),
        "torque": failing(wiring, "gauge", springs.torque),
        "link_angle": encoder,
    }
    wiring.add("joint_sensors", senses, **raw)
    return senses


def sole_compliance(wiring: WholeBodyBuilder) -> FloatArray:
    """(c, 2) how far each contact tilts along its x and y per N m [rad/(N m)], as `SoleSpec` has it; 0 where hard.

    Of soles as stiff as the base estimator is told.
    """
    known, margin = wiring.scenario.estimator, wiring.scenario.ground.margin
    contacts = wiring.law.model.contacts
    found = np.zeros((len(contacts), 2))
    for number, contact in enumerate(contacts):
        if known.sole_stiffness is None or contact.kind != "surface":
            continue
        half = 0.5 * np.ptp(contact.corners[:, :2], axis=0) + margin
        points = np.array(known.sole_points)
        found[number] = 1.0 / (known.sole_stiffness * half**2 * (points + 1) / (3 * (points - 1)))
    return found


def stopped(
    wiring: WholeBodyBuilder, validated: ValidatedSensors, state: OutputPort, torque: OutputPort
) -> tuple[OutputPort, SpringReadings, OutputPort]:
    """State and gauges for the controllers, and their torque for the drives: see `sensor_loss_stop`."""
    senses, law = wiring.builder.GetSubsystemByName("joint_sensors"), wiring.law
    system = SensorLossStop(state.size(), carrying_joints(law), law.fade, law.period)
    gauges = validated.springs.torque
    wiring.add(
        "sensor_loss_stop", system, state=state, torque=gauges, desired=torque, lost=senses.GetOutputPort("lost")
    )
    springs = replace(validated.springs, torque=system.GetOutputPort("torque"))
    return system.GetOutputPort("state"), springs, system.GetOutputPort("desired")


def carrying_joints(law: Law) -> BoolArray:
    """(n,) which joints lie between the robot's base and one of its contacts."""
    robot = law.model.robot
    tree = read_urdf(robot.urdf, robot.splits)
    links = {contact.frame.link for contact in law.model.contacts}
    return np.array([bool(tree.beyond(tree.joints[name].child) & links) for name in robot.joints])


def add_flags(wiring: WholeBodyBuilder, validated: ValidatedSensors) -> tuple[str, ...]:
    """Let the feet stand in for the IMU, and its loss stop all motion; record all flags in one signal, `flags`.

    Their names, SENSOR/WHAT, are returned.

    Those of the base estimator are there that speak of a sensor or a contact: yaw drift, load mismatch, slip, load in
    the air.
    """
    builder = wiring.builder
    estimator: Any = builder.GetSubsystemByName("base_estimator")
    known = estimator.flag_names
    named = dict(_OWN) | {name: name for name in known if name.partition("/")[2] in _OF_CONTACT}
    feet: Any = builder.GetSubsystemByName("standing_feet")
    for name in ("estimated_state", "cop"):
        builder.Connect(estimator.GetOutputPort(name), feet.GetInputPort(name))
    builder.Connect(feet.GetOutputPort("imu_tilt"), estimator.GetInputPort("imu_tilt"))
    for name in wiring.references:
        moving: Any = builder.GetSubsystemByName(reference_port(name))
        builder.Connect(feet.GetOutputPort("lost"), moving.GetInputPort("stop"))
    places = [known.index(name) for name in named]
    own = picked(builder, "estimator_flags", estimator.GetOutputPort("status"), {"own": places})
    told = {
        **validated.flags,
        ("imu/turning",): feet.GetOutputPort("flag"),
        ("imu/lost",): feet.GetOutputPort("lost"),
        tuple(named.values()): own["own"],
    }
    groups = list(told.items())
    joined = wiring.join("all_flags", [port for _, port in groups])
    flags = wiring.add("flags", Settled(joined.size()), signal=joined)
    wiring.signals["flags"] = flags.get_output_port()
    return tuple(name for names, _ in groups for name in names)


class Settled(StageSystem):
    """Zeros at first, then the input `signal` (n): soles that take their load look like faults. No state.

    At first: before `SETTLED` and the time for which the monitor's flags stay up.
    """

    def __init__(self, size: int) -> None:
        """Declare the ports.

        Args:
            size: n.
        """
        super().__init__()
        self._size = size
        self._declare({"signal": size}, timed=True)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""

        def bind(arrays: Arrays) -> tuple[Call, None]:
            signal, out = arrays.inputs["signal"], arrays.out

            def outputs(time: float) -> None:
                out[:] = signal if time >= _SETTLED else 0.0

            return KernelCall(COPY_AFTER, outputs, signal, out, _SETTLED), None

        return ArrayStage(self._size, {"settled": np.arange(self._size)}, bind, frozenset({"signal"}))
