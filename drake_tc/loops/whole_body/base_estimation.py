"""The base estimator of Faraji et al. (2015) between sensors and controller."""

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import Adder, ConstantVectorSource

from drake_tc.errors import ParamsError
from drake_tc.estimation.base.rig import BaseEstimatorSpec, ContactSpec
from drake_tc.estimation.base.system import BaseEstimator
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.boundary import Start
from drake_tc.loops.fused import StageValues
from drake_tc.loops.loop_builder import first_imu, picked
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, sensor_specs
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import Readings
from drake_tc.tsid.contacts import Contact
from drake_tc.types import GRAVITY


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
        return replace(BaseEstimatorSpec(tuple(contacts), law.period, imu_age(scenario, law.period)), **options.tuning)
    except TypeError as error:
        raise ParamsError(f"estimator.tuning: {error}") from None


def imu_age(scenario: WholeBodySpec, period: float) -> float:
    """How old the IMU's readings are at a tick [s].

    Args:
        scenario: Whose sensors they are.
        period: Of the controller [s].
    """
    latency: float = sensor_specs(scenario, period).gyro.latency
    return latency


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
    one = builder.AddNamedSystem("minus_one", ConstantVectorSource(less))
    total: Any = builder.AddNamedSystem("contact_switch", Adder(2, k))
    builder.Connect(contacts, total.get_input_port(0))
    builder.Connect(one.get_output_port(), total.get_input_port(1))
    port: OutputPort = total.get_output_port()
    return port
