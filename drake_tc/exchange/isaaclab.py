"""Isaac Lab: a Python file with one actuator configuration a joint.

`ImplicitActuatorCfg` and `DelayedPDActuatorCfg` take stiffness [N m/rad], damping [N m s/rad], armature [kg m^2],
friction and dynamic_friction [N m], viscous_friction [N m s/rad] and a limit of torque [N m]: effort_limit_sim of the
implicit actuator, which the physics engine applies, effort_limit of the delayed one, which computes its torque itself.
Delays are whole physics steps.

A drive on a voltage of known torque constant kt and limit U is a `DCMotorCfg`. Its efforts are torques, and its line of
torque over speed, saturation_effort (1 - v/velocity_limit), is kt/R (U - kt v):

    saturation_effort = kt U/R,   velocity_limit = U/kt,   viscous_friction without the back-EMF
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

from drake_tc.errors import ParamsError
from drake_tc.exchange.dc_motor import dc_motor
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.targets import PHYSICS_STEP
from drake_tc.exchange.xml_text import number
from drake_tc.simulator_files.terms import Terms


def to_isaaclab(projections: Sequence[Projection], into: Path | None = None) -> str:
    """The text of a Python module whose ACTUATORS goes into an ArticulationCfg.

    Args:
        projections: One a joint.
        into: Not possible: a configuration is a program.

    Raises:
        ParamsError: `into` is given.
    """
    names = {_kind(projection.terms) for projection in projections}
    return actuators_module(names, [_entry(projection.joint, projection.terms) for projection in projections], into)


def actuators_module(names: Iterable[str], entries: Sequence[Sequence[str]], into: Path | None) -> str:
    """The text of a Python module with a dictionary ACTUATORS.

    Args:
        names: Of the configuration classes that it imports.
        entries: Lines of each joint's entry.
        into: Not possible: a configuration is a program.

    Raises:
        ParamsError: `into` is given.
    """
    if into is not None:
        raise ParamsError("--into: an Isaac Lab configuration is a program; write a file and import ACTUATORS from it")
    lines = [
        '"""Actuators identified by drake-tc: actuators=ACTUATORS in an ArticulationCfg."""',
        "",
        f"from isaaclab.actuators import {', '.join(sorted(names))}",
        "",
        f"PHYSICS_STEP = {PHYSICS_STEP}  # [s], in which delays are counted",
        "",
        "ACTUATORS = {",
        *(line for entry in entries for line in entry),
        "}",
    ]
    return "\n".join(lines) + "\n"


def delay_fields(terms: Terms) -> dict[str, str]:
    """min_delay and max_delay in physics steps; empty without a delay.

    Args:
        terms: Of the drive.
    """
    steps = str(round(terms.delay / PHYSICS_STEP))
    return {"min_delay": steps, "max_delay": steps} if terms.delay else {}


def _kind(terms: Terms) -> str:
    if terms.delay:
        return "DelayedPDActuatorCfg"
    return "ImplicitActuatorCfg" if dc_motor(terms) is None or terms.torque_limit is None else "DCMotorCfg"


def _entry(joint: str, terms: Terms) -> list[str]:
    servo, kind, motor = terms.drive == "position_servo", _kind(terms), dc_motor(terms)
    fields = {
        "joint_names_expr": f"[{joint!r}]",
        "stiffness": number(terms.kp if servo else 0.0),
        "damping": "0.0",
        "armature": number(terms.armature),
        "friction": number(terms.frictionloss),
        "dynamic_friction": number(terms.frictionloss),
        "viscous_friction": number(terms.damping),
    }
    if terms.torque_limit is not None:
        explicit = kind != "ImplicitActuatorCfg"
        fields["effort_limit" if explicit else "effort_limit_sim"] = number(terms.torque_limit)
        if kind == "DCMotorCfg" and motor is not None:
            voltage = terms.torque_limit / terms.kp
            fields["saturation_effort"] = number(terms.torque_limit)
            fields["velocity_limit"] = number(voltage / motor.torque_constant)
            fields["viscous_friction"] = number(motor.damping)
    fields |= delay_fields(terms)
    efforts = f"{number(terms.kp)} N m for one unit of the drive's command"
    if kind == "DCMotorCfg" and motor is not None:
        efforts = f"{number(terms.kp)} (V - {number(motor.torque_constant)} v) N m at the voltage V and the velocity v"
    note = [] if servo else [f"    # efforts are torques: {efforts}"]
    return [*note, f"    {joint!r}: {kind}(", *(f"        {k}={v}," for k, v in fields.items()), "    ),"]
