"""Columns of a log that are not used although their names suggest that they should be: typos, and other spellings."""

import difflib
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache

from drake_tc.logs.rig import Rig
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES

ALIKE = 0.75
"""Similarity (difflib's ratio) from which two words are taken for one that is misspelt."""
SHORTEST_WORD = 4
"""Letters of a word from which a misspelling can be told from another name: `r_knee` is no typo of `l_knee`."""

SHOWN = 6
"""Names in one sentence; further ones are counted."""

SPELLINGS: Mapping[str, tuple[str, ...]] = {
    "temperature": (
        *("temperature", "temp", "motor temp", "motor temperature", "present temperature", "winding temperature"),
        *("winding temp", "coil temperature", "celsius"),
    ),
    "supply_voltage": (
        *("supply voltage", "supply", "input volts", "input voltage", "present input voltage", "bus voltage", "vbus"),
        *("v bus", "bus volts", "battery voltage", "battery volts", "vbat", "vin", "dc bus voltage", "supply volts"),
    ),
    "enabled": (
        *("enabled", "enable", "torque enable", "torque enabled", "motor enabled", "motor on", "servo on", "torque on"),
        *("drive enabled", "power on", "motors on", "servo enabled", "is enabled"),
    ),
}
"""Common names of three channels that a log often has and a rig file often forgets, as words in small letters."""
_MEANS = {"temperature": "a temperature", "supply_voltage": "a supply voltage", "enabled": "a switch of the drive"}


def column_hints(
    names: Sequence[str], found: Mapping[str, str], rig: Rig, switches: Collection[str]
) -> tuple[str, ...]:
    """One sentence for each column that seems to be meant and is not used, and for each misspelt sensor.

    Args:
        names: Columns of the log.
        found: Canonical name to the column of the log that is used for it.
        rig: The rig.
        switches: Columns of the log that say when the drive is on.
    """
    notes = [_sensor_hint(canonical, name, rig) for canonical, name in found.items()]
    used = {*found.values(), *switches}
    for name in names:
        if name not in used:
            notes.append(_typo(name, found, rig) or _spelling(name, found, rig, switches))
    told = tuple(note for note in notes if note)
    known = (*rig.joints, *rig.robot_sensors)
    mapped = {name for canonical, name in found.items() if canonical.rpartition("/")[0] in known}
    rest = [name for name in names if name not in mapped and not any(repr(name) in note for note in told)]
    return (*told, *_strangers(rest, rig))


def _strangers(names: Iterable[str], rig: Rig) -> tuple[str, ...]:
    """One sentence on the canonical columns of joints and sensors that the rig does not have."""
    owners: dict[str, None] = {}
    for name in names:
        owner, _, suffix = name.rpartition("/")
        of_sensor = owner.startswith(("ft_", "imu_")) and suffix in SENSOR_SUFFIXES
        if owner and (of_sensor or suffix in JOINT_SUFFIXES) and owner not in (*rig.joints, *rig.robot_sensors):
            owners[owner] = None
    if not owners:
        return ()
    known = (*rig.joints, *rig.robot_sensors)
    unknown, there = (_listed(list(each)) for each in (owners, known))
    return (f"Columns of {unknown} are not used: the rig has {there}.",)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def same_but_misspelt(name: str, known: str) -> bool:
    """Whether `name` is `known` with one or more misspelt words, another case or another separator."""
    words, right = _words(name), _words(known)
    if len(words) != len(right):
        return False
    wrong = [(a, b) for a, b in zip(words, right, strict=True) if a != b]
    return all(
        min(len(a), len(b)) >= SHORTEST_WORD
        and re.sub(r"\D", "", a) == re.sub(r"\D", "", b)
        and difflib.SequenceMatcher(None, a, b).ratio() >= ALIKE
        for a, b in wrong
    )


@lru_cache(maxsize=2**17)
def _words(name: str) -> tuple[str, ...]:
    """`ft_Right/fx`, `ftRight.fx` and `ft right fx` are the words ft, right, fx."""
    split = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return tuple(word.lower() for word in re.split(r"[^0-9A-Za-z]+", split) if word)


def _sensor_hint(canonical: str, name: str, rig: Rig) -> str:
    """For a column of an F/T sensor or IMU that the robot does not have, but nearly."""
    owner = canonical.rpartition("/")[0]
    if not owner.startswith(("ft_", "imu_")) or owner in rig.robot_sensors:
        return ""
    meant = next((sensor for sensor in rig.robot_sensors if same_but_misspelt(owner, sensor)), "")
    if not meant:
        return ""
    return f"Column {name!r} is not used: the robot has no sensor {owner!r}; did you mean {meant!r}?"


def _typo(name: str, found: Mapping[str, str], rig: Rig) -> str:
    """For a column whose name is nearly that of a canonical one that the log lacks."""
    canonical = (f"{joint}/{suffix}" for joint in rig.joints for suffix in JOINT_SUFFIXES)
    sensors = (
        f"{sensor}/{suffix}"
        for sensor in rig.robot_sensors
        for suffix in SENSOR_SUFFIXES
        if suffix.startswith(("gyro", "accel")) == sensor.startswith("imu_")
    )
    for known in (*canonical, *sensors):
        if known not in found and same_but_misspelt(name, known):
            return f"Column {name!r} is not used; did you mean {known!r}?"
    return ""


def _spelling(name: str, found: Mapping[str, str], rig: Rig, switches: Collection[str]) -> str:
    """For a column that looks like a temperature, a supply voltage or a switch of the drive."""
    joints, words = _without_joint(name, rig.joints)
    for suffix, spellings in SPELLINGS.items():
        if words not in spellings:
            continue
        missing = [joint for joint in joints if f"{joint}/{suffix}" not in found]
        if not missing or (suffix == "enabled" and switches):
            return ""
        of_all = suffix == "enabled" and missing == list(rig.joints)
        entry = f"enabled: {name}" if of_all else f"columns: {{{missing[0]}/{suffix}: {name}}}"
        return f"Column {name!r} looks like {_MEANS[suffix]} and is not used; `{entry}` in the rig file would use it."
    return ""


def _without_joint(name: str, joints: Sequence[str]) -> tuple[Sequence[str], str]:
    """The joints that the column can be of, and the words of its name without the joint's."""
    words = _words(name)
    for joint in joints:
        own = _words(joint)
        for rest in (words[len(own) :], words[: -len(own)]):
            if rest and (own + rest == words or rest + own == words):
                return (joint,), " ".join(rest)
    return joints, " ".join(words)
