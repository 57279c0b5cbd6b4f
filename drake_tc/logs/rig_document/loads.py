"""The rig file's keys `load`, where the load torque comes from, and `robot`, whose model may give it.

A kind of load is one class here. A robot file is named relative to the rig file.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import AfterValidator, Discriminator, Tag

from drake_tc.config.files import is_file
from drake_tc.config.keys import Keys, Number, PositiveNumber, Ratio, expected, key, one_of
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import RigError
from drake_tc.logs.loads import Load, Pendulum, RobotLoad, RobotMethod, UnknownForm, UnknownLoad
from drake_tc.logs.rig_document.sensors import JointSensorKeys

LoadWord: TypeAlias = Literal["torque", "unknown"]
WORDS: Mapping[LoadWord, str] = {
    "torque": "The column `<joint>/torque` of the log.",
    "unknown": "A pendulum whose inertia, weight, zero and a constant torque are fitted; for a prismatic joint, a mass "
    "and a constant force.",
}
"""Kinds of load that are one word, and what they mean."""


def _by_run(value: object) -> str:
    return "@by_run" if isinstance(value, Mapping) else "@one"


def _not_empty(value: dict[str, float]) -> dict[str, float]:
    if not value:
        raise ValueError("expected {pattern of file names: value}, got {}")
    return value


OneOrByRun: TypeAlias = Annotated[
    Annotated[PositiveNumber, Tag("@one")]
    | Annotated[dict[str, PositiveNumber], AfterValidator(_not_empty), Tag("@by_run")],
    Discriminator(_by_run),
]
"""One value for all runs, or a mapping from patterns of file names to values."""


class PendulumKeys(Keys):
    """A rigid pendulum: τ = inertia · q̈ + mass · g · length · sin(q − zero)."""

    mass: OneOrByRun = key("Mass.", unit="kg", example=1.2, default=..., expected="the mass [kg], a positive number")
    length: OneOrByRun = key(
        "Distance from the axis to the centre of mass.",
        unit="m",
        example=0.3,
        default=...,
        expected="the length [m], a positive number",
    )
    inertia: OneOrByRun | None = key(
        "Moment of inertia about the axis.", unit="kg m²", example=0.12, absent="mass · length² (a point mass)"
    )
    zero: Number = key("Joint position at which it hangs straight down.", unit="rad", example=0.05, default=0.0)

    def load(self) -> Load:
        """The load that the rest of the library uses."""
        given = {"mass": self.mass, "length": self.length, "inertia": self.inertia}
        by_file = {name: value for name, value in given.items() if isinstance(value, Mapping)}
        if not by_file:
            return self._of(given)
        first, patterns = next(iter(by_file)), list(next(iter(by_file.values())))
        for name, value in by_file.items():
            if set(value) != set(patterns):
                raise ValueError(
                    f"load.pendulum.{name}: expected the same file names as in {first} ({', '.join(patterns)}), got "
                    f"{', '.join(value)}"
                )
        runs = [
            (pattern, self._of({n: by_file[n][pattern] if n in by_file else v for n, v in given.items()}))
            for pattern in patterns
        ]
        return replace(runs[0][1], by_run=tuple(runs))

    def _of(self, values: Mapping[str, Any]) -> Pendulum:
        return Pendulum(zero=self.zero, **{name: value for name, value in values.items() if value is not None})


class PendulumLoad(Keys):
    """A known pendulum; no torque column is needed."""

    pendulum: PendulumKeys = key(
        "A rigid pendulum of known mass and length.",
        example={"mass": 1.2, "length": 0.3},
        default=...,
        expected="{mass:, length:}",
    )

    def load(self) -> Load:
        """The load that the rest of the library uses."""
        return self.pendulum.load()


class ModelLoad(Keys):
    """The model of the robot that the key `robot` names. It must be the load of all joints of the rig."""

    robot: Annotated[RobotMethod, one_of(get_args(RobotMethod))] = key(
        "`estimate`: from encoders, IMU and all six columns of every F/T sensor. `inverse_dynamics`: without F/T "
        "sensors, for a robot that touches nothing beyond its base. `fitted`: the same for a fixed base, with the "
        "links' inertial parameters fitted together with the joints' models.",
        example="estimate",
        default=...,
        expected=" | ".join(get_args(RobotMethod)),
    )
    tolerance: Ratio | None = key(
        "With `fitted`: standard deviation of a link's mass over that mass. Centres of mass and moments of inertia "
        "follow with the link's size.",
        unit="-",
        example="20 %",
        absent="1 (100 %)",
    )
    drive_gain_tolerance: Ratio | None = key(
        "With `fitted`: relative standard deviation of the declared drive gains, all together, which fix the scale of "
        "all torques. The gains are held; the intervals contain it.",
        unit="-",
        example="5 %",
        absent="0 (exact)",
    )
    unknown_payload: list[str] = key(
        "With `fitted`: names of the logs, without their endings, in which `payload_link` carries an unknown load. Its "
        "ten inertial parameters are fitted for each of these logs.",
        example=["run_with_load"],
        default=[],
        absent="no log",
    )
    payload_link: str | None = key(
        "Link, moved by a joint, that carries the unknown load.",
        example="wrist_3_link",
        absent="the only outermost link; required where there are several",
    )

    def load(self) -> Load:
        """The load that the rest of the library uses."""
        given = {} if self.tolerance is None else {"tolerance": self.tolerance}
        given |= {} if self.drive_gain_tolerance is None else {"gain_tolerance": self.drive_gain_tolerance}
        return RobotLoad(self.robot, payload=tuple(self.unknown_payload), carrier=self.payload_link or "", **given)


class FittedLoad(Keys):
    """A load of which only the form is known; it is fitted together with the joint's model."""

    unknown: Annotated[UnknownForm, one_of(get_args(UnknownForm))] = key(
        "`pendulum`: the same as the word `unknown`. `smooth`: an inertia and a smooth function of the position. Only "
        "a declared `drive_gain` (for `smooth`, also a declared rotor inertia) fixes the scale of the torques; without "
        "it they are in the unit of the effort.",
        example="smooth",
        default=...,
        expected=" | ".join(get_args(UnknownForm)),
    )

    def load(self) -> Load:
        """The load that the rest of the library uses."""
        return "unknown" if self.unknown == "pendulum" else UnknownLoad(self.unknown)


