"""From a table as the file has it to canonical columns in SI units, still on the file's own rows.

Columns that are not used although their names suggest that they should be, by typos or other spellings, are told.
"""

import difflib
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.config.files import is_file
from drake_tc.errors import LogError
from drake_tc.logs.files.bag_joined import undecided_topics
from drake_tc.logs.files.csv_file import ENDINGS, first_line
from drake_tc.logs.files.table_forms import MISSING
from drake_tc.logs.names import LINE_BELOW, meaning, stated_unit
from drake_tc.logs.rig import Rig
from drake_tc.logs.rig_document.declared import require_own_unit
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, is_unit, parse_unit, scale_of, unit_named
from drake_tc.types import BoolArray, FloatArray

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
    """One sentence for each column that seems to be meant and is not used, and for each misspelt sensor."""
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


DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
"""A number as programs write it in countries with a decimal comma."""
EFFORTS = ("effort", "eff")
"""Words behind which drivers put currents, torques or loads; a rig file has to say which."""
OFF = ("off", "false", "no", "disabled")
"""Words of a column that says when the drive is off."""
LARGEST = 1e12
"""No reading is as large, in whatever unit; times may be, as nanoseconds since 1970."""


@dataclass(frozen=True)
class RawLog:
    """Canonical columns on the rows of the file.

    Attributes:
        path: The file.
        rows: (T,) row number in the file of each sample, from 1 for the first data row.
        time: (T,) [s], as recorded; NaN where the file has none.
        columns: Canonical name to (T,) SI values, NaN where the file has none.
        enabled: (T,) False where the drive was off.
        valid: (T,) False where the rig's `valid` forbids the use of a sample.
        notes: What was done so far.
        hints: Those of them that point out a column which seems to be meant and is not used.
        speed_only: Joints of which the file has the velocity and no position.
        units: By canonical name, the SI units that the file states and the rig file does not.
    """

    path: Path
    rows: FloatArray
    time: FloatArray
    columns: Mapping[str, FloatArray]
    enabled: BoolArray
    valid: BoolArray
    notes: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    speed_only: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


def file_row(path: Path, index: int) -> str:
    """How messages name a data row: counted from 1, with the line of a text file (the header is line 1)."""
    text = path.name.lower().endswith(ENDINGS) and is_file(path)
    return f"row {index + 1}" + (f" (file line {index + first_line(path)})" if text else "")


def seconds_of_dates(series: pd.Series) -> FloatArray:
    """(T,) seconds since the first date; NaN where there is none."""
    stamps = series.to_numpy(dtype="datetime64[ns]")
    known = stamps[~np.isnat(stamps)]
    first = known[0] if known.size else np.datetime64(0, "ns")
    return np.asarray((stamps - first) / np.timedelta64(1, "s"), dtype=np.float64)


