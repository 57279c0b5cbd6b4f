"""What the controller knows of the robot: the plant's own state, or an estimate from its sensors.

The base estimator of Faraji et al. (2015) lies between sensors and controller.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.wiring import apply_rotor_inertia
from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import BaseEstimator
from drake_tc.estimation.base_rig import BaseEstimatorSpec, ContactSpec
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.built_loop import Start
from drake_tc.loops.fused import StageValues
from drake_tc.loops.loop_builder import LoopBuilder, behind, first_imu, picked, total
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.robot.plant import add_robot, check_joint_types
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SENSORS, Readings, SensorSuite, SensorSuiteSpec, add_sensors, load_suite
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.law import Law
from drake_tc.tsid.standing import StandingState
from drake_tc.types import GRAVITY

QUICK = 15
"""Samples of the filter behind the controller's joint velocities, read at its end: no delay, more noise."""
_IMU = ("gyro", "accel")
SLOW, ORDERS = 80, (2, 1)
"""Samples of the filters behind the torque estimate, in whose middle they are read: of the encoders, of the others."""

SAME_ROTOR = 1e-3
"""Relative difference of two rotor inertias that count as the same."""


@dataclass
class WholeBodyBuilder(LoopBuilder[WholeBodySpec]):
    """The whole-body loop under construction.

    Attributes:
        law: Of the controller.
        models: Of the simulated drives, by joint; None where torques go to the joints directly.
        controller_models: What their torque control takes them for.
        references: Tasks whose references stop where the IMU is lost.
    """

    law: Law = field(kw_only=True)
    models: Mapping[str, ActuatorModel] | None = None
    controller_models: Mapping[str, ActuatorModel] | None = None
    references: tuple[str, ...] = ()

    @property
    def known_plant(self) -> MultibodyPlant:
        """The plant whose masses the controller knows: that of the loop, or one with the robot alone."""
        if self.plant is None:
            plant = MultibodyPlant(self.law.period)
            add_robot(plant, self.law.model.robot)
            plant.Finalize()
            if self.models is not None:
                apply_rotor_inertia(plant, self.models)
            self.plant = plant
        return self.plant


def required_models(
    wiring: WholeBodyBuilder, which: Literal["models", "controller_models"]
) -> Mapping[str, ActuatorModel]:
    """The drives' models.

    Raises:
        ParamsError: there are none.
    """
    models: Mapping[str, ActuatorModel] | None = getattr(wiring, which)
    if models is None:
        raise ParamsError(f"models: expected actuator models, as torque: {wiring.scenario.torque} needs them, got none")
    return models


def check_rotors(law: Law, models: Mapping[str, ActuatorModel] | None) -> None:
    """The law's mass matrix has the rotors of the drives that the controller knows.

    Raises:
        ParamsError: a joint whose rotor differs by more than `SAME_ROTOR`.
    """
    check_joint_types(law.model.robot, () if models is None else models.values())
    for joint, known in zip(law.model.robot.joints, law.model.rotors.tolist(), strict=True):
        model = None if models is None else models[joint]
        if model is None:
            continue
        driven = 0.0 if model.transmission_effects else model.inertia
        if abs(driven - known) > SAME_ROTOR * max(driven, known):
            raise ParamsError(
                f"models: the drive of {joint!r} has a reflected rotor inertia of {driven:.4g} kg m^2, the law"
                f" {known:.4g}; name these models' file under `actuators` in the robot file, or state the values under"
                " `rotor_inertia` in the controller file"
            )


def add_whole_body_sensors(wiring: WholeBodyBuilder, plant: MultibodyPlant) -> SensorSuite:
    """Encoders, IMU and F/T sensors, as the scenario has them; the IMU is a tick late at least.

    What it measures is what this tick's torques cause, so a reading without delay would need itself.

    Args:
        wiring: Of the diagram.
        plant: In the diagram.

    Raises:
        ParamsError: an unknown preset or field of the scenario's sensors.
    """
    scenario, law = wiring.scenario, wiring.law
    suite, faults = sensor_specs(scenario, law.period), {n: f for n, f in scenario.faults.items() if n in SENSORS}
    return add_sensors(wiring.builder, plant, law.model.robot, suite, law.period, scenario.seed, faults)


def sensor_specs(scenario: WholeBodySpec, period: float) -> SensorSuiteSpec:
    """What the scenario's sensors do, the IMU a period late at least.

    Raises:
        ParamsError: an unknown preset or field.
    """
    suite = load_suite("sensors", scenario.sensors)
    late = {name: replace(getattr(suite, name), latency=max(period, getattr(suite, name).latency)) for name in _IMU}
    return replace(suite, **late)


def estimated_state(wiring: WholeBodyBuilder, sensors: Readings, contacts: OutputPort | None) -> OutputPort:
    """[q; v] from the encoders and the contacts that carry.

    Args:
        wiring: Of the diagram.
        sensors: Their readings.
        contacts: Which carry; None: all of them.
    """
    law, n = wiring.law, wiring.law.model.n
    encoder = sensors.encoder
    quick = SavitzkyGolayFilter(n, QUICK, 2, law.period, QUICK - 1)
    wiring.add("quick_filter", quick, signal=encoder)
    inputs = {"position": encoder, "velocity": quick.GetOutputPort("first_derivative")}
    if sensors.imu is not None:
        inputs["imu"] = first_imu(wiring.builder, sensors.imu)
    if contacts is not None:
        inputs["active_contacts"] = contacts
    wiring.add("standing_state", lambda: StandingState(law.model, law.period), **inputs)
    return wiring.output("standing_state", "estimated_state")