KINDS: Mapping[str, type[PendulumLoad | ModelLoad | FittedLoad]] = {
    "pendulum": PendulumLoad,
    "robot": ModelLoad,
    "unknown": FittedLoad,
}
"""The key of each kind of load that has parameters, and its class: it has that one key."""

_SHAPES = (f"{{{name}: {expected(kind.model_fields[name])}}}" for name, kind in KINDS.items())
POSSIBLE = f"{', '.join(map(repr, WORDS))} or {' or '.join(_SHAPES)}"


def _kind(value: object) -> str | None:
    if isinstance(value, Mapping):
        named = [name for name in value if name in KINDS]
        return f"@{named[0]}" if len(named) == 1 else None
    return "@word" if value in get_args(LoadWord) else None


LoadEntry: TypeAlias = Annotated[
    Annotated[LoadWord, Tag("@word")]
    | Annotated[PendulumLoad, Tag("@pendulum")]
    | Annotated[ModelLoad, Tag("@robot")]
    | Annotated[FittedLoad, Tag("@unknown")],
    Discriminator(_kind, custom_error_type="load", custom_error_message=f"expected {POSSIBLE}"),
]


def load_of(entry: LoadWord | PendulumLoad | ModelLoad | FittedLoad | None) -> Load:
    """The load that an entry means; the torque column where there is none."""
    if entry is None:
        return "torque"
    return entry if isinstance(entry, str) else entry.load()


def parse_robot(source: str, value: object, rig: Path | str) -> Path | None:
    """The robot file, or None where the rig names none.

    Raises:
        RigError: Not a file's name, or no such file.
    """
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise RigError(f"{source}: robot: expected the name of a robot file (YAML), got {quoted(value)}")
    path = Path(value) if not isinstance(rig, Path) else rig.parent / value
    if not is_file(path):
        raise RigError(f"{source}: robot: no such robot file: {path}")
    return path


