"""From the name of a column to the quantity and the joint that it seems to be of."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, is_known, is_unit, spelled_in_names, unit_named

DUTY_CYCLE = ("duty", "duty_cycle", "pwm", "pwm_duty")
"""Names of a voltage that is stated as a share of the supply voltage."""
QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        "position": (
            "position pos q qpos angle ang theta actual_q present_position encoder joint_position joint_pos q_actual"
            " q_meas measured_position state_position phi present_pos actual_pos enc encoder_position encoder_pos"
            " encoder_angle posn winkel lage"
        ),
        "position_command": (
            "position_command position_cmd pos_cmd pos_command cmd_pos command cmd target setpoint goal q_ref q_d"
            " q_des q_cmd q_target target_q desired_position position_desired goal_position position_reference"
            " reference ref desired target_position position_ref position_target theta_ref theta_des action actions"
            " pos_ref pos_des pos_target target_pos goal_pos desired_pos input_pos"
        ),
        "velocity": (
            "velocity vel dq qd speed omega actual_qd present_velocity q_dot qvel joint_velocity joint_vel rpm dtheta"
            " theta_dot qdot spd velo ang_vel angular_velocity motor_velocity motor_speed motor_vel geschwindigkeit"
            " drehzahl"
        ),
        "current": (
            "current cur amps amp i iq motor_current present_current actual_current i_q i_meas current_a"
            " motor_current_a actual_i curr q_axis q_axis_current strom q_current current_q"
        ),
        "voltage": "voltage volts volt u motor_voltage v_motor applied_voltage u_motor spannung voltage_q q_voltage",
        "torque": (
            "torque tau trq tq joint_torque measured_torque torque_sensor tau_meas moment momenten load_torque tau_ext"
            " torque_meas torque_nm tor torq tau_measured drehmoment tau_j tau_sensor sensor_torque link_torque force"
            " load_cell loadcell force_sensor measured_force load_force axial_force"
        ),
        "torque_command": (
            "torque_command torque_cmd tau_cmd tau_des tau_d desired_torque target_torque force_command force_cmd"
            " force_des force_ref commanded_force desired_force effort_command effort eff commanded_torque tau_ref"
            " torque_des torque_ref tau_j_d input_torque applied_torque computed_torque motor_torque torque_motor"
            " tau_motor motor_tau"
        ),
        "enabled": (
            "enabled enable torque_enable torque_enabled motor_enabled motor_on servo_on torque_on drive_enabled"
            " servo_enabled is_enabled motors_on"
        ),
        "current_command": "current_des current_cmd current_command current_ref i_des i_ref i_cmd",
        "velocity_command": "velocity_command vel_cmd cmd_vel dq_ref dq_des velocity_ref qd_des dq_d input_vel",
        "motor_position": (
            "motor_position motor_pos motor_angle q_motor theta_m rotor_position theta_motor motor_theta phi_motor"
            " motor_encoder encoder_motor rotor_angle rotor_pos"
        ),
        "temperature": "temperature temp motor_temp motor_temperature present_temperature temperatur",
        "supply_voltage": (
            "supply_voltage vbus bus_voltage battery_voltage input_voltage input_volts vbat vbus_voltage v_bat v_bus"
            " v_supply vsupply u_dc v_dc vdc dc_voltage dc_bus_voltage dc_link_voltage"
        ),
        "time": (
            "time t timestamp stamp time_s secs seconds time_ms t_s time_stamp ts zeit tout micros millis elapsed"
            " elapsed_time"
        ),
    }
)
"""Quantity to what columns of it are called, between blanks: words in small letters, joined by '_'."""
_BY_WORDS = {words: quantity for quantity, names in QUANTITIES.items() for words in names.split()}
_BY_WORDS |= dict.fromkeys(DUTY_CYCLE, "voltage")
_KNOWN = {word for words in _BY_WORDS for word in words.split("_")}
SHORTEST = 3
"""Letters from which the word of a quantity may stand behind another word (`actpos`) or, with one more, be a plural."""
COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "position": "position_command",
        "velocity": "velocity_command",
        "torque": "torque_command",
        "current": "current_command",
        "voltage": "voltage",
    }
)
"""What is measured, and what is commanded of it; the command of a voltage is the voltage."""
_BASE = {command: quantity for quantity, command in COMMANDS.items() if command not in JOINT_SUFFIXES}
"""Commands that are no columns of a rig file, and what they command."""
_COMMANDED = (
    *("cmd", "command", "commanded", "des", "desired", "ref", "reference", "target", "tgt", "goal", "setpoint"),
    *("set", "soll", "requested", "request", "demand", "dmd", "action", "control", "traj"),
    "trajectory",
)
"""Words that turn a quantity into its command, as in `tau_command` and `posDes`."""
_MEASURED = (
    *("act", "actual", "meas", "measured", "present", "feedback", "fb", "fbk", "ist", "est", "estimate", "estimated"),
)
"""Words that say only that a quantity was measured or observed, as in `torAct`."""
_NOISE = (
    *("joint", "joints", "state", "states", "data", "observation", "obs", "value", "link", "ticks", "counts", "raw"),
    *("field", "wert", "dof"),
)
"""Words that name neither a joint nor a quantity, where others do."""
_ROLES = ("dynamic", "state", "states", "data", "sensor", "sensors", "observation", "obs", "joints", "controller")
"""Words of what holds the joints, which name none."""
_DERIVED = ("error", "errors", "err", "diff", "delta", "residual", "predicted", "expected")
"""Words of what is made from signals of a joint."""
_NO_JOINT = (
    *("ee", "eef", "tcp", "endeffector", "effector", "cartesian", "pose"),  # coordinates of a tool
    *("error", "err", "diff", "delta", "limit", "lim", "min", "max", "std", "var", "cov", "integral", "offset", "bias"),
    *("gravity", "friction", "inertia", "coriolis", "feedforward", "ff", "model", "predicted", "expected", "residual"),
    *("kp", "ki", "kd", "gain", "profile"),
    *("disabled", "disable", "off", "mode", "flag", "fault", "reached", "valid", "index", "idx", "number"),  # states
)
"""Words of columns that hold no signal of a joint although they have a word of a quantity: made from signals, say."""
_OTHERS = ("d_axis", "i_d", "id", "d_current", "current_d", "tau_g", "in_position")
"""Names of the current that makes no torque, of the torque of gravity, and of a switch."""
_NO_MOTOR = ("bus", "battery", "batt", "supply", "phase", "board", "cpu", "mcu", "fet", "ambient", "room")
"""Words of a current or temperature that is not that of a motor."""
_BY_UNIT = ("current", "voltage", "torque", "velocity", "position", "temperature")
"""Quantities that a unit may tell where the name does not, or tells another one."""
_IN_BRACKETS = re.compile(r"(.+?)[\s_]*([\[(])\s*([^\[\]()]+?)\s*[\])]\s*")
_BEHIND_A_SLASH = re.compile(r"(.+?)\s*/\s*\(?([^\s/()]+(?:/[^\s/()]+)?)\)?\s*")
"""A unit as ISO 80000 writes it, `I / A`."""
_APART = r"(?:[\s_.\-]+|(?-i:(?<=[a-z])(?=[A-Z])))"
_AT_THE_END = re.compile(rf"(.+?){_APART}({spelled_in_names()})", re.IGNORECASE)
"""A unit after a separator or in camel case: the name before it, and the unit."""
_BEHIND = r"(?:[\s_]*[\[(]?(\d+)[\])]?|"
_IN_BRACKETS_BEFORE = re.compile(rf"(.+?)[\s_]*[\[(]\s*([^\[\]()]+?)\s*[\])]{_BEHIND}[\s_.\-]*(\w.*))")
_BEFORE = re.compile(rf"(?:(.+?){_APART})?({spelled_in_names()}){_BEHIND}{_APART}(\w.*))", re.IGNORECASE)
"""A unit before a number or other words, `tau_mNm_0`, `pos [deg] knee` and `deg_pos`."""
_PARTS_OF_NAMES = ("lb", "n", "rev", "turn")
"""Units that are no units before other words: `lb_hip_torque` is of a leg on the left."""
_GREEK = str.maketrans({"φ": "phi", "ϕ": "phi", "θ": "theta", "ϑ": "theta", "ω": "omega", "τ": "tau"})
_GERMAN = re.compile(r"(?<![a-z])(?:soll|ist)(?=[a-z]{4})|(?<=[a-z]{3})(?:soll|ist)(?=wert)", re.IGNORECASE)
"""In a compound such as `Sollposition` or `Lageistwert`."""


@dataclass(frozen=True)
class Meaning:
    """What a column seems to be.

    Attributes:
        joint: Its name; empty for the time, and where the column names none.
        quantity: A key of `QUANTITIES`.
        by: The words that told; empty where the unit told.
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

    @property
    def told_by(self) -> str:
        """What told the quantity, in words."""
        return f"known name {self.by!r}" if self.by else "recognised by its unit"


