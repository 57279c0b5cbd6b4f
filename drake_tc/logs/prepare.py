"""From log files to runs: map, check, repair, put on a uniform clock; refuse what cannot be mended.

Every repair and exclusion leaves one sentence in `Run.notes`; every refusal is a `LogError` of one line.
Runs of one rig are of one joint, whose drive gain does not change between them.

A log without a position, as of a motor test stand, gets the integral of its velocity. The integral begins at 0,
wherever the joint really was, so nothing that depends on the absolute position can be told from such a log. Friction,
inertia, drive and torque sensor do not.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_trapezoid

from drake_tc.errors import LogError
from drake_tc.logs import channels
from drake_tc.logs.checks.clock import (
    GAP_PERIODS,
    HELD,
    on_rows_of_positions,
    rows_in_order,
    sampling_instants,
    uniform_clock,
)
from drake_tc.logs.checks.jumps import find_jumps, stepped_clock
from drake_tc.logs.checks.mistaken_columns import (
    TURNED,
    check_torque_unit,
    refuse_exchanged,
    refuse_unsigned,
    sign_evidence,
    wrong_signs,
)
from drake_tc.logs.checks.outliers import without_outliers
from drake_tc.logs.checks.plausible import check_angles, check_speed, check_velocity, lag_notes
from drake_tc.logs.columns import RawLog, map_columns
from drake_tc.logs.files.readers import LogTable, named_logs, read_table, run_name
from drake_tc.logs.loads import Pendulum, RobotLoad
from drake_tc.logs.record import MIN_ROWS, Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import scale_of
from drake_tc.types import BoolArray, FloatArray, IntArray

MOST_APART = 2.0
"""Factor between the ranges of the gains of two runs of one joint."""
PROPORTIONAL = 0.95
"""Partial correlation of effort and load torque above which their ratio is the gain: a drive at its limit has less."""


def _require_one_joint(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse runs whose drive gains are more than a factor of two apart: of another joint, unit or setting.

    With the effort  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  of each run, 1/K of the whole run and of its
    thirds make a range; runs in which the load torque's share of the effort is not clear are not compared. Friction
    may change between runs, but under a measured load it does not drive the joint in one and brake it in another:
    columns are exchanged then.
    """
    for joint in rig.joints:
        found = [(run, sign_evidence(run, rig, joint)) for run in runs]
        driven = [run for run, e in found if e is not None and e.friction < -TURNED]
        measured = rig.load[joint] == "torque"  # a pendulum that is dropped drives its motor
        if measured and driven and any(e is not None and e.friction > TURNED for _, e in found):
            raise LogError(
                f"{driven[0].source or driven[0].name}: friction would drive {joint} in this run, and brakes it in"
                " others; check the signs and the names of its columns"
            )
        steady = [(run, e) for run, e in found if e is not None and e.steady and e.load > PROPORTIONAL]
        clear = [(run, e.gain) for run, e in steady if e.gain[0] > 0.0]
        if len(clear) < 2:
            continue
        lowest = min(clear, key=lambda each: each[1][1])
        highest = max(clear, key=lambda each: each[1][0])
        if highest[1][0] > MOST_APART * lowest[1][1]:
            usual = float(np.median([np.log(sum(gain)) for _, gain in clear]))
            odd, other = sorted((highest, lowest), key=lambda each: -round(abs(np.log(sum(each[1])) - usual), 6))
            unit = rig.units_of(joint).text("N m")
            told = " and ".join(f"{low:.4g} to {high:.4g} in {run.name}" for run, (low, high) in (odd, other))
            raise LogError(
                f"{odd[0].source or odd[0].name}: the runs are not of one {joint}: the effort for 1 {unit} of load is"
                f" {told}; leave out the run of another joint or setting, or state its units"
            )