def robot_joints(source: str, robot: Path) -> list[str]:
    """The driven joints that the robot file lists.

    Raises:
        RigError: The file cannot be read, or lists none.
    """
    try:
        document = read_yaml(robot, "robot file (YAML)", RigError)
    except RigError as error:
        raise RigError(f"{source}: robot: {error}") from None
    joints = document.get("joints") if isinstance(document, Mapping) else None
    if not isinstance(joints, list) or not joints:
        raise RigError(f"{source}: robot: {robot} has no `joints`; expected a robot file, or `joints` in the rig file")
    return [str(joint) for joint in joints]


def check_robot_load(source: str, load: Mapping[str, Load], robot: Path | None, *, coupled: bool) -> None:
    """A robot's model gives the loads of all joints of the rig, or of none; with coupled gears, of all.

    Raises:
        RigError: Only some joints take it, or no robot file is named.
    """
    taken = [joint for joint, entry in load.items() if isinstance(entry, RobotLoad)]
    if taken and robot is None:
        raise RigError(f"{source}: load: {{robot: ...}} requires the key `robot: FILE`")
    if coupled and not taken:
        raise RigError(f"{source}: coupled: requires load: {{robot: ...}}, which gives the torques of all joints")
    if taken and (len(taken) < len(load) or len({load[joint] for joint in taken}) > 1):
        others = [joint for joint in load if joint not in taken] or taken[1:]
        raise RigError(f"{source}: load: {{robot: ...}} must be the load of all joints; {others[0]!r} has another one")


def check_joint_tolerances(
    source: str,
    everywhere: JointSensorKeys,
    sensors: Mapping[str, JointSensorKeys],
    load: Mapping[str, Load],
    drive: Mapping[str, str],
) -> None:
    """A torque sensor that the rig file describes for one joint by its name is there, and an effort is that of a drive.

    Raises:
        RigError: The joint's load does not come from a torque sensor, or the joint (of what is said of all joints:
            every joint) has another kind of drive.
    """
    every = set(drive.values())
    for at, entry, kinds in (("", everywhere, every), *((f" {j}:", e, {drive[j]}) for j, e in sensors.items())):
        for name, kind in entry.drives.items():
            if kind not in kinds:
                raise RigError(
                    f"{source}: sensors:{at} {name}: this tolerance goes with drive: {kind}; got drive: "
                    f"{', '.join(sorted(kinds))}"
                )
    for joint, entry in sensors.items():
        if entry.torque is not None and load[joint] != "torque":
            raise RigError(
                f"{source}: sensors: {joint}: torque: the joint has no torque sensor; tolerances of one go with "
                f"load: torque"
            )


def robot_sensors(robot: Path | None) -> tuple[str, ...]:
    """`imu_<name>` and `ft_<name>` of the robot file's sensors; none where it cannot be read (others say so)."""
    if robot is None:
        return ()
    try:
        document = read_yaml(robot, error=RigError)
    except RigError:
        return ()
    found = []
    for section, prefix in (("imu", "imu_"), ("force_torque", "ft_")):
        entries = document.get(section) if isinstance(document, Mapping) else None
        found += [f"{prefix}{name}" for name in entries] if isinstance(entries, Mapping) else []
    return tuple(found)


def check_sensors(
    source: str, declared: Iterable[str], known: Sequence[str], robot: Path | None, key: str = "sensors"
) -> None:
    """Every sensor that the rig file names under `key` is one of the robot file.

    Raises:
        RigError: It is not; with the nearest match.
    """
    for column in declared:
        if column not in known:
            listed = (
                "a sensor needs `robot: FILE`" if robot is None else f"sensors of {robot}: {', '.join(known) or 'none'}"
            )
            raise RigError(
                f"{source}: {key}: {column}: the robot has no such sensor{did_you_mean(column, known)}; {listed}"
            )
