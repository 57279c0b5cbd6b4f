# ruff: noqa: E501  (one row of the table a line)
"""Arms whose links are known or fitted, their drives, encoders and loads, and gross errors of their set-up."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import fitted_arm
import numpy as np
import yaml
from fitted_arm import COULOMB, GAIN, JOINTS, KNOWN, PAYLOAD, PERIOD, PLACE, ROTOR, URDF, VISCOUS, torques
from robot_files import joint_tag, link_tag, urdf, write_robot

from drake_tc.robot.robot import Robot, load_robot

from .. import small_robot
from .case import ANY, NULL, RED, Case, Is, Record, Recorded

Columns = dict[str, np.ndarray]
Change = Callable[[Columns, int], Columns]


@dataclass(frozen=True)
class Arm:
    """What is recorded of the arm of three joints: its true links, those of its file, loads by run, ages [s]."""

    true: str = URDF
    file: str = URDF
    payloads: Sequence[float] = ()
    late: tuple[float, float, float] = (0.0, 0.0, 0.0)
    behind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: float = fitted_arm.NOISE
    base: str = "base"


def armed(arm: Arm = Arm(), change: Change | None = None, train: int = 2, held: int = 1, **rig: Any) -> Record:
    """Logs of the arm; `change` is done to the columns of each run by its number, `rig` replaces keys (None: without)."""

    def write(folder: Path, seed: int) -> Recorded:
        (folder / "true").mkdir()
        robot = load_robot(write_robot(folder / "true", arm.true, JOINTS, base=arm.base))
        write_robot(folder, arm.file, JOINTS)
        logs = []
        for number in range(train + held):
            load = arm.payloads[number] if arm.payloads else 0.0
            name = f"run_{number}" + ("_loaded" if load and arm.payloads.count(0.0) else "")
            before, fitted_arm.NOISE = fitted_arm.NOISE, arm.noise
            logs.append(fitted_arm.record(folder, robot, name, 10 * seed + number, load, arm.late, arm.behind))
            fitted_arm.NOISE = before
            if change is not None:
                np.savez(logs[-1], **change(dict(np.load(logs[-1])), number))
        return Recorded(rig_file(folder, fitted_arm.RIG | rig), logs[:train], logs[train:])

    return write


def rig_file(folder: Path, document: Mapping[str, Any]) -> Path:
    path = folder / "rig.yaml"
    path.write_text(
        yaml.safe_dump({key: value for key, value in document.items() if value is not None}), encoding="utf-8"
    )
    return path


def friction(within: float = 0.01, joints: Sequence[str] = JOINTS) -> dict[str, float | Is]:
    """Viscous and Coulomb friction of the arm's joints."""
    truth = {f"{j}/viscous.viscous": v for j, v in zip(JOINTS, VISCOUS.tolist(), strict=True)}
    truth |= {f"{j}/coulomb.coulomb": c for j, c in zip(JOINTS, COULOMB.tolist(), strict=True)}
    return {key: Is(value, within) for key, value in truth.items() if key.partition("/")[0] in joints}


def factors(**by: float) -> Change:
    """Columns, their slash written as two underscores, by factors."""
    return lambda columns, number: (
        columns | {k.replace("__", "/"): f * columns[k.replace("__", "/")] for k, f in by.items()}
    )


def shifted(joint: str, offset: float) -> Change:
    return lambda columns, number: columns | {f"{joint}/position": columns[f"{joint}/position"] + offset}


def speed(columns: Columns, joint: str) -> np.ndarray:
    return np.asarray(np.gradient(columns[f"{joint}/position"], columns["time"]))


def added(joint: str, torque: Callable[[Columns], np.ndarray]) -> Change:
    """A torque [N m] that the drive overcomes besides."""
    by = float(GAIN[JOINTS.index(joint)])
    return lambda columns, number: columns | {f"{joint}/current": columns[f"{joint}/current"] + by * torque(columns)}


def offsets(size: Sequence[float]) -> Change:
    """Zeros of the currents, as torques [N m]."""

    def change(columns: Columns, number: int) -> Columns:
        return columns | {
            f"{j}/current": columns[f"{j}/current"] + g * o for j, g, o in zip(JOINTS, GAIN, size, strict=True)
        }

    return change


PER_EFFORT = 0.01
"""A servo's position error [rad] for each ampere."""