def _integrated(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """Q (T,) with q[0] = 0 from the velocity (T,) by the trapezoidal rule; missing values are interpolated."""
    known = np.isfinite(velocity)
    filled = velocity if known.all() else np.interp(time, time[known], velocity[known])
    return np.asarray(cumulative_trapezoid(filled, time, initial=0.0))


def _with_positions(raw: RawLog) -> RawLog:
    """The log with a position for every joint in `RawLog.speed_only`."""
    if not raw.speed_only:
        return raw
    columns = dict(raw.columns)
    notes = []
    for joint in raw.speed_only:
        columns[f"{joint}/position"] = _integrated(raw.time, columns[f"{joint}/velocity"])
        notes.append(
            f"The log has no column {joint}/position: the velocity was integrated, so the position at the start is not "
            "known, and effects that depend on the position cannot be looked for."
        )
    return replace(raw, columns=columns, notes=(*raw.notes, *notes))


def _require_alike(runs: Sequence[Run]) -> None:
    """Refuse runs of which some have a position and others the velocity alone."""
    without = {joint for run in runs for joint in run.speed_only}
    for run in runs:
        for joint in sorted(without - set(run.speed_only)):
            other = next(each for each in runs if joint in each.speed_only)
            raise LogError(
                f"{other.source or other.name}: no column '{joint}/position', which {run.source or run.name} has; map "
                "it in the rig file, or diagnose the logs without it by themselves"
            )


FOLLOWS = 0.7
"""Correlation of position and torque of a servo that is moved from its goal, at least: friction hides up to half."""


def _require_live(raw: RawLog, rig: Rig) -> tuple[str, ...]:
    """Refuse a log in which no joint moves, or no moving joint's torque changes; note single joints of that kind."""
    positions = {joint: raw.columns[f"{joint}/position"] for joint in rig.joints}
    resting = [joint for joint, values in positions.items() if _constant(values)]
    if len(resting) == len(positions):
        name = f"{resting[0]}/position"
        raise LogError(
            f"{raw.path}: column {rig.columns.get(name, name)!r} is constant"
            f" ({_value(positions[resting[0]]):.6g} {rig.units_of(resting[0]).position}) in all rows: nothing moves,"
            " or the encoder was not read;"
            " record a motion"
        )
    measured = [joint for joint in rig.joints if rig.load[joint] == "torque" and joint not in resting]
    dead = [joint for joint in measured if _constant(raw.columns[f"{joint}/torque"])]
    notes = [f"Column {joint}/position is constant: this joint did not move." for joint in resting]
    for joint in dead:
        name = f"{joint}/torque"
        if len(dead) == len(measured):
            raise LogError(
                f"{raw.path}: column {rig.columns.get(name, name)!r} is {_value(raw.columns[name]):.6g} in all rows"
                f" while {joint} moves: the torque was not measured; map the right column, or say with `load:` what"
                " the joint carries (`load: unknown` fits it)"
            )
        notes.append(f"Column {name} is constant while {joint} moves: its torque was not measured.")
    return tuple(notes)


def _require_commands(raw: RawLog, rig: Rig) -> tuple[str, ...]:
    """Refuse a log in which no command changes and no servo is moved from its goal; note joints that rest."""
    names = {joint: rig.command_column(joint) for joint in rig.joints}
    resting = [joint for joint, name in names.items() if _constant(raw.columns[name])]
    if len(resting) == len(names) and not any(_moved_from_goal(raw, rig, joint) for joint in resting):
        value = _value(raw.columns[names[resting[0]]])
        shown = ", ".join(repr(rig.columns.get(name, name)) for name in names.values())
        raise LogError(
            f"{raw.path}: the command {shown} is constant ({value:.6g}) in all rows; "
            "record a motion with a changing command"
        )
    return tuple(f"Column {names[joint]} is constant: this joint was not commanded." for joint in resting)


def _moved_from_goal(raw: RawLog, rig: Rig, joint: str) -> bool:
    """Whether a servo holds a constant goal against a torque that the log tells, as that of a hand behind a sensor.

    Its effort, the distance from the goal, then follows the load. If it does not, the servo followed another goal than
    the recorded one. A load that is computed from the motion alone lacks what moves the joint.
    """
    load, position = rig.load[joint], raw.columns[f"{joint}/position"]
    if rig.drive[joint] != "position_servo" or _constant(position):
        return False
    if load != "torque":
        return isinstance(load, RobotLoad) and load.method == "estimate"
    torque = raw.columns[f"{joint}/torque"]
    both = np.isfinite(position) & np.isfinite(torque)
    if _constant(torque) or not both.any():
        return False
    return abs(float(np.corrcoef(position[both], torque[both])[0, 1])) >= FOLLOWS


def _constant(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size > 0 and float(np.ptp(finite)) == 0.0


def _value(values: FloatArray) -> float:
    return float(values[np.isfinite(values)][0])


SHORTEST_SEGMENT = 10
MOST_MISSING = 0.2
SLOWEST_SAMPLES = 0.2
"""Period of a channel of the balance [s] beyond which its filters are longer than most strokes."""
_SLOW = ("temperature", "supply_voltage", "position_gain")
_MAY_FREEZE = ("torque", "position", "motor_position")


def _in_order(raw: RawLog) -> RawLog:
    """The log at the instants of its samples, without rows that have no time of their own; an epoch starts at 0."""
    positions = [values for name, values in raw.columns.items() if name.endswith("/position")]
    others = [values for name, values in raw.columns.items() if not name.endswith("/position")]
    instants = sampling_instants(raw.time, positions, others)
    raw = replace(raw, time=instants.time, notes=raw.notes + instants.notes)
    keep, notes = rows_in_order(raw.time, raw.path)
    time = raw.time if keep.all() else raw.time[keep]
    if abs(time[0]) > 1e6:
        time = time - time[0]
        notes += ("Time counts from the first row (the file has the time of day).",)
    if keep.all():
        return replace(raw, time=time, notes=raw.notes + notes)
    columns = {name: values[keep] for name, values in raw.columns.items()}
    rows, enabled, valid = raw.rows[keep], raw.enabled[keep], raw.valid[keep]
    return replace(raw, rows=rows, time=time, columns=columns, enabled=enabled, valid=valid, notes=raw.notes + notes)


def _motion(raw: RawLog, rig: Rig, name: str) -> FloatArray:
    """The channel whose motion shows that `name` ought to move too."""
    joint, _, suffix = name.rpartition("/")
    return raw.columns[
        f"{joint}/position" if suffix not in ("position", "motor_position") else rig.command_column(joint)
    ]


def _repair_channels(
    raw: RawLog, rig: Rig
) -> tuple[dict[str, FloatArray], BoolArray, tuple[str, ...], dict[str, float]]:
    """Fill, release and mask each channel: the channels, rows not to be used, notes, and rows a sample if slower."""
    columns: dict[str, FloatArray] = {}
    excluded = ~(raw.enabled & raw.valid)
    notes: tuple[str, ...] = ()
    filled_notes: dict[str, list[str]] = {}
    required = {name for joint in rig.joints for name in rig.required_columns(joint)}
    if not raw.enabled.all():
        notes += (f"{int((~raw.enabled).sum())} rows with the drive switched off were left out.",)
    if not raw.valid.all():
        notes += (f"{int((~raw.valid).sum())} rows were left out because the rig's `valid` does not hold there.",)
    for name, values in raw.columns.items():
        values, holes, note = channels.fill_missing(raw.time, values)
        if name not in required and holes.mean() > MOST_MISSING:
            notes += (f"Column {name} is missing in {100 * holes.mean():.0f} % of the rows and was left out.",)
            continue
        slow = name.rsplit("/", 1)[-1] in _SLOW
        if note:
            note = note.replace("of long holes were left out", "of long holes were filled too") if slow else note
            filled_notes.setdefault(note, []).append(name)
        if name.split("/")[0] in rig.joints and not slow:
            excluded = excluded | holes
        columns[name] = values
    for note, names in filled_notes.items():
        notes += (f"Column{'s' if len(names) > 1 else ''} {', '.join(names)}: {note}.",)
    filled = replace(raw, columns=columns)
    period = float(np.median(np.diff(raw.time)))
    slower: dict[str, float] = {}
    for name in list(columns):
        suffix = name.rsplit("/", 1)[-1]
        k = channels.hold_period(raw.time, columns[name]) if suffix not in _SLOW else 1.0
        if k > 1.0 and suffix in HELD:
            notes += (f"Column {name} changes every {k:.3g} rows only: a command that is held, left as it is.",)
        elif k > 1.0:
            columns[name] = channels.release_hold(raw.time, columns[name], k)
            slower[name] = k
            notes += (
                f"Column {name} was sampled on a clock {k:.3g} times slower than the log and interpolated between."
                + (_too_slow(k * period) if name in required else ""),
            )
        elif suffix in _MAY_FREEZE and name.split("/")[0] in rig.joints:
            frozen = channels.frozen_rows(columns[name], _motion(filled, rig, name), period, jump=suffix != "torque")
            if frozen.any():
                excluded = excluded | frozen
                notes += (
                    f"Column {name} is frozen in {int(frozen.sum())} rows (the first: row "
                    f"{int(raw.rows[np.flatnonzero(frozen)[0]])}); they were left out.",
                )
    off, more = _drive_rows(columns, rig, period)
    return columns, excluded | off, notes + more, slower


def _too_slow(period: float) -> str:
    """What to say of a channel of the balance that is sampled every `period` [s]; "" if its filters suit motions."""
    if period <= SLOWEST_SAMPLES:
        return ""
    return (
        f" All channels are filtered over four of its periods, {4.0 * period:.2g} s: motion faster than that is not "
        f"seen, and only strokes that last longer are used. Record it at {1.0 / SLOWEST_SAMPLES:.0f} Hz or more."
    )


def _drive_rows(columns: dict[str, FloatArray], rig: Rig, period: float) -> tuple[BoolArray, tuple[str, ...]]:
    """Rows with a servo that lets go, and notes on commands that rest at their limit."""
    off = np.zeros(next(iter(columns.values())).size, dtype=bool)
    notes: tuple[str, ...] = ()
    for joint in rig.joints:
        name = rig.command_column(joint)
        command, position = columns[name], columns[f"{joint}/position"]
        if rig.drive[joint] == "position_servo":
            loose = channels.zero_stretches(command - position, position, period)
            if loose.any():
                off |= loose
                notes += (
                    f"{int(loose.sum())} rows in which the command of {joint} copies its moving position (torque off) "
                    "were left out.",
                )
            limit = rig.saturation.get(joint)
            share = 0.0 if limit is None else float(np.mean(np.abs(command - position) >= limit))
        else:
            share = channels.saturated_share(command)
            limit = float(np.abs(command).max())
        if share > 0.01 and limit is not None:
            notes += (f"The effort of {joint} rests at its limit of {limit:.4g} in {100 * share:.1f} % of the rows.",)
    return off, notes


def _segments(block: IntArray, excluded: BoolArray) -> IntArray:
    """Number the contiguous usable stretches of the grid; -1 where excluded or shorter than 10 samples."""
    key = np.where(excluded, -1, block)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(key) != 0) + 1, [key.size]])
    lengths = np.diff(edges)
    good = (key[edges[:-1]] >= 0) & (lengths >= SHORTEST_SEGMENT)
    numbers = np.where(good, np.cumsum(good) - 1, -1)
    return np.repeat(numbers, lengths).astype(np.int64)