def words(name: str) -> list[str]:
    """The words of a name: split at separators, at changes of case, and before numbers in brackets.

    `q_ref[2]` -> q, ref, 2; `JointPos.hip` -> Joint, Pos, hip; `joint_1/pos` -> joint, 1, pos.
    """
    apart = _GERMAN.sub(r" \g<0> ", name.translate(_GREEK))
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", apart)
    return [word for word in re.split(r"[^0-9A-Za-z]+", spaced) if word]


def meaning(name: str) -> Meaning | None:
    """What a column seems to be; None where nothing tells.

    A canonical name means itself, and so does the owner before a slash or a dot (`elbow_joint.pos`). Otherwise the
    longest run of words that is called like a quantity tells it, at the end of the name before the beginning; what is
    left names the joint. A unit that the name states is no part of the joint's name, and it decides where the words
    tell another quantity: `q-axis [A]` is a current.
    """
    name = _with_brackets(name)
    found = _IN_BRACKETS.fullmatch(name)
    if found is not None:
        told = _meaning(found[1])
        unit = "" if told is None else _unit(found[3], told.quantity)
        if told is not None and unit:
            return replace(told, unit=unit)
        if found[2] == "[" or is_unit(found[3]):
            by_unit = _of_unit(found[1], told, found[3])
            if by_unit is not None:
                return by_unit
        of_time = told is not None and told.quantity == "time" and not found[3].isdigit()
        if told is not None and (of_time or is_unit(found[3])):
            return replace(told, unknown_unit=found[3])
    found = _AT_THE_END.fullmatch(name)
    if found is not None:
        told = _meaning(found[1])
        unit = "" if told is None else _unit(found[2], told.quantity)
        if told is not None and unit:
            return replace(told, unit=unit)
        if told is None and len(found[2]) > 1 and (by_unit := _of_unit(found[1], told, found[2])) is not None:
            return by_unit
    told = _meaning(name)
    last = words(name)[-1:]
    if told is not None and told.quantity == "time" and last and len(words(name)) > 1:
        return replace(told, unit=unit_named(last[0], "time"))
    return told