def _numeric(table: pd.DataFrame, name: str, canonical: str, path: Path) -> FloatArray:
    """One column as floats; infinities, and numbers beyond `LARGEST`, count as missing."""
    series = table[name]
    if pd.api.types.is_complex_dtype(series):
        raise LogError(f"{path}: column {name!r} ({canonical}) holds complex numbers; expected real ones")
    if pd.api.types.is_bool_dtype(series) or pd.api.types.is_numeric_dtype(series):
        values = series.to_numpy(dtype=np.float64, na_value=np.nan)
    elif pd.api.types.is_datetime64_any_dtype(series):
        values = seconds_of_dates(series)
    else:
        text = series.astype("string").str.strip()
        parsed = pd.to_numeric(text, errors="coerce")
        missing = text.isna() | text.str.fullmatch(MISSING)
        bad = np.flatnonzero((parsed.isna() & ~missing.fillna(True)).to_numpy(dtype=bool))
        if bad.size:
            shown = str(text.iloc[int(bad[0])])[:40]
            comma = DECIMAL_COMMA.fullmatch(shown) is not None
            remedy = "write numbers with a decimal point" if comma else "mend or remove what is not a number"
            if canonical == "time" and not comma and bad.size == len(table):
                remedy = "write seconds, or dates as 2026-03-04T10:11:12.005"
            raise LogError(
                f"{path}: column {name!r} ({canonical}) is not numeric: {file_row(path, int(bad[0]))} holds {shown!r}"
                f" ({bad.size} such row{'s' if bad.size > 1 else ''}); {remedy}"
            )
        values = parsed.to_numpy(dtype=np.float64, na_value=np.nan)
    values = np.array(values, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        readings = np.isfinite(values) if canonical == "time" else np.abs(values) < LARGEST
    values[~readings] = np.nan
    return values


def _missing(table: pd.DataFrame, requested: str, canonical: str, path: Path) -> LogError:
    """The refusal for a column that is not there, with near matches and what the file has."""
    if topics := table.attrs.get("undecided", {}).get(requested):
        return LogError(f"{path}: {undecided_topics(requested, canonical, topics)}")
    have = [str(name) for name in table.columns]
    lowered = {name.lower(): name for name in have}
    tail = requested.rsplit("/", 1)[-1].lower()
    close = difflib.get_close_matches(requested.lower(), list(lowered), n=3, cutoff=0.6)
    close += [name for name in lowered if tail in name and name not in close]
    hint = f"; near matches: {', '.join(repr(lowered[name]) for name in close[:3])}" if close else ""
    shown = ", ".join(have[:20]) + (f", ... ({len(have)} in all)" if len(have) > 20 else "")
    known_as = "" if requested == canonical else f" (for {canonical})"
    same = [name for name in have if name.lower() == tail]
    remedy = f"map it in the rig file: columns: {{{canonical}: {same[0] if len(same) == 1 else 'NAME_IN_FILE'}}}"
    if canonical in ("enabled", "valid"):
        remedy = f"correct the key `{canonical}` of the rig file"
    return LogError(f"{path}: no column {requested!r}{known_as}{hint}; columns here: {shown}; {remedy}")


def _candidates(rig: Rig, table: pd.DataFrame) -> dict[str, str]:
    """Canonical name to the file's name, for every canonical column that the file has or the rig names.

    Of what a joint of the rig needs, `<joint>.pos` stands for `<joint>/position`, and so do the other common words.
    """
    names = {str(name) for name in table.columns}
    found = dict(rig.columns)
    found.pop("enabled", None)
    claimed = set(found.values())
    for joint in rig.joints:
        for suffix in JOINT_SUFFIXES:
            canonical = f"{joint}/{suffix}"
            if canonical in names and canonical not in claimed:
                found.setdefault(canonical, canonical)
        found.pop(f"{joint}/enabled", None)
    needed = {name for joint in rig.joints for name in rig.required_columns(joint)} - set(found)
    for name in names - claimed if needed else ():
        told = meaning(name) if name.rpartition(".")[0] in rig.joints else None
        if told is not None and f"{told.joint}/{told.quantity}" in needed and told.by not in EFFORTS:
            found.setdefault(f"{told.joint}/{told.quantity}", name)
    for name in names:
        owner, _, suffix = name.rpartition("/")
        if owner.startswith(("imu_", "ft_")) and suffix in SENSOR_SUFFIXES:
            found.setdefault(name, name)
    return found


def _is_speed_only(joint: str, found: Mapping[str, str], rig: Rig) -> bool:
    """Whether the velocity stands for the position, which neither the drive nor the load torque may depend on."""
    free = rig.drive[joint] != "position_servo" and rig.load[joint] == "torque"
    return free and f"{joint}/position" not in found and f"{joint}/velocity" in found


def _why_not_speed_only(joint: str, rig: Rig) -> str:
    """Why a velocity does not stand for the position of this joint."""
    if rig.drive[joint] == "position_servo":
        return "a velocity does not replace it, because a position servo's effort is computed from the position"
    return "a velocity replaces it only with load: torque"


def _enabled(table: pd.DataFrame, rig: Rig, path: Path) -> tuple[BoolArray, list[str]]:
    """Where every drive of the rig is on, by the rig's `enabled` column or the canonical ones, and these columns."""
    requested = [rig.enabled] if rig.enabled is not None else []
    requested += [name for key, name in rig.columns.items() if key.rsplit("/", 1)[-1] == "enabled"]
    for name in requested:
        if name not in table.columns:
            raise _missing(table, name, "enabled", path)
    requested += [name for name in ("enabled", *(f"{j}/enabled" for j in rig.joints)) if name in table.columns]
    on = np.ones(len(table), dtype=bool)
    for name in requested:
        values = table[name]
        if pd.api.types.is_bool_dtype(values):
            on &= values.to_numpy(dtype=bool)
        elif pd.api.types.is_numeric_dtype(values):
            on &= np.nan_to_num(_numeric(table, name, "enabled", path)) != 0
        else:
            text = values.astype("string").str.strip().str.lower()
            on &= ~text.isin([*OFF, "0", "0.0", ""]).to_numpy(bool)
    return on, requested


def _valid(table: pd.DataFrame, rig: Rig, path: Path) -> BoolArray:
    """Where all of the rig's conditions hold."""
    holds = np.ones(len(table), dtype=bool)
    for condition in rig.valid:
        if condition.column not in table.columns:
            raise _missing(table, condition.column, "valid", path)
        holds &= condition.holds(_numeric(table, condition.column, "valid", path))
    return holds


def _stated_in_file(canonical: str, name: str, table: pd.DataFrame) -> tuple[str, str, str]:
    """What the file states in the name of a column, what below it, and the unit that this is; empty where none."""
    suffix = canonical.rpartition("/")[2]
    below = str(table.attrs.get("units", {}).get(name, ""))
    in_name = "" if name == canonical else stated_unit(name, suffix)
    return in_name, below, in_name or unit_named(below, suffix)


def _unit_of_file(canonical: str, name: str, table: pd.DataFrame, path: Path) -> str:
    """The SI unit that the file states for a column of which the rig file states none; empty if it states none."""
    in_name, below, unit = _stated_in_file(canonical, name, table)
    by = str(table.attrs.get("units_by", LINE_BELOW))
    told = None if name == canonical else meaning(name)
    unknown = told.unknown_unit if told is not None and not unit else ""
    where, stated = ("its name", in_name or unknown) if in_name or unknown else (by, below)
    scale = parse_unit(canonical, unit) if unit else None
    if stated and (scale.factor != 1.0 or scale.offset != 0.0 if scale else unknown or is_unit(stated)):
        remedy = f"{{{canonical}: {unit}}}" if unit else f"{{{canonical}: FACTOR}}, the factor to SI units"
        raise LogError(
            f"{path}: column {name!r} ({canonical}): {where} states the unit {stated!r}, and the rig file"
            f" states none, which means SI; write units: {remedy}"
        )
    return unit


def _contradiction(canonical: str, name: str, stated: str, rig: Rig) -> list[str]:
    """A sentence, where the rig file names another unit for a column than the file; a factor is the user's own."""
    own = next(rig.units[key] for key in (canonical, canonical.rpartition("/")[2]) if key in rig.units)
    if not isinstance(own, str) or abs(parse_unit(canonical, own).factor) == parse_unit(canonical, stated).factor:
        return []
    return [
        f"Column {name!r} ({canonical}): the file states the unit {stated!r}, and the rig file {own!r}; that of the rig"
        " file is used."
    ]


def map_columns(table: pd.DataFrame, rig: Rig, path: Path) -> RawLog:
    """Canonical columns in SI units from a table in the file's own names and units.

    Required: `time` and the rig's `required_columns` of each joint. Optional canonical columns are taken where they
    are; an optional column without a single number is left out with a note. Where drive and load do not depend on the
    position, a velocity is enough in its place.

    Raises:
        LogError: A column that is missing, not numeric, or empty although it is needed.
    """
    found = _candidates(rig, table)
    speed_only = tuple(joint for joint in rig.joints if _is_speed_only(joint, found, rig))
    in_place = {f"{joint}/position": f"{joint}/velocity" for joint in speed_only}
    needed = (name for joint in rig.joints for name in rig.required_columns(joint))
    required = ["time", *(in_place.get(name, name) for name in needed), *rig.required_sensor_columns()]
    for canonical in required:
        found.setdefault(canonical, canonical)
    for canonical, name in found.items():
        if name not in table.columns:
            refusal = _missing(table, name, canonical, path)
            joint = canonical.removesuffix("/position")
            if joint in rig.joints and canonical not in rig.columns and f"{joint}/velocity" in found:
                raise LogError(f"{refusal}; {_why_not_speed_only(joint, rig)}")
            raise refusal
    columns: dict[str, FloatArray] = {}
    stated: dict[str, str] = {}
    notes, contradictions = [], list[str]()
    for canonical, name in found.items():
        values = _numeric(table, name, canonical, path)
        if np.isnan(values).all():
            if canonical in required:
                raise LogError(
                    f"{path}: column {name!r} ({canonical}) holds no number at all; record it or map another"
                )
            notes.append(f"Column {name!r} holds no number and was left out.")
            continue
        if (joint := canonical.rpartition("/")[0]) in rig.joints:
            try:
                require_own_unit(canonical, rig.joint_type(joint), rig.units)
            except ValueError as error:
                raise LogError(f"{path}: {error}") from None
        scale = scale_of(canonical, rig.units)
        if scale.stated and not {canonical, canonical.rpartition("/")[2]} & set(rig.units):
            unit = _stated_in_file(canonical, name, table)[2]  # goes before that of the joint's position
            scale, stated = (parse_unit(canonical, unit), stated | {canonical: unit}) if unit else (scale, stated)
        elif not scale.stated:
            unit = _unit_of_file(canonical, name, table, path)
            stated |= {canonical: unit} if unit else {}
        elif other := _stated_in_file(canonical, name, table)[2]:
            contradictions += _contradiction(canonical, name, other, rig)
        if scale.factor != 1.0 or scale.offset != 0.0:
            values = values * scale.factor + scale.offset
        columns[canonical] = values
    time = columns.pop("time")
    rows = np.arange(1, len(table) + 1, dtype=np.float64)
    enabled, switches = _enabled(table, rig, path)
    switches += [condition.column for condition in rig.valid]
    own = [str(name) for name in table.columns if name not in table.attrs.get("aside", {})]
    hints = (*table.attrs.get("hints", ()), *contradictions, *column_hints(own, found, rig, switches))
    told = (*table.attrs.get("notes", ()), *notes, *hints)
    return RawLog(path, rows, time, columns, enabled, _valid(table, rig, path), told, hints, speed_only, stated)
