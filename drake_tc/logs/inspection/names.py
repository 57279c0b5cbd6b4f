"""From the name of a column to the quantity and the joint that it seems to be of."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from drake_tc.logs.unit_names import at_the_end, is_unit, unit_named
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES

DUTY_CYCLE = ("duty", "duty_cycle", "pwm", "pwm_duty")
"""Names of a voltage that is stated as a share of the supply voltage."""
QUANTITIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "position": (
            *("position", "pos", "q", "qpos", "angle", "ang", "theta", "actual_q", "present_position", "encoder"),
            *("joint_position", "joint_pos", "q_actual", "q_meas", "measured_position", "state_position", "phi"),
            *("present_pos", "actual_pos", "enc", "encoder_position", "encoder_pos", "encoder_angle"),
        ),
        "position_command": (
            *(
                "position_command",
                "position_cmd",
                "pos_cmd",
                "pos_command",
                "cmd_pos",
                "command",
                "cmd",
                "target",
                "setpoint",
                "goal",
            ),
            *("q_ref", "q_d", "q_des", "q_cmd", "q_target", "target_q", "desired_position", "position_desired"),
            *("goal_position", "position_reference", "reference", "ref", "desired", "target_position", "position_ref"),
            *("position_target", "theta_ref", "theta_des", "action", "pos_ref", "pos_des", "pos_target", "target_pos"),
            *("goal_pos", "desired_pos"),
        ),
        "velocity": (
            *("velocity", "vel", "dq", "qd", "speed", "omega", "actual_qd", "present_velocity", "q_dot", "qvel"),
            *("joint_velocity", "rpm", "dtheta", "theta_dot", "qdot"),
        ),
        "current": (
            *("current", "cur", "amps", "amp", "i", "iq", "motor_current", "present_current", "actual_current"),
            *("i_q", "i_meas", "current_a", "motor_current_a", "actual_i"),
        ),
        "voltage": (
            *("voltage", "volts", "volt", "u", "motor_voltage", "v_motor", "applied_voltage", "u_motor"),
            *DUTY_CYCLE,
        ),
        "torque": (
            *("torque", "tau", "trq", "tq", "joint_torque", "measured_torque", "torque_sensor", "tau_meas", "moment"),
            *("load_torque", "tau_ext", "torque_meas", "torque_nm"),
            *("force", "load_cell", "loadcell", "force_sensor", "measured_force", "load_force", "axial_force"),
        ),
        "torque_command": (
            *("torque_command", "torque_cmd", "tau_cmd", "tau_des", "tau_d", "desired_torque", "target_torque"),
            *("force_command", "force_cmd", "force_des", "force_ref", "commanded_force", "desired_force"),
            *("effort_command", "effort", "eff", "commanded_torque", "tau_ref", "torque_des", "torque_ref"),
        ),
        "current_command": ("current_des", "current_cmd", "current_command", "current_ref", "i_des", "i_ref", "i_cmd"),
        "velocity_command": ("velocity_command", "vel_cmd", "cmd_vel", "dq_ref", "dq_des", "velocity_ref", "qd_des"),
        "motor_position": ("motor_position", "motor_pos", "motor_angle", "q_motor", "theta_m", "rotor_position"),
        "temperature": ("temperature", "temp", "motor_temp", "motor_temperature", "present_temperature"),
        "supply_voltage": (
            *("supply_voltage", "vbus", "bus_voltage", "battery_voltage", "input_voltage", "input_volts", "vbat"),
            *("v_bat", "v_bus", "v_supply", "vsupply"),
        ),
        "time": ("time", "t", "timestamp", "stamp", "time_s", "secs", "seconds", "time_ms", "t_s", "time_stamp", "ts"),
    }
)
"""Quantity to the words, joined by '_' in small letters, that columns of it are called."""
_BY_WORDS = {words: quantity for quantity, names in QUANTITIES.items() for words in names}
_NOISE = (
    "joint",
    "joints",
    "state",
    "states",
    "actual",
    "meas",
    "measured",
    "data",
    "observation",
    "value",
    "link",
    "ticks",
    "counts",
    "raw",
)
"""Words that name neither a joint nor a quantity, where others do."""
_IN_BRACKETS = re.compile(r"(.+?)[\s_]*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*")
_AT_THE_END = at_the_end()


@dataclass(frozen=True)
class Meaning:
    """What a column seems to be.

    Attributes:
        joint: Its name; empty for the time, and where the column names none.
        quantity: A key of `QUANTITIES`.
        by: The words that told.
        unit: That the name states, as rig files write it; empty where it states none.
        unknown_unit: What the name states in its place: a unit, but none that a rig file may name for the quantity.
        unit_by: What states the unit.
    """

    joint: str
    quantity: str
    by: str
    unit: str = ""
    unknown_unit: str = ""
    unit_by: str = "its name"


def words(name: str) -> list[str]:
    """The words of a name: split at separators, at changes of case, and before numbers in brackets.

    `q_ref[2]` -> q, ref, 2; `JointPos.hip` -> Joint, Pos, hip; `joint_1/pos` -> joint, 1, pos.
    """
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return [word for word in re.split(r"[^0-9A-Za-z]+", spaced) if word]


def meaning(name: str) -> Meaning | None:
    """What a column seems to be; None where nothing tells.

    A canonical name means itself, and so does the owner before a slash. Otherwise the longest run of words that is
    called like a quantity tells it, at the end of the name before the beginning; what is left names the joint. A unit
    of that quantity at the end of a name, as in `knee_deg` or `current [mA]`, is no part of the joint's name.
    """
    for form in (_IN_BRACKETS, _AT_THE_END):
        found = form.fullmatch(name)
        told = None if found is None else _meaning(found[1])
        if found is not None and told is not None and told.quantity != "time":
            unit = unit_named(found[2], told.quantity)
            if unit:
                return replace(told, unit=unit)
            if form is _IN_BRACKETS and is_unit(found[2]):
                return replace(told, unknown_unit=found[2])
    return _meaning(name)


def with_unit(told: Meaning | None, stated: str) -> Meaning | None:
    """A meaning, with the unit that a line below the names states; one in the name itself goes first."""
    if told is None or told.unit or told.quantity == "time" or not stated:
        return told
    unit = unit_named(stated, told.quantity)
    other = "" if unit or not is_unit(stated) else stated
    return replace(told, unit=unit, unknown_unit=other, unit_by="line 2 of the file")


def _meaning(name: str) -> Meaning | None:
    """What a name that states no unit seems to mean."""
    owner, _, suffix = name.rpartition("/")
    if owner and (suffix in JOINT_SUFFIXES or (suffix in SENSOR_SUFFIXES and owner.startswith(("imu_", "ft_")))):
        return Meaning(owner, suffix, suffix)
    if owner and (quantity := _BY_WORDS.get("_".join(words(suffix)).lower())) is not None:
        return Meaning(owner, quantity, suffix)
    parts = _split_numbers(words(name))
    best: tuple[int, int, int] | None = None
    for first in range(len(parts)):
        for end in range(first + 1, len(parts) + 1):
            if "_".join(parts[first:end]).lower() in _BY_WORDS and (best is None or (end - first, end) > best[:2]):
                best = (end - first, end, first)
    if best is None:
        return None
    _, end, first = best
    told = "_".join(parts[first:end]).lower()
    rest = parts[:first] + parts[end:]
    named = [word for word in rest if word.lower() not in _NOISE] or rest
    return Meaning("" if _BY_WORDS[told] == "time" else _joint(named, rest), _BY_WORDS[told], told)


def _split_numbers(parts: Iterable[str]) -> list[str]:
    """`q1` -> q, 1 where `q` is called like a quantity; `joint1` stays."""
    result: list[str] = []
    for part in parts:
        found = re.fullmatch(r"([A-Za-z]+)(\d+)", part)
        result += [found[1], found[2]] if found and found[1].lower() in _BY_WORDS else [part]
    return result


def _joint(named: list[str], rest: list[str]) -> str:
    """`1` of `joint 1` is `joint_1`; words are joined by '_'."""
    if named and all(word.isdigit() for word in named):
        return "joint_" + "_".join(named)
    return "_".join(named if named != rest or not rest else rest)
