"""Isaac Lab: a Python file with one actuator configuration a joint.

`ImplicitActuatorCfg`, `IdealPDActuatorCfg` and `DelayedPDActuatorCfg` take stiffness [N m/rad], damping [N m s/rad],
armature [kg m^2], friction and dynamic_friction [N m], viscous_friction [N m s/rad] and a limit of torque [N m]:
joint_effort_limit of the implicit actuator, which the physics engine applies to the servo of the joint, and
actuator_effort_limit of the others, which compute their torque themselves. An implicit actuator passes efforts on
without a limit, so that a drive with a limit whose command is an effort is an `IdealPDActuatorCfg`. Delays are whole
physics steps. Names of joints are regular expressions.

A drive on a voltage of known torque constant kt and limit U is a `DCMotorCfg`. Its efforts are torques, which it clips
to saturation_effort (+-1 - v/actuator_velocity_limit) and to +-actuator_effort_limit. The first is
kt/R (+-U - kt v) with

    saturation_effort = kt U/R,   actuator_velocity_limit = U/kt,   viscous_friction without the back-EMF

The motor brakes with up to kt/R (U + kt |v|), so that actuator_effort_limit is twice the saturation_effort: the line
of torque over speed alone limits the torque up to the actuator_velocity_limit. With a delay, or without a known torque
constant, the efforts are kt/R V and the back-EMF is a part of viscous_friction: that is the same torque, in an actuator
without this line.

Source: Isaac Lab 3.0.0, `isaaclab.actuators`. Isaac Lab 2.3 has the names effort_limit, effort_limit_sim and
velocity_limit, which 3.0 deprecates. PhysX has all three frictions as torques from Isaac Sim 5.0 on; Newton has no
dynamic friction and warns.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from drake_tc.config.joint_units import JointType, in_units_of
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
    return actuators_module(names, [_entry(each.joint, each.terms, each.joint_type) for each in projections], into)


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


def decimal(value: float) -> str:
    """A number as text of a Python float that reads back within 1e-10.

    Args:
        value: Finite.
    """
    return repr(float(number(value)))


def joint_pattern(joint: str) -> str:
    """joint_names_expr as text: a list of one regular expression, which matches this joint alone.

    Args:
        joint: Its name.
    """
    return f"[{re.escape(joint)!r}]"


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
    if terms.drive == "position_servo" or terms.torque_limit is None:
        return "ImplicitActuatorCfg"
    return "IdealPDActuatorCfg" if dc_motor(terms) is None else "DCMotorCfg"


def _entry(joint: str, terms: Terms, joint_type: JointType = "revolute") -> list[str]:
    servo, kind, motor = terms.drive == "position_servo", _kind(terms), dc_motor(terms)
    fields = {
        "joint_names_expr": joint_pattern(joint),
        "stiffness": decimal(terms.kp if servo else 0.0),
        "damping": "0.0",
        "armature": decimal(terms.armature),
        "friction": decimal(terms.frictionloss),
        "dynamic_friction": decimal(terms.frictionloss),
        "viscous_friction": decimal(terms.damping),
    }
    if terms.torque_limit is not None:
        explicit = kind != "ImplicitActuatorCfg"
        fields["actuator_effort_limit" if explicit else "joint_effort_limit"] = decimal(terms.torque_limit)
        if kind == "DCMotorCfg" and motor is not None:
            voltage = terms.torque_limit / terms.kp
            fields["actuator_effort_limit"] = decimal(2.0 * terms.torque_limit)
            fields["saturation_effort"] = decimal(terms.torque_limit)
            fields["actuator_velocity_limit"] = decimal(voltage / motor.torque_constant)
            fields["viscous_friction"] = decimal(motor.damping)
    fields |= delay_fields(terms)
    efforts = f"{number(terms.kp)} N m for one unit of the drive's command"
    if kind == "DCMotorCfg" and motor is not None:
        efforts = f"{number(terms.kp)} (V - {number(motor.torque_constant)} v) N m at the voltage V and the velocity v"
    told = in_units_of(joint_type, f"    # efforts are torques: {efforts}")
    note = [] if servo else [told.replace("torques", "forces") if joint_type == "prismatic" else told]
    return [*note, f"    {joint!r}: {kind}(", *(f"        {k}={v}," for k, v in fields.items()), "    ),"]