def _stepped(raw: RawLog, rig: Rig) -> BoolArray:
    """Steps (T - 1,) over which a joint's position says that the clock is wrong."""
    positions = (raw.columns[f"{joint}/position"] for joint in rig.joints if joint not in raw.speed_only)
    found = [stepped_clock(raw.time, position, GAP_PERIODS) for position in positions]
    return np.any(found, axis=0) if found else np.zeros(raw.time.size - 1, dtype=bool)


def _prepare(log: Path | LogTable, rig: Rig) -> Run:
    """One run, with every repair but the signs, which are decided over all runs of a rig."""
    table = read_table(log, needed=[rig.columns.get(f"{joint}/position", f"{joint}/position") for joint in rig.joints])
    path = Path(str(log))
    raw = on_rows_of_positions(map_columns(table, rig, path), rig)
    rows = len(table)
    del table
    rig = replace(rig, units={**raw.units, **rig.units})  # the checks below believe a unit that the file states
    raw = without_outliers(
        _with_positions(_in_order(raw)), rig.joints, [j for j in rig.joints if rig.units_of(j).slides]
    )
    notes = raw.notes + _require_commands(raw, rig) + _require_live(raw, rig)
    beside_jumps, told = find_jumps(raw, rig)
    notes += told
    columns, excluded, more, slower = _repair_channels(raw, rig)
    excluded |= beside_jumps
    clock = uniform_clock(raw.time, raw.enabled, path, _stepped(raw, rig), scale_of("time", rig.units).factor)
    resampled = {name: clock.resample(values, held=name.rpartition("/")[2] in HELD) for name, values in columns.items()}
    segment = _segments(clock.block, clock.resample_mask(excluded))
    usable = segment >= 0
    if int(usable.sum()) < MIN_ROWS:
        why = " ".join(notes + more + clock.notes) or "all stretches are too short"
        raise LogError(f"{path}: no usable samples are left of {rows} rows ({why}); record again")
    notes += more + clock.notes
    measured = {name: v for name, v in resampled.items() if name.rpartition("/")[0] not in raw.speed_only}
    check_angles(measured, usable, rig, clock.period, path)
    notes += check_velocity(measured, usable, rig, clock.period, path)
    notes += lag_notes(measured, usable, rig, clock.period)
    resampled |= measured
    for joint in raw.speed_only:
        check_speed(resampled[f"{joint}/velocity"][usable], rig, joint, path)
    steps = {name: channels.grid_step(raw.columns[name]) for name in resampled}
    found = {name: step for name, step in steps.items() if step > 0.0}
    return Run(
        name=run_name(path),
        source=path,
        time=clock.time,
        period=clock.period,
        columns=resampled,
        segment=segment,
        notes=notes,
        steps=found,
        hints=raw.hints + told,
        slower={name: rows * clock.period for name, rows in slower.items()},
        speed_only=raw.speed_only,
    )


