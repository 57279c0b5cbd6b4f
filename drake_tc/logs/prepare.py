"""From log files to runs: map, check, repair, put on a uniform clock; refuse what cannot be mended.

Every repair and exclusion leaves one sentence in `Run.notes`; every refusal is a `LogError` of one line.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs import channels
from drake_tc.logs.clock import GAP_PERIODS, MIN_ROWS, rows_in_order, uniform_clock
from drake_tc.logs.columns import RawLog, map_columns
from drake_tc.logs.exchanged import refuse_exchanged
from drake_tc.logs.instants import sampling_instants
from drake_tc.logs.jumps import find_jumps
from drake_tc.logs.live import require_commands, require_live
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.local_motion import stepped_clock
from drake_tc.logs.one_joint import require_one_joint
from drake_tc.logs.outliers import without_outliers
from drake_tc.logs.plausible import check_angles, check_speed, check_velocity, lag_notes
from drake_tc.logs.readers import read_table, run_name
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.several_clocks import HELD, on_rows_of_positions
from drake_tc.logs.signs import wrong_signs
from drake_tc.logs.speed_only import require_alike, with_positions
from drake_tc.logs.torque_unit import check_torque_unit
from drake_tc.logs.units import scale_of
from drake_tc.logs.unsigned import refuse_unsigned
from drake_tc.types import BoolArray, FloatArray, IntArray

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


def _prepare(path: Path, rig: Rig) -> Run:
    """One run, with every repair but the signs, which are decided over all runs of a rig."""
    table = read_table(path, needed=[rig.columns.get(f"{joint}/position", f"{joint}/position") for joint in rig.joints])
    raw = on_rows_of_positions(map_columns(table, rig, path), rig)
    rows = len(table)
    del table
    rig = replace(rig, units={**raw.units, **rig.units})  # the checks below believe a unit that the file states
    raw = without_outliers(
        with_positions(_in_order(raw)), rig.joints, [j for j in rig.joints if rig.units_of(j).slides]
    )
    notes = raw.notes + require_commands(raw, rig) + require_live(raw, rig)
    beside_jumps, told = find_jumps(raw, rig)
    notes += told
    columns, excluded, more, slower = _repair_channels(raw, rig)
    excluded |= beside_jumps
    clock = uniform_clock(raw.time, raw.enabled, path, _stepped(raw, rig), scale_of("time", rig.units).factor)
    resampled = {name: clock.resample(values) for name, values in columns.items()}
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
        shared = sum(other.name == run.name for other in runs) > 1 and run.source is not None
        base = f"{run.source.parent.name}/{run.name}" if shared and run.source is not None else run.name
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


def load_runs(paths: Sequence[Path | str], rig: Rig) -> list[Run]:
    """Read, check, repair and resample the runs of one rig.

    What is repaired is said in `Run.notes`: repeated rows, jitter, lost rows, gaps, missing values, stretches with the
    drive off or a frozen sensor, channels on slower clocks, and a torque or command column of the wrong sign (decided
    from all runs together where one alone is not clear). Rows count from 1, the first data row.

    Args:
        paths: Log files; `READERS` lists their formats.
        rig: Names, units and drives.

    Raises:
        LogError: A file that cannot be used, in one line: file, row and column, and what to do.

    Example:
        >>> [run.name for run in load_runs([leg_log()], leg_rig())]
        ['swing']
    """
    runs = _unique_names([_prepare(Path(path), rig) for path in paths])
    require_alike(runs)
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
    require_one_joint(result, rig)
    return result


def load_run(path: Path | str, rig: Rig) -> Run:
    """Read, check, repair and resample one run; see `load_runs`.

    Raises:
        LogError: The file cannot be used; one line says where and what to do.

    Example:
        >>> run = load_run(leg_log(), leg_rig())
        >>> sorted(run.columns)
        ['knee/current', 'knee/position', 'knee/torque']
    """
    return load_runs([path], rig)[0]