def as_servos(columns: Columns, number: int, age: float = 0.0, quadratic: float = 0.0) -> Columns:
    """The log of current drives as one of position servos whose commands act `age` periods after they are recorded."""
    for gain, joint in zip(GAIN, JOINTS, strict=True):
        effort = columns.pop(f"{joint}/current")
        if joint == JOINTS[-1]:
            v = speed(columns, joint)
            effort = effort + gain * quadratic * v * np.abs(v)
        command = columns[f"{joint}/position"] + PER_EFFORT * effort
        at = np.arange(command.size)
        columns[f"{joint}/position_command"] = np.interp(at + age, at, command)
    return columns


def as_torques(columns: Columns, number: int) -> Columns:
    """The log of current drives as one of drives that are commanded in torque."""
    for gain, joint in zip(GAIN, JOINTS, strict=True):
        columns[f"{joint}/torque_command"] = columns.pop(f"{joint}/current") / gain
    return columns


def mended(text: str, old: str, new: str) -> str:
    if old not in text:
        raise ValueError(f"no {old!r} in the URDF")
    return text.replace(old, new)


LIGHTER = URDF
for old, new in (
    ('mass value="4"', 'mass value="3"'),
    ('mass value="2"', 'mass value="1.4"'),
    ('mass value="1.2"', 'mass value="0.8"'),
):
    LIGHTER = mended(LIGHTER, old, new)
SERVO_GAINS = {joint: PER_EFFORT * gain for joint, gain in zip(JOINTS, GAIN.tolist(), strict=True)}
OFFSETS, TOLERANCE = (0.4, -0.5, 0.25), 0.4
ZEROS = {joint: {"current": {"bias": gain * TOLERANCE}} for joint, gain in zip(JOINTS, GAIN.tolist(), strict=True)}
SERVOS = {"drive": "position_servo", "drive_gain": SERVO_GAINS}
DRAG = {"fold/quadratic_viscous": {"quadratic_viscous": Is(0.8, 0.1)}}
OPEN = ANY - NULL
FITTED = [
    Case("robots: fitted links, nothing is missing", armed(), values=friction()),
    Case("robots: fitted links whose file is a third too light", armed(Arm(file=LIGHTER)), values=friction(0.03)),
    Case("robots: fitted links and an unknown payload",
         armed(Arm(payloads=(0.0, 0.0, PAYLOAD, 0.0)), lambda columns, number: columns, train=3,
               load=fitted_arm.RIG["load"] | {"unknown_payload": ["run_2_loaded"]}),
         values=friction() | {"run_2_loaded.m": PAYLOAD}),
    Case("robots: zeros of currents within tolerance beside wrong links", armed(Arm(file=LIGHTER), offsets(OFFSETS), sensors=ZEROS), seeds=(0, 1)),
    Case("robots: commands of servos and an effect of one joint", armed(change=lambda c, n: as_servos(c, n, 0.0, 0.8), train=3, **SERVOS), DRAG,
         values=friction(0.1, JOINTS[:2])),
    Case("robots: held commands of servos and an effect of one joint", armed(change=lambda c, n: as_servos(c, n, 0.5, 0.8), train=3, **SERVOS), DRAG,
         values=friction(0.1, JOINTS[:2])),
    Case("robots: servos of unknown gain", armed(change=as_servos, drive="position_servo", drive_gain=None), values=friction(0.3)),
    Case("robots: fitted links beside drives that are commanded in torque", armed(change=as_torques, drive="torque", drive_gain=None),
         values=friction(0.03) | {f"{joint}/drive.gain": Is(1.0, 1e-3) for joint in JOINTS}),
    Case("robots: wrong links beside drives that are commanded in torque",
         armed(Arm(file=LIGHTER), as_torques, drive="torque", drive_gain=None),
         values={f"{joint}/drive.gain": Is(1.0, 1e-3) for joint in JOINTS}),
    Case("robots: a delay of all joints is named once", armed(Arm(late=(0.02, 0.02, 0.02))), {"delay@all joints": {"delay": Is(0.02, 0.0, 1e-3)}}),
    Case("robots: a delay of one joint is its own", armed(Arm(late=(0.0, 0.02, 0.0))), {"lift/delay": {}}, verdicts=ANY),
    Case("robots: efforts that are all logged late", armed(Arm(late=(-0.018, -0.018, -0.018))), values=friction(0.02)),
    Case("robots: a late encoder is told by the other joints", armed(Arm(behind=(0.0, 0.03, 0.0))), {"delay@lift": {"delay": Is(0.03, 0.0, 1e-3)}}),
    Case("robots: a quadratic friction of the first joint", armed(change=added("turn", lambda c: 3.0 * speed(c, "turn") * np.abs(speed(c, "turn")))),
         {"turn/quadratic_viscous": {"quadratic_viscous": Is(3.0, 0.1)}}, verdicts=OPEN),
    Case("robots: a payload link that nobody knows is refused",
         armed(load=fitted_arm.RIG["load"] | {"unknown_payload": ["run_1"], "payload_link": "four"}),
         refusal="payload_link: no joint of the robot moves a link 'four'.*'fore'.*links: column, boom, fore"),
    Case("robots: an unknown payload of a run that is not there is refused",
         armed(load=fitted_arm.RIG["load"] | {"unknown_payload": ["run_7"]}), refusal="no log 'run_7'"),
    Case("robots: a negative tolerance of the links is refused", armed(load={"robot": "fitted", "tolerance": -0.1}), refusal="tolerance"),
]  # fmt: skip