def _unique_names(runs: list[Run]) -> list[Run]:
    """The same runs; where two share a name, the folder goes before it, and then a number behind it."""
    taken: set[str] = set()
    result = []
    for run in runs:
        folder = "" if run.source is None else run.source.parent.name
        shared = sum(other.name == run.name for other in runs) > 1
        base = f"{folder}/{run.name}" if shared and folder else run.name
        name, number = base, 2
        while name in taken:
            name, number = f"{base}-{number}", number + 1
        taken.add(name)
        result.append(run if name == run.name else replace(run, name=name))
    return result


def _require_masses(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse a run of which a rig with different masses gives none."""
    for load in rig.load.values():
        for run in runs:
            if isinstance(load, Pendulum):
                load.in_run(run)


def load_runs(paths: Sequence[Path | str | pd.DataFrame | LogTable], rig: Rig) -> list[Run]:
    """Read, check, repair and resample the runs of one rig.

    What is repaired is said in `Run.notes`: repeated rows, jitter, lost rows, gaps, missing values, stretches with the
    drive off or a frozen sensor, channels on slower clocks, and a torque or command column of the wrong sign (decided
    from all runs together where one alone is not clear). Rows count from 1, the first data row.

    Args:
        paths: Log files, whose formats `READERS` lists, and tables with the columns of a CSV log.
        rig: Names, units and drives.

    Raises:
        LogError: A file that cannot be used, in one line: file, row and column, and what to do.

    Example:
        >>> [run.name for run in load_runs([leg_log()], leg_rig())]
        ['swing']
    """
    runs = _unique_names([_prepare(log, rig) for log in named_logs(paths)])
    _require_alike(runs)
    _require_masses(runs, rig)
    refuse_exchanged(runs, rig)
    refuse_unsigned(runs, rig)
    result = []
    for run, flips in zip(runs, wrong_signs(runs, rig), strict=True):
        if flips:
            columns = {name: -values if name in flips else values for name, values in run.columns.items()}
            notes = tuple(
                f"Column {name} has the wrong sign and was turned: {why}. Models are for the turned column; correct "
                "its sign in the rig file."
                for name, why in flips.items()
            )
            run = replace(run, columns=columns, notes=run.notes + notes, hints=run.hints + notes)
        result.append(run)
    check_torque_unit(result, rig)
    _require_one_joint(result, rig)
    return result


def load_run(path: Path | str | pd.DataFrame, rig: Rig) -> Run:
    """Read, check, repair and resample one run; see `load_runs`.

    Raises:
        LogError: The file cannot be used; one line says where and what to do.

    Example:
        >>> run = load_run(leg_log(), leg_rig())
        >>> sorted(run.columns)
        ['knee/current', 'knee/position', 'knee/torque']
    """
    return load_runs([path], rig)[0]


def in_order(runs: Sequence[Run], rig: Rig) -> list[Run]:
    """The runs in an order that depends on what they hold alone, so that nothing depends on the order of the files.

    Sorted by length, sampling period and the spread of each joint's position and command, to six digits: names, units,
    zeros and signs do not change it.
    """

    def key(run: Run) -> tuple[float, ...]:
        spreads = [float(np.std(run.columns[c])) for j in rig.joints for c in (f"{j}/position", rig.command_column(j))]
        return (len(run), *(float(f"{x:.6g}") for x in (run.period, *spreads)))

    return sorted(runs, key=key)