def time_among(names: Iterable[str]) -> str | None:
    """The first name that is called like a time; None if there is none."""
    return next((name for name in names if (told := meaning(name)) is not None and told.quantity == "time"), None)


def names_joints(name: str) -> bool:
    """Whether an array or a list of texts with this name holds the names of the joints of those beside it."""
    last = re.split("[/.]", name)[-1].lower()
    return last in ("joint_names", "joints", "names", "name", "joint_name", "jointnames")


def member(name: str, number: int, size: int, joints: Sequence[str]) -> str:
    """What a member of a vector is called: `hip/position` where the vector is one of all joints, else `position_0`."""
    of_joints = len(joints) == size and meaning(name) is not None
    return f"{joints[number]}/{name}" if of_joints else f"{name}_{number}"


def _with_brackets(name: str) -> str:
    """The name with a unit behind a slash, `I / A`, or before a number or other words, in brackets."""
    for form in (_IN_BRACKETS_BEFORE, _BEFORE):
        if (found := form.fullmatch(name)) and is_known(found[2]):
            rest = "_".join(filter(None, (found[1], found[3] or found[4])))
            if (found[1] and found[3]) or (_is_of(rest, found[2]) and found[2].lower() not in _PARTS_OF_NAMES):
                return f"{rest} [{found[2]}]"
    found = _BEHIND_A_SLASH.fullmatch(name)
    if found and (_is_of(found[1], found[2]) or (" /" in name and is_unit(found[2]))):
        return f"{found[1]} [{found[2]}]"
    return name