# ---- a small arm with a sliding joint, a floating base, an F/T sensor and an IMU: what its rig file is refused for


def small(rig: str, without: str = "") -> Record:
    """The small arm hangs still; the logs lack one column."""

    def write(folder: Path, seed: int) -> Recorded:
        small_robot.write_robot(folder)
        (folder / "rig.yaml").write_text(rig, encoding="utf-8")
        names = [f"{joint}/{what}" for joint in ("turn", "push", "bend") for what in ("position", "position_command")]
        names += [f"imu_chest/{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
        names += [f"ft_wrist/{axis}" for axis in ("fx", "fy", "fz", "tx", "ty", "tz")]
        logs = [folder / f"run_{number}.npz" for number in range(3)]
        for number, path in enumerate(logs):
            rng = np.random.default_rng([seed, number])
            columns = {name: 1e-3 * rng.standard_normal(400) for name in names if name != without}
            np.savez(path, time=1e-3 * np.arange(400), **columns)
        return Recorded(folder / "rig.yaml", logs[:2], logs[2:])

    return write


SMALL = [
    Case(f"robots: {name} is refused", small(rig, without), refusal=refusal) for name, rig, without, refusal in (
        ("a robot file that is not there", "{robot: nothing.yaml, drive: current}", "", "no such robot file"),
        ("a robot's load without a robot", "{joint: turn, drive: current, load: {robot: estimate}}", "", "requires the key `robot: FILE`"),
        ("an unknown kind of a robot's load", "{robot: arm.yaml, drive: current, load: {robot: guess}}", "", "expected one of estimate, inverse_dynamics"),
        ("a robot's load of some joints", "{robot: arm.yaml, drive: current, load: {turn: torque, push: {robot: estimate}}}", "", "of all joints"),
        ("a robot without a column of its F/T sensor", "{robot: arm.yaml, drive: position_servo}", "ft_wrist/ty", "no column 'ft_wrist/ty'"),
        ("a stretch without samples for zeroing", "{robot: arm.yaml, drive: position_servo, sensors: {ft_wrist: {tare: [2.0, 4.0]}}}", "",
         "ft_wrist: tare: no usable stretch of more than .* 2 and 4 s"),
        ("a floating base whose links are fitted", "{robot: arm.yaml, drive: position_servo, load: {robot: fitted}}", "", "got a floating one"),
    )
]  # fmt: skip

# ---- links that are taken as the file has them


def known(arm: Arm = Arm(), change: Change | None = None, train: int = 2, **rig: Any) -> Record:
    return armed(arm, change, train, **KNOWN | rig)


TOOL = 0.25
TOOLED = {"mass": Is(TOOL, 0.05)} | {
    f"com_{axis}": Is(float(at), 0.0, 0.02) for axis, at in zip("xyz", PLACE, strict=True)
}
KNOWN_LINKS = [
    Case("robots: known links, nothing is missing", known(), seeds=(0, 1)),
    Case("robots: noisy currents beside known links", known(Arm(noise=0.8), train=3, drive_gain={}), verdicts=NULL | RED,
         values={f"{joint}/drive.gain": Is(gain, 0.03) for joint, gain in zip(JOINTS, GAIN.tolist(), strict=True)}),
    Case("robots: the zero of the lift's encoder", known(change=shifted("lift", 0.03)), {"encoder_offset@lift": {"offset": Is(0.03, 0.02)}}),
    Case("robots: the zero of the last encoder", known(change=shifted("fold", 0.03)), {"encoder_offset@fold": {"offset": Is(0.03, 0.02)}}),
    Case("robots: a larger zero of the lift's encoder", known(change=shifted("lift", 0.06)), {"encoder_offset@lift": {"offset": Is(0.06, 0.02)}}),
    Case("robots: the zero of an encoder within tolerance", known(change=shifted("lift", 0.03), sensors={"encoder": {"offset": "1 deg"}})),
    Case("robots: a centre of mass along the last link", known(Arm(true=mended(URDF, 'xyz="0.15 0.01 0"', 'xyz="0.19 0.01 0"'))),
         {"link_com@fore": {"com_x": Is(0.04, 0.0, 0.005)}}),
    Case("robots: a tool in all logs", known(Arm(payloads=(TOOL,) * 3)), {"payload@fore": TOOLED}, seeds=(0, 1)),
    Case("robots: a wrong mass of the last link", known(Arm(true=mended(URDF, 'mass value="1.2"', 'mass value="1.45"'))), {"link_mass@fore": {"mass": Is(0.25, 0.05)}}),
    Case("robots: a wrong mass of an inner link", known(Arm(true=mended(URDF, 'mass value="2"', 'mass value="2.4"'))), {"link_mass@boom": {}}),
]  # fmt: skip

# ---- link-side torques of an arm, one joint of which has a ripple of 1 N m


def felt(ripple: float, torque_noise: float, step: float, cycles: float = 24.0) -> Record:
    """Each joint's torque is measured on the link's side; `lift` has a ripple [N m]."""

    def write(folder: Path, seed: int) -> Recorded:
        robot = load_robot(write_robot(folder, URDF, JOINTS))
        logs = []
        for number in range(3):
            rng, time = np.random.default_rng([seed, number]), np.arange(0.0, 20.0, 5e-3)
            omega = 2.0 * np.pi * np.array([0.15, 0.35, 0.8]) * rng.uniform(0.9, 1.1, (3, 3))
            angle, size = (
                time[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, (3, 3)),
                np.array([0.5, 0.3, 0.08]),
            )
            q, v, a = np.sin(angle) @ size, (np.cos(angle) * omega) @ size, (-np.sin(angle) * omega**2) @ size
            load = torques(robot, q, v, a, 0.0)
            need = load + ROTOR * a + VISCOUS * v + COULOMB * np.tanh(v / 1e-3)
            need[:, 1] += ripple * np.sin(cycles * q[:, 1])
            columns = {"time": time}
            for k, joint in enumerate(JOINTS):
                columns[f"{joint}/position"] = np.round(q[:, k] / step) * step
                columns[f"{joint}/torque"] = load[:, k] + torque_noise * rng.standard_normal(time.size)
                columns[f"{joint}/current"] = GAIN[k] * (need[:, k] + 0.02 * rng.standard_normal(time.size))
            logs.append(folder / f"run_{number}.npz")
            np.savez(logs[-1], **columns)
        declared = {joint: {"rotor_inertia": rotor} for joint, rotor in zip(JOINTS, ROTOR.tolist(), strict=True)}
        rig = {"joints": list(JOINTS), "drive": "current", "load": "torque", "declared": declared}
        return Recorded(rig_file(folder, rig), logs[:2], logs[2:])

    return write


RIPPLED = (frozenset({"lift/torque_ripple"}), frozenset[str]())
FELT = [
    Case("robots: link-side torques, nothing is missing", felt(0.0, 0.05, 1e-5)),
    Case("robots: link-side torques, a ripple of 1 N m", felt(1.0, 0.05, 1e-5), {"lift/torque_ripple": {"cycles_per_turn": Is(24.0, 0.01)}}, RIPPLED, verdicts=OPEN),
    Case("robots: noisy link-side torques, a ripple of 1 N m", felt(1.0, 0.5, 1e-5), {"lift/torque_ripple": {"cycles_per_turn": Is(24.0, 0.01)}}, RIPPLED,
         verdicts=OPEN),
    Case("robots: link-side torques beside coarse encoders, a ripple of 1 N m", felt(1.0, 0.5, 2e-3), {}, RIPPLED, verdicts=OPEN),
    Case("robots: link-side torques beside coarse encoders, nothing is missing", felt(0.0, 0.5, 2e-3), verdicts=NULL | RED),
]  # fmt: skip

# ---- gross errors of the set-up: named with what to change, and no effect beside them

ELBOW = urdf(
    link_tag("column", (0, 0.01, 0.1), 4, (0.05, 0.05, 0.03)),
    link_tag("upper", (0.02, 0, 0.2), 3, (0.03, 0.03, 0.005)),
    link_tag("fore", (0.03, 0.02, 0.1), 2, (0.02, 0.02, 0.004)),
    link_tag("hand", (0.1, 0.02, 0.05), 1.2, (0.004, 0.01, 0.01)),
    joint_tag("turn", "base", "column", axis=(0, 0, 1)),
    joint_tag("lift", "column", "upper", xyz=(0.1, 0, 0.3), axis=(0, 1, 0)),
    joint_tag("roll", "upper", "fore", xyz=(0, 0, 0.35), axis=(0, 0, 1)),
    joint_tag("bend", "fore", "hand", xyz=(0.05, 0, 0.3), axis=(0, 1, 0)),
)
ELBOWS = ("turn", "lift", "roll", "bend")


def elbow(change: Change | None = None, turns: float = 0.0) -> Record:
    """An arm whose axes are not parallel, each drive with 1 A for 1 N m; the motor of `bend` turns with `roll` too."""

    def write(folder: Path, seed: int) -> Recorded:
        robot = load_robot(write_robot(folder, ELBOW, ELBOWS))
        logs = [swung(folder, robot, number, 10 * seed + number, change, turns) for number in range(3)]
        return Recorded(
            rig_file(folder, fitted_arm.RIG | {"drive_gain": dict.fromkeys(ELBOWS, 1.0)}), logs[:2], logs[2:]
        )

    return write


def swung(folder: Path, robot: Robot, number: int, seed: int, change: Change | None, turns: float) -> Path:
    """A run of four sines a joint."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 30.0, PERIOD)
    omega = 2.0 * np.pi * rng.uniform(0.05, 0.5, (4, 4))
    phase = time[:, None, None] * omega + rng.uniform(0.0, 2.0 * np.pi, (4, 4))
    size = 0.3 / (1.0 + omega)
    parts = size * np.sin(phase), size * omega * np.cos(phase), -size * omega**2 * np.sin(phase)
    q, v, a = (part.sum(axis=2) for part in parts)
    load = torques(robot, q, v, a, 0.0)
    load[:, 2] -= turns * load[:, 3]
    v, a = (np.column_stack([x[:, :3], x[:, 3] + turns * x[:, 2]]) for x in (v, a))
    effort = load + 0.1 * a + 0.5 * v + 0.4 * np.tanh(v / 1e-3) + 0.02 * rng.standard_normal(load.shape)
    columns: Columns = {"time": time} | {f"{joint}/position": q[:, i] for i, joint in enumerate(ELBOWS)}
    columns |= {f"{joint}/current": effort[:, i] for i, joint in enumerate(ELBOWS)}
    path = folder / f"run_{number}.npz"
    np.savez(path, **(columns if change is None else change(columns, number)))
    return path


def columns_of(names: Mapping[str, str]) -> Change:
    """Columns by the name of another one."""
    return lambda columns, number: columns | {name: columns[other] for name, other in names.items()}


def tilted(rpy: str) -> str:
    mount = '<link name="mount"/><joint name="mounting" type="fixed"><parent link="mount"/><child link="base"/>'
    return mended(URDF, "</robot>", f'{mount}<origin rpy="{rpy}"/></joint></robot>')


def uneven(columns: Columns, number: int) -> Columns:
    """A large friction of one direction that depends on the position."""
    forward = speed(columns, "fold") > 0.0
    return columns | {
        "fold/current": columns["fold/current"] + 1.2 * forward * np.abs(np.sin(9.0 * columns["fold/position"]))
    }


def load_loss(columns: Columns, number: int) -> Columns:
    load = columns["lift/current"]
    return columns | {"lift/current": load + 0.4 * np.abs(load) * np.sign(speed(columns, "lift"))}


def set_up(name: str, record: Record, *errors: str, more: frozenset[str] = frozenset()) -> Case:
    return Case(
        f"set-up: {name}",
        record,
        allowed=(frozenset(f"set_up.{error}" for error in errors),),
        extras=more,
        verdicts=RED,
    )


LOADS = (0.0, PAYLOAD, 0.0, 0.0)
EXCHANGED = {
    f"{one}/{part}": f"{other}/{part}"
    for one, other in (("roll", "bend"), ("bend", "roll"))
    for part in ("position", "current")
}
SET_UPS = [
    set_up("a reversed joint", armed(change=factors(fold__position=-1.0, fold__current=-1.0)), "joint_reversed@fold"),
    set_up("a reversed joint, free gains", armed(change=factors(fold__position=-1.0, fold__current=-1.0), drive_gain=None), "joint_reversed@fold"),
    set_up("a reversed position", armed(change=factors(lift__position=-1.0)), "position_reversed@lift"),
    replace(set_up("a reversed effort", armed(change=factors(lift__current=-1.0)), "effort_reversed@lift"), may_refuse="reverse the current"),
    set_up("efforts in mA", armed(change=factors(**{f"{joint}__current": 1e3 for joint in JOINTS})), "drive_gain@turn,lift,fold"),
    set_up("a torque constant of one joint", armed(change=factors(fold__current=2.5)), "drive_gain@fold"),
    *(set_up(f"a torque constant of {joint} by {factor}", elbow(factors(**{f"{joint}__current": factor})), f"drive_gain@{joint}")
      for joint, factor in (("turn", 1.7), ("lift", 0.6), ("lift", 1.3), ("bend", 0.6), ("bend", 1.7))),
    set_up("another zero", elbow(shifted("lift", 0.6)), "zero@lift"),
    set_up("exchanged columns", elbow(columns_of(EXCHANGED)), "columns_exchanged@roll,bend"),
    set_up("exchanged efforts", elbow(columns_of({"roll/current": "bend/current", "bend/current": "roll/current"})), "efforts_exchanged@roll,bend"),
    set_up("two reversed joints", elbow(factors(lift__position=-1.0, lift__current=-1.0, roll__position=-1.0, roll__current=-1.0)), "joint_reversed@lift,roll"),
    set_up("a base on a slope of 35 degrees", armed(Arm(true=tilted(f"{np.radians(35.0)} 0.2 0"), base="mount")), "gravity@"),
    set_up("known links on a slope of 8 degrees", known(Arm(true=tilted(f"0 {np.radians(8.0)} 0"), base="mount")), "gravity@"),
    *(set_up(f"a gear that couples two joints by {turns}", elbow(turns=turns), "coupled@bend,roll") for turns in (0.6, -1.0)),
    set_up("a loaded log among those of the training", armed(Arm(payloads=LOADS), train=3), "payload@run_1_loaded"),
    set_up("a loaded log among those of the training, known links", known(Arm(payloads=LOADS), train=3), "payload@run_1_loaded"),
    set_up("a loaded log that is held out", armed(Arm(payloads=(0.0, 0.0, PAYLOAD))), "payload@run_2_loaded"),
    set_up("a load that the held-out log lacks", armed(Arm(payloads=(PAYLOAD, PAYLOAD, 0.0))), "payload@run_0_loaded,run_1_loaded"),
    set_up("a heavy load in all logs, known links", known(Arm(payloads=(PAYLOAD,) * 4), train=3), "payload@"),
    Case("set-up: a load in all logs is taken up by fitted links", armed(Arm(payloads=(PAYLOAD,) * 3)), verdicts=NULL | RED),
    Case("set-up: right of an arm whose axes are not parallel", elbow()),
    Case("set-up: friction of one direction is none of its errors", armed(change=uneven), never=frozenset({"set_up.drive_gain@fold", "set_up.gravity@"}),
         verdicts=OPEN),
    Case("set-up: friction that grows with the load is no torque constant", elbow(load_loss), {"lift/load_dependent_friction": {}}, verdicts=OPEN),
    Case("set-up: three times the friction in one log is no payload",
         armed(change=lambda c, n: c | {f"{j}/current": c[f"{j}/current"] + 0.3 * (n == 1) * np.tanh(speed(c, j) / 1e-2) for j in JOINTS}, train=3),
         never=frozenset({"set_up.payload@run_1"})),
]  # fmt: skip

CASES = [*FITTED, *SMALL, *KNOWN_LINKS, *FELT, *SET_UPS]
