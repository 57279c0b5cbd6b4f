"""`add_whole_body_control`: all between the readings of a legged robot and the commands of its drives.

    readings --> [sensor validation] --> state, or its estimate --> tsid --> [torque control] --> command

It is called with the ports of simulated sensors by `add_whole_body_loop`, and with input ports by
`whole_body_controller`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydrake.systems.framework import OutputPort, System
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import Trajectory

from drake_tc.control.reference_source import StoppingReference
from drake_tc.loops.built_loop import Start
from drake_tc.loops.loop_builder import behind, total
from drake_tc.loops.whole_body.drives import TorqueNoise, control_drives
from drake_tc.loops.whole_body.sensor_validation import ValidatedSensors, add_flags, add_sensor_validation, stopped
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, base_state, estimated_state
from drake_tc.loops.whole_body.series_elastic_drives import (
    SpringCommand,
    SpringReadings,
    control_springs,
    link_position,
)
from drake_tc.sensing.suite import Readings
from drake_tc.tsid.controller import RobustTsid, reference_port

OUTPUTS = ("torque", "acceleration", "contact_force", "status")
"""Ports of the controller that are signals of the loop."""
Reference = System | Trajectory | OutputPort
"""What a task follows."""


@dataclass(frozen=True, eq=False)
class WholeBodyControl:
    """The stages between readings and commands, connected.

    Attributes:
        command: What the drives get: torques [N m] (`torque: direct`), positions [rad] or voltages [V].
        springs: More of the command, with series-elastic drives.
        starts: Put estimators where the robot starts, in this order.
    """

    command: OutputPort
    springs: SpringCommand | None = None
    starts: list[Start] = field(default_factory=list)


def add_whole_body_control(
    wiring: WholeBodyBuilder,
    readings: Readings | None,
    springs: SpringReadings | None,
    references: Mapping[str, Reference],
    contacts: OutputPort | None,
) -> WholeBodyControl:
    """Add the controller, and as its spec says estimation and torque control, and connect them.

    Args:
        wiring: With the signal `state` where the spec has `state: plant`.
        readings: Of the sensors; None where nothing is sensed.
        springs: Of series-elastic drives; None: there are none.
        references: Task to what it follows; others rest.
        contacts: (contacts) 1 where the controller stands on one, else 0; None: it stands on all of them.

    Raises:
        ParamsError: models that are missing, or a stage or place that the controller does not have.
    """
    wiring.add("tsid", lambda: RobustTsid(wiring.law))
    _connect_references(wiring, references, contacts)
    validated = _validated(wiring, readings, springs, contacts)
    position = None
    if validated is not None:
        readings, springs, contacts = validated.sensors, validated.springs, validated.contacts
        position = validated.position
    elif springs is not None and readings is not None:
        position = link_position(wiring, springs, readings.encoder)
    state, starts = _known_state(wiring, readings, position, contacts)
    torque = _with_error(wiring, wiring.output("tsid", "torque"))
    if validated is not None:
        state, springs, torque = stopped(wiring, validated, state, torque)
    wiring.connect("tsid", "estimated_state", state)
    wound = None if springs is None else control_springs(wiring, springs, torque)
    command = torque if wound is None else wound.voltage
    if wound is None and readings is not None and wiring.scenario.torque == "drives":
        command = control_drives(wiring, readings, torque, state)
    tsid = wiring.systems["tsid"]
    wiring.signals |= {name: wiring.output("tsid", name) for name in OUTPUTS if tsid.HasOutputPort(name)}
    if validated is not None:
        wiring.flag_names = add_flags(wiring, validated)
    wiring.check_own_systems()
    return WholeBodyControl(command, wound, starts)


def _connect_references(
    wiring: WholeBodyBuilder, references: Mapping[str, Reference], contacts: OutputPort | None
) -> None:
    """What moves; what does not stays as the controller has it. The contacts that carry, if they change."""
    for name, given in references.items():
        port = reference_port(name)
        if isinstance(given, OutputPort):
            wiring.connect("tsid", port, given)
            continue
        source: Any = TrajectorySource(given, 2) if isinstance(given, Trajectory) else given
        if wiring.scenario.validated:
            source = StoppingReference(source, wiring.period)
            wiring.references = (*wiring.references, name)
        added = wiring.builder.AddNamedSystem(port, source)
        wiring.connect("tsid", port, added.get_output_port())
    if contacts is not None:
        wiring.connect("tsid", "active_contacts", contacts)


def _validated(
    wiring: WholeBodyBuilder, readings: Readings | None, springs: SpringReadings | None, contacts: OutputPort | None
) -> ValidatedSensors | None:
    """The checks of the sensors, where the scenario has them."""
    if readings is None or springs is None or not wiring.scenario.validated:
        return None
    return add_sensor_validation(wiring, readings, springs, contacts)


def _known_state(
    wiring: WholeBodyBuilder, readings: Readings | None, position: OutputPort | None, contacts: OutputPort | None
) -> tuple[OutputPort, list[Start]]:
    """[q; v] as the controller gets it, and what has to be started for it; joints' encoders where no `position` is."""
    if readings is None or wiring.scenario.state == "plant":
        return wiring.signals["state"], []
    starts: list[Start] = []
    if wiring.scenario.state == "base_estimator":
        state, start = base_state(wiring, readings, readings.encoder if position is None else position, contacts)
        starts.append(start)
    else:
        state = estimated_state(wiring, readings, contacts)
    wiring.signals["estimated_state"] = state
    return state, starts


def _with_error(wiring: WholeBodyBuilder, torque: OutputPort) -> OutputPort:
    """The torques with the errors on them that the spec asks for."""
    spec, law, builder = wiring.scenario.torque_error, wiring.law, wiring.builder
    if spec is None:
        return torque
    noise = TorqueNoise(law.error, spec.hold, wiring.scenario.seed, spec.scale)
    return total(builder, "erring_torque", torque, behind(builder, "torque_noise", noise))