def _is_of(name: str, unit: str) -> bool:
    """Whether a name without a unit tells a quantity that a text is the unit of."""
    told = _meaning(name)
    return told is not None and bool(_unit(unit, told.quantity))


def _unit(text: str, quantity: str) -> str:
    """The unit of a quantity, or of what it commands, that a text states; empty where it states none of it."""
    return unit_named(text, _BASE.get(quantity, quantity))


def without_unit(name: str) -> str:
    """The name of a column without a unit in brackets or at its end."""
    for form in (_IN_BRACKETS, _AT_THE_END):
        if found := form.fullmatch(_with_brackets(name)):
            return str(found[1])
    return name


def stated_unit(name: str, suffix: str) -> str:
    """The unit of the channel `suffix` that the name of a column states, as rig files write it; empty if none.

    Example:
        >>> stated_unit("knee angle [deg]", "position"), stated_unit("i_mA", "current"), stated_unit("tau", "torque")
        ('deg', 'mA', '')
    """
    name = _with_brackets(name)
    found = _IN_BRACKETS.fullmatch(name)
    if found is not None and (unit := unit_named(found[3], suffix)):
        return unit
    found = _AT_THE_END.fullmatch(name)
    return "" if found is None else unit_named(found[2], suffix)


def _of_unit(name: str, told: Meaning | None, stated: str) -> Meaning | None:
    """What a column seems to be by the unit in its name, of another unit; None where that tells no quantity."""
    parts = [word.lower() for word in words(name)]
    if not parts or any(word in _NO_JOINT for word in parts) or _is_other(parts):
        return None
    if told is None and any(word in _NO_MOTOR for word in parts):
        return None
    if stated.lower() == "hz":  # a rate, unless the name says that it is a velocity
        return None
    quantity = next((each for each in _BY_UNIT if unit_named(stated, each)), None)
    if quantity is None or quantity == (told.quantity if told else ""):
        return None
    unit = unit_named(stated, quantity)
    if any(word in _COMMANDED for word in parts):
        quantity = COMMANDS.get(quantity, quantity)
    known = {*(told.by.split("_") if told else ()), *_MEASURED, *_COMMANDED}
    rest = [word for word in words(name) if word.lower() not in known]
    return Meaning(_joint(_naming(rest)), quantity, "", unit)


def _is_other(parts: Sequence[str]) -> bool:
    text = f"_{'_'.join(parts)}_"
    return any(f"_{each}_" in text for each in _OTHERS)


LINE_BELOW = "line 2 of the file"
"""What states units where the reader of a log names nothing else."""


def with_unit(told: Meaning, stated: str, by: str) -> Meaning:
    """A meaning, with the unit that a file states beside the names; one in the name itself goes first."""
    if told.unit or not stated:
        return told
    unit = unit_named(stated, told.quantity)
    if told.quantity == "time":
        return replace(told, unit=unit, unit_by=by) if unit else told
    other = "" if unit or not is_unit(stated) else stated
    return replace(told, unit=unit, unknown_unit=other, unit_by=by)