def estimated_torque(wiring: WholeBodyBuilder, sensors: Readings) -> dict[str, OutputPort]:
    """`joint_estimate` (3n), `estimated_torque` (n) and `fault` by Algorithm 1 of Del Prete et al. (2016), half a
    window late.

    Raises:
        ParamsError: a robot without IMU.
    """
    ports = wiring.filtered_readings(sensors, SLOW, ORDERS)
    wiring.add("torque_estimator", lambda: JointTorqueEstimator(TorqueModel(wiring.law.model.robot)), **ports)
    found = {"joint_estimate": ports["joint_estimate"]}
    return found | {name: wiring.output("torque_estimator", name) for name in ("estimated_torque", "fault")}


def estimator_spec(wiring: WholeBodyBuilder) -> BaseEstimatorSpec:
    """The estimator's contacts: those of the controller, with the robot's own soles and F/T sensors.

    Raises:
        ParamsError: a contact without an F/T sensor above it, or a tuning that is not possible.
    """
    scenario, law, plant = wiring.scenario, wiring.law, wiring.known_plant
    options = scenario.estimator
    weight = GRAVITY * float(plant.CalcTotalMass(plant.CreateDefaultContext()))
    contacts = []
    for contact in law.model.contacts:
        sole = None
        if contact.kind == "surface":
            corners = contact.corners + scenario.ground.margin * np.sign(contact.corners)
            sole = tuple((float(x), float(y)) for x, y, _ in corners)
        sensor = law.model.robot.force_torque[sensor_of(law.model.robot, contact)].name
        soft = None if sole is None else options.sole_stiffness
        points = options.sole_points[0], options.sole_points[1]
        loads = options.make * weight, options.break_ * weight
        contacts.append(ContactSpec(contact.frame, sole, sensor, *loads, soft, points))
    try:
        age = sensor_specs(scenario, law.period).gyro.latency  # of the readings at a tick
        return replace(BaseEstimatorSpec(tuple(contacts), law.period, age), **options.tuning)
    except TypeError as error:
        raise ParamsError(f"estimator.tuning: {error}") from None


def sensor_of(robot: Robot, contact: Contact) -> int:
    """Which of the robot's F/T sensors has the contact's link beyond it.

    Raises:
        ParamsError: none has.
    """
    for number, sensor in enumerate(robot.force_torque):
        if sensor.contact.link == contact.frame.link:
            return number
    raise ParamsError(
        f"{robot.source}: force_torque: expected one whose contact is on {contact.frame.link!r}, the link of contact"
        f" {contact.name!r}, got none"
    )


def base_state(
    wiring: WholeBodyBuilder, sensors: Readings, position: OutputPort, contacts: OutputPort | None
) -> tuple[OutputPort, Start]:
    """[q; v] by the base estimator, a tick late.

    Args:
        wiring: Of the diagram.
        sensors: Their readings.
        position: Of the joints, as they are sensed (n,) [rad].
        contacts: Which the controller stands on; None: the estimator goes by the loads. One that the controller does
            without is held off, whatever its load; the others go by their loads.

    Returns:
        The port, and what lets the estimators see the robot once before it starts.

    Raises:
        ParamsError: see `estimator_spec`; or a robot without IMU or F/T sensors.
    """
    law, n, builder = wiring.law, wiring.law.model.n, wiring.builder
    options = wiring.scenario.estimator
    spec = estimator_spec(wiring)
    if sensors.imu is None or sensors.force_torque is None:
        raise ParamsError(f"{law.model.robot.source}: expected an IMU and F/T sensors; one of them is missing")
    filtered = SavitzkyGolayFilter(n, options.velocity_window, 2, law.period, options.velocity_window - 1)
    wiring.add("velocity_filter", filtered, signal=position)
    numbers = [sensor_of(law.model.robot, contact) for contact in law.model.contacts]
    places = [6 * number + axis for number in numbers for axis in range(6)]
    inputs = {
        "position": position,
        "velocity": filtered.GetOutputPort("first_derivative"),
        "imu": first_imu(builder, sensors.imu),
        **picked(builder, "contact_wrenches", sensors.force_torque, {"wrench": places}),
    }
    if contacts is not None:
        inputs["contact_switch"] = _held_off(wiring, contacts)
    estimator: Any = wiring.add("base_estimator", BaseEstimator(law.model.robot, spec, method=options.method), **inputs)
    estimators = [estimator]
    if options.beside is not None:
        watching = BaseEstimator(law.model.robot, spec, method=options.beside)
        estimators.append(wiring.add("watching_estimator", watching, **inputs))
        wiring.signals["beside_state"] = watching.GetOutputPort("estimated_state")
    wiring.signals |= {
        "estimator_status": estimator.GetOutputPort("status"),
        "cop": estimator.GetOutputPort("cop"),
    }

    def start(values: StageValues) -> None:
        for each in estimators:
            values.set_state(each, values.next_state(each))

    port: OutputPort = estimator.GetOutputPort("estimated_state")
    return port, start


def _held_off(wiring: WholeBodyBuilder, contacts: OutputPort) -> OutputPort:
    """0 where a contact carries (1), -1 where it does not (0)."""
    k, builder = contacts.size(), wiring.builder
    less: Any = -np.ones(k)
    return total(builder, "contact_switch", contacts, behind(builder, "minus_one", ConstantVectorSource(less)))