def _meaning(name: str) -> Meaning | None:
    """What a name that states no unit seems to mean."""
    owner, _, suffix = name.rpartition("/")
    if owner.startswith(("imu_", "ft_")) and suffix in SENSOR_SUFFIXES:
        return Meaning(owner, suffix, suffix)
    if not owner:
        owner, _, suffix = name.rpartition(".")
    owner, suffix = owner.strip(), suffix.strip()
    *above, last = re.split(r"(?=[/.])", owner)
    if _is_motion(_singular(last.strip("/.").lower())) and suffix.lower() in (*_COMMANDED, "q"):
        owner, suffix = "".join(above), f"{last.strip('/.')}_{suffix}"  # `knee/velocity/target` is no position
    if suffix in JOINT_SUFFIXES and "/" in name:
        return _of_owner(owner, Meaning("", suffix, suffix))
    if owner and (told := _of_words(words(suffix))) is not None and told.quantity != "time":
        if not told.joint:
            return _of_owner(owner, replace(told, by=suffix))
        if re.fullmatch(r"joint_\d+", told.joint):
            return _of_owner(owner, told)
    return _of_words(words(name))


def _of_owner(owner: str, told: Meaning) -> Meaning | None:
    """The meaning of a quantity of an owner, whose parts between slashes and dots name the joint or a role.

    `goal_position/knee`, `command.knee` and `motor_cmd[3]` say that the quantity is commanded, `joint_states/knee` and
    `measured/knee` that it is not; what is made from signals, as `error/knee`, is None. A quantity with a number is a
    member of the owner's vector: `left/position_2` is of the joint `left_2`.
    """
    parts = [part for part in re.split(r"[/.]", owner) if part]
    said = [_singular(word.lower()) for part in parts for word in _owner_words(part)]
    if any(word in _DERIVED for word in said):
        return None
    measured = any(word.lower() in _MEASURED for word in words(told.by))
    commanded = not measured and any(word in _COMMANDED for word in said)
    named = [_without_roles(part) for part in parts if "/" in owner or part.lower() not in _NOISE]
    joint = "/".join(filter(None, named))
    quantity = COMMANDS.get(told.quantity, told.quantity) if commanded else told.quantity
    if told.joint:
        return replace(told, joint=told.joint.replace("joint", joint) if joint else told.joint, quantity=quantity)
    return replace(told, joint=joint if joint or commanded else owner, quantity=quantity)


def _without_roles(owner: str) -> str:
    """`motor_3` of `motor_cmd[3]` and of `motor_state[3]`, nothing of `goal_position`; other owners as they are."""
    parts = _owner_words(owner)
    roles = {*_COMMANDED, *_MEASURED, *_ROLES}
    kept = [word for word in parts if roles.isdisjoint((word.lower(), _singular(word.lower())))]
    if kept == parts:
        return owner
    return _joint([word for word in kept if word.lower() not in _NOISE and _singular(word.lower()) not in COMMANDS])


def _owner_words(owner: str) -> list[str]:
    """The words of an owner; `lowcmd` and `lowstate` are two words each."""
    return [each for word in words(owner) for each in re.sub(r"(?i)(?<=\w)(cmd|state)$", r" \1", word).split()]


def _of_words(said: Sequence[str]) -> Meaning | None:
    """What the words of a name seem to mean."""
    said = [word for word, after in pairwise([*said, ""]) if not (word.lower() == "id" and after.isdigit())]
    parts = [each for at, part in enumerate(said) for each in _split(part, said[:at])]
    lower = [_singular(part.lower()) for part in parts]
    if any(word.rstrip("0123456789") in _NO_JOINT for word in lower) or _is_other(lower):
        return None
    span = _longest(lower, _BY_WORDS)
    if span is None:
        return None
    if "_".join(lower[slice(*span)]) in _COMMANDED:  # a command of what another word tells, or of a position
        rest = [word if not span[0] <= at < span[1] else "" for at, word in enumerate(lower)]
        span = _longest(rest, {by: quantity for by, quantity in _BY_WORDS.items() if quantity in COMMANDS}) or span
    first, end = span
    told = "_".join(lower[first:end])
    quantity = _BY_WORDS[told]
    if told.startswith("joint_") and first > 0 and end == len(parts) and "joint" in parts:
        first += 1  # `elbow_joint_pos` is the position of `elbow_joint`
    rest = parts[:first] + parts[end:]
    if quantity in COMMANDS and any(word.lower() in _COMMANDED for word in rest):
        quantity = COMMANDS[quantity]
        words_of_command = [word for word in rest if word.lower() in _COMMANDED]
        told = "_".join([told, *(word.lower() for word in words_of_command)])
        rest = [word for word in rest if word not in words_of_command]
    if quantity == "time":
        return Meaning("", quantity, told)
    rest = [word for word in rest if word.lower() not in _MEASURED]
    if quantity in ("current", "temperature") and any(word.lower() in _NO_MOTOR for word in rest):
        return None
    return Meaning(_joint(_naming(rest)), quantity, told)


def _naming(rest: Sequence[str]) -> list[str]:
    """The words that name a joint; a `joint` behind a name belongs to it, as in `elbow_joint`."""
    kept = [
        word
        for at, word in enumerate(rest)
        if word.lower() not in _NOISE or (word == "joint" and at and rest[at - 1].lower() not in _NOISE)
    ]
    return kept or [word for word in rest if word.lower() in ("joint", "link")]


def _longest(lower: Sequence[str], known: Collection[str]) -> tuple[int, int] | None:
    """The longest run of words that is known, the last one of those."""
    best: tuple[int, int] | None = None
    for first in range(len(lower)):
        for end in range(first + 1, len(lower) + 1):
            longer = best is None or (end - first, end) > (best[1] - best[0], best[1])
            if longer and "_".join(lower[first:end]) in known:
                best = (first, end)
    return best


def _split(part: str, before: Sequence[str] = ()) -> list[str]:
    """`q1` -> q, 1 where `q` is called like a quantity, and `d1` -> d, 1 behind `q`, as `q_d` is called like one.

    So is a word of a role behind a quantity, `pos_des1`. `qdes` -> q, des and `actpos` -> act, pos; `joint1` stays.
    """
    if found := re.fullmatch(r"([A-Za-z]+)(\d+)", part):
        name, last = _split(found[1]), _singular(found[1].lower())
        told = any("_".join([*before[at:], last]).lower() in _BY_WORDS for at in range(len(before) + 1))
        told |= last in (*_COMMANDED, *_MEASURED) and any(word.lower() in _BY_WORDS for word in before)
        return [*name, found[2]] if len(name) > 1 or told else [part]
    lower = _singular(part.lower())
    if lower in _KNOWN:
        return [part]
    for said in (*_COMMANDED, *_MEASURED):
        if lower.endswith(said) and _is_motion(lower.removesuffix(said)):
            return [part[: -len(said)], said]
        if lower.startswith(said) and len(rest := lower.removeprefix(said)) >= SHORTEST and _is_motion(rest):
            return [said, part[len(said) :]]
    return [part]


def _is_motion(word: str) -> bool:
    return _BY_WORDS.get(word) in COMMANDS


def _singular(word: str) -> str:
    """`velocity` of `velocities`, where it is a word of a quantity; other words as they are."""
    one = f"{word[:-3]}y" if word.endswith("ies") else word.removesuffix("s")
    return one if word not in _KNOWN and len(word) > SHORTEST and one in _KNOWN else word


def _joint(named: Sequence[str]) -> str:
    """`1` of `joint 1` is `joint_1`; words are joined by '_'."""
    if named and all(word.isdigit() for word in named):
        return "joint_" + "_".join(named)
    return "_".join(named)
