"""The streams of a bag on one clock, that of the joint states.

Joint states of a topic are measured, commanded, or neither; of several topics one is taken. Joints of several robots in
one bag may have the same names.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from drake_tc.errors import LogError
from drake_tc.logs.files.bag_messages import Kind, Stream
from drake_tc.types import FloatArray, IntArray

OTHERS = (
    *("leader", "teleop", "teleoperation", "filtered", "filter", "filt", "smoothed", "smooth", "lowpass"),
    *("predicted", "prediction", "estimated", "estimate"),
    *("ik", "solution", "plan", "planned", "planner", "ghost", "fake", "mock"),
)
"""Words of topics whose joint states are no measurements of the robot: another arm's, copies, and intentions."""
LEADERS, FOLLOWERS = ("master",), ("puppet", "follower", "slave")
"""Words of the arm that is led by hand, where another topic has a word of the arm that follows."""
STATES = ("joint_states", "joint_state")
"""Last part of the topic in which drivers publish what they measure."""


@dataclass(frozen=True)
class _Taken:
    """The streams of a bag, each column from one of them.

    Attributes:
        streams: With their columns; those of topics that were not taken have the topic before their names.
        aside: By column of a topic that was not taken, why.
        undecided: By column that no topic evidently holds, the topics that may hold it.
        hints: Which topic was taken for what where several have the same joints.
    """

    streams: tuple[Stream, ...]
    aside: dict[str, str] = field(default_factory=dict)
    undecided: dict[str, tuple[str, ...]] = field(default_factory=dict)
    hints: tuple[str, ...] = ()


def _words_of(topic: str) -> list[str]:
    """The words of a topic in small letters: split at signs and at changes of case."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", topic)]


def _is_other(topic: str, topics: Collection[str]) -> bool:
    """Whether a topic's name says that its joint states are no measurements, such as those of a leader arm."""
    words = _words_of(topic)
    follows = any(word in FOLLOWERS for each in topics for word in _words_of(each))
    return any(word in OTHERS or (follows and word in LEADERS) for word in words)


def _without_others(streams: Sequence[Stream]) -> tuple[list[Stream], list[Stream]]:
    """The streams of joints that may be measured or commanded, with all other kinds of streams; and the others."""
    topics = {stream.topic for stream in streams}
    of_joints = ("/position", "/position_command", "/velocity", "/effort")
    mine = [s for s in streams if not (any(n.endswith(of_joints) for n in s.names) and _is_other(s.topic, topics))]
    return mine, [s for s in streams if not any(s is each for each in mine)]


def _taken(streams: Sequence[Stream], others: Sequence[Stream]) -> _Taken:
    """One stream for each column of the joints.

    Of several topics with one column, `.../joint_states` is taken for measurements, and a controller's reference goes
    before a trajectory; a controller's feedback is taken where there is nothing else. Else none is taken: a rig file
    has to name one.
    """
    result: list[Stream] = []
    aside: dict[str, str] = {}
    undecided: dict[str, tuple[str, ...]] = {}
    hints: list[str] = []
    for group in _sharing(streams):
        chosen = group[0] if len(group) == 1 else _evident(group)
        if len(group) == 1 and not (like := [o for o in others if _joints(o) & _joints(group[0])]):
            result.append(group[0])
            continue
        rest = [s for s in group if s is not chosen and s.kind is not Kind.feedback]
        if chosen is not None:
            result.append(chosen)
            like = [o for o in others if chosen.kind is Kind.measured and _joints(o) & _joints(chosen)]
            if rest or like:
                hints.append(_chosen_hint(chosen, [*rest, *like]))
        else:
            undecided |= _topics_by_column(rest)
            hints.append(_undecided_hint(rest))
        for stream in rest:
            result.append(_named_by_topic(stream))
            why = f"of {stream.topic}; {chosen.topic} is used" if chosen else f"of {stream.topic}; choose a topic"
            aside |= dict.fromkeys(result[-1].names, why)
    measured = {name for stream in result for name in stream.names}
    for stream in others:
        result.append(_named_by_topic(stream))
        aside |= dict.fromkeys(result[-1].names, f"of {stream.topic}, which by its name is not a measurement")
        lone = [name for name in stream.names if name not in measured and name not in undecided]
        undecided |= {name: (*undecided.get(name, ()), stream.topic) for name in lone}
    return _Taken(tuple(result), aside, undecided, (*_commands_hint(result, aside), *hints))


def _joints(stream: Stream) -> set[str]:
    return {name.rpartition("/")[0] for name in stream.names}


def _signals(stream: Stream) -> set[str]:
    """The columns over which topics compete: those of joints' positions, measured or commanded."""
    return {name for name in stream.names if name.endswith(("/position", "/position_command"))}


def _sharing(streams: Sequence[Stream]) -> list[list[Stream]]:
    """The streams in groups that have positions of the same joints, measured or commanded."""
    groups: list[list[Stream]] = []
    for stream in streams:
        alike = [group for group in groups if any(_signals(stream) & _signals(each) for each in group)]
        groups = [group for group in groups if not any(group is each for each in alike)]
        groups.append([each for group in alike for each in group] + [stream])
    return groups


def _evident(group: Sequence[Stream]) -> Stream | None:
    """The stream of a group that is evidently meant; None where several may be."""
    for best in (
        [s for s in group if s.kind not in (Kind.planned, Kind.feedback)],
        [s for s in group if s.kind is Kind.measured and s.topic.rpartition("/")[2] in STATES],
        [s for s in group if s.kind is Kind.planned],
        list(group),
    ):
        if len(best) == 1:
            return best[0]
        if len(best) > 1 and best[0].kind is not Kind.measured:
            return None
    return None


def _topics_by_column(streams: Sequence[Stream]) -> dict[str, tuple[str, ...]]:
    """By column of any stream, the topics of all, those that have it first."""
    names = dict.fromkeys(name for stream in streams for name in stream.names)
    return {
        name: tuple(s.topic for has in (True, False) for s in streams if (name in s.names) is has) for name in names
    }


def _commands_hint(streams: Sequence[Stream], aside: Collection[str]) -> tuple[str, ...]:
    """From which topics commands and measurements of the same joints are, if they are from joint states of both."""
    used = [s for s in streams if _signals(s) and not set(s.names) & set(aside)]
    measured = [s for s in used if s.kind in (Kind.measured, Kind.feedback)]
    commanded = [s for s in used if s.kind not in (Kind.measured, Kind.feedback)]
    pairs = [(m, c) for c in commanded for m in measured if _joints(m) & _joints(c)]
    return tuple(f"The joints' measurements come from {m.topic}, and their commands from {c.topic}." for m, c in pairs)


def _named_by_topic(stream: Stream) -> Stream:
    topic = stream.topic.strip("/")
    return replace(stream, names=tuple(name if name.endswith("]") else f"{topic}/{name}" for name in stream.names))


def _chosen_hint(chosen: Stream, rest: Sequence[Stream]) -> str:
    what = "measurements" if chosen.kind in (Kind.measured, Kind.feedback) else "commands"
    topics = ", ".join(dict.fromkeys(s.topic for s in rest))
    has, is_are = ("has", "is") if len({s.topic for s in rest}) == 1 else ("have", "are")
    entry = _entry(rest[0], f"{'position' if what == 'measurements' else 'position_command'}")
    return (
        f"{chosen.topic} is used for the {what} of its joints. {topics} {has} the same joints and {is_are} not used;"
        f" {entry} in the rig file would use {rest[0].topic}."
    )


def _undecided_hint(rest: Sequence[Stream]) -> str:
    topics = " and ".join(dict.fromkeys(s.topic for s in rest))
    suffix = next(iter(_signals(rest[0]))).rpartition("/")[2]
    return (
        f"{topics} have the same joints, and none of them is used: {_entry(rest[0], suffix)} in the rig file would use"
        f" {rest[0].topic}."
    )


def _entry(stream: Stream, suffix: str) -> str:
    """What a rig file has to say to take a topic."""
    own = next((name for name in stream.names if name.endswith((f"/{suffix}", "/position"))), stream.names[0])
    return f"`columns: {{{suffix}: {stream.topic.strip('/')}/<joint>/{own.rpartition('/')[2]}}}`"


def undecided_topics(column: str, canonical: str, topics: Sequence[str]) -> str:
    """Why a column is missing that some topics may hold, and what to write into the rig file."""
    entry = f"columns: {{{canonical}: {topics[0].strip('/')}/{column}}}"
    if len(topics) == 1:
        return (
            f"only the topic {topics[0]} has {column!r}, and its name says that it is no measurement; to use it, write"
            f" {entry} in the rig file"
        )
    return (
        f"{column!r} may come from the topics {', '.join(topics)}; expected one of them: write {entry} in the rig file"
        f" to take {topics[0]}"
    )


def _by_robot(streams: Sequence[Stream]) -> tuple[list[Stream], tuple[str, ...]]:
    """The streams, where joints of robots that name them alike are told apart by the robots' namespaces.

    `/left/joint_states` and `/right/joint_states` with a joint `knee` give `left/knee/position` and
    `right/knee/position`; so do the other topics of these namespaces. IMUs and F/T sensors have names of their topics
    already.

    Returns:
        The streams, and a note; none where no joint has two owners.
    """
    states = [s for s in streams if s.kind is Kind.measured and any("/" in name for name in s.names)]
    robots: set[str] = set()
    for one, other in combinations(states, 2):
        if set(one.names) & set(other.names) and _last(one.topic) == _last(other.topic) and one.topic != other.topic:
            robots |= _robots(one.topic, other.topic)
    if not robots:
        return list(streams), ()
    result = []
    for stream in streams:
        robot = max((r for r in robots if stream.topic.strip("/").startswith(f"{r}/")), key=len, default="")
        result.append(replace(stream, names=tuple(_owned(robot, name) for name in stream.names)) if robot else stream)
    told = ", ".join(sorted(robots))
    return result, (f"Robots with joints of the same names: those of {told} have this word before their names.",)


def _last(topic: str) -> str:
    return topic.rpartition("/")[2]


def _robots(one: str, other: str) -> set[str]:
    """The namespaces up to the first word in which two topics differ; none for a topic that has no word there."""
    parts = [topic.strip("/").split("/") for topic in (one, other)]
    at = next(i for i, (a, b) in enumerate(zip(*parts, strict=False)) if a != b)
    return {"/".join(words[: at + 1]) for words in parts if len(words) > at + 1}


def _owned(robot: str, name: str) -> str:
    """The name of a column with that of the robot; columns `TOPIC[i]` of arrays wait for their joints."""
    return name if name.endswith("]") or name.startswith(("imu_", "ft_", "/")) else f"{robot}/{name}"


CLOCKS_AGREE = 0.05
"""Differences between the delays of two topics above which their senders' clocks differ [s]."""
CLEARLY_BEST = 0.7
"""An array's order is sure where the best assignment errs less than this share of the second best."""


class _Timed(NamedTuple):
    """A stream with its time [ns], sorted, without repeats."""

    stream: Stream
    time: IntArray
    table: FloatArray
    notes: tuple[str, ...]


def joined(streams: Sequence[Stream], path: Path, needed: Collection[str] = ()) -> pd.DataFrame:
    """One row for each joint state of the topic that gives the clock; the others are brought to its clock.

    That is the topic with most of the positions that are needed, or of all where none is, and of several the one with
    most rows. Time is the sender's stamp where there is one, else the recorder's. Measurements are interpolated
    linearly, commands are held, trajectories interpolated between their points; before the first and after the last row
    of a measurement there is nothing (NaN). Senders whose clocks differ by more than 50 ms are put on the main one.

    Args:
        streams: Of the bag.
        path: For messages.
        needed: Columns that the caller uses. Rows without any of their positions, which a topic has that several
            publishers share, are left out.

    Returns:
        `time` [s] from the first row, and canonical columns. In `attrs`, `notes` say what was joined how, `hints` which
        topic was taken where several have the same joints, `aside` why columns were not taken, and `undecided` the
        topics that may hold a column.

    Raises:
        LogError: no joint states.
    """
    mine, others = _without_others(streams)
    mine, robots = _by_robot(mine)
    choice = _taken(mine, others)
    main = _main(choice, needed, path)
    rate = (len(main.time) - 1) / max(1e-9, 1e-9 * float(main.time[-1] - main.time[0]))
    notes = [
        f"The rows are the {len(main.time)} messages of {main.stream.topic} ({rate:.4g} Hz).",
        *robots,
        *main.notes,
    ]
    columns: dict[str, FloatArray] = {"time": 1e-9 * (main.time - main.time[0]).astype(np.float64)}
    columns |= dict(zip(main.stream.names, main.table.T, strict=True))
    delay = _delay(main.stream)
    for stream in choice.streams:
        if stream is main.stream or len(stream) == 0:
            continue
        timed, more = _on_clock(_timed(stream), delay, main.stream.topic)
        notes += [*timed.notes, *more]
        values = _resampled(timed, main.time)
        names, more = _apart(stream, columns, main.stream.topic)
        notes += more
        for name, column in zip(names, values.T, strict=True):
            if name not in columns or not np.isfinite(columns[name]).any():
                columns[name] = column
            elif name == stream.topic.strip("/"):  # one number a message, whose topic is called like a column
                columns[stream.topic] = column
            else:
                columns[f"{stream.topic.strip('/')}/{name}"] = column
                notes.append(
                    f"Column {name} of {stream.topic} is called {stream.topic.strip('/')}/{name}, because another topic"
                    " has a column of this name."
                )
        notes.append(_how(timed))
    columns, assigned = _assigned(columns)
    table = pd.DataFrame(columns)
    table.attrs |= {"notes": [*notes, *assigned], "hints": [*choice.hints, *_other_clocks(choice, main.stream, needed)]}
    table.attrs |= {"aside": choice.aside, "undecided": choice.undecided}
    return table


def _main(choice: _Taken, needed: Collection[str], path: Path) -> _Timed:
    """The stream whose rows are those of the table."""
    known = set(needed)
    measured = [s for s in choice.streams if s.kind in (Kind.measured, Kind.feedback)]
    states = [s for s in measured if any(name.endswith("/position") for name in s.names)]
    if not states:
        topics = ", ".join(sorted({f"{s.topic} ({s.kind})" for s in choice.streams})) or "none"
        raise LogError(
            f"{path}: no joint states in this bag; expected a topic of sensor_msgs/JointState with positions; topics of"
            f" known types here: {topics}"
        )

    def rank(stream: Stream) -> tuple[int, bool, int]:
        own = [name for name in stream.names if name.endswith("/position")]
        return len(known.intersection(own)), not set(own) & set(choice.aside), len(stream)

    main = _timed(max(states, key=rank))
    used = [i for i, name in enumerate(main.stream.names) if name in known and name.endswith("/position")]
    rows = np.isfinite(main.table[:, used]).any(axis=1) if used else np.ones(len(main.time), dtype=bool)
    if rows.all() or not rows.any():
        return main
    note = f"{int((~rows).sum())} messages of {main.stream.topic} have only other joints and were left out."
    return main._replace(time=main.time[rows], table=main.table[rows], notes=(*main.notes, note))


def _other_clocks(choice: _Taken, main: Stream, needed: Collection[str]) -> list[str]:
    """What to say where positions that are used are on other topics than the one that gives the rows."""
    others = {
        stream.topic
        for stream in choice.streams
        if stream is not main and stream.kind is Kind.measured and not set(stream.names) & set(choice.aside)
        for name in stream.names
        if name.endswith("/position") and (not needed or name in needed)
    }
    if not others:
        return []
    return [
        f"The positions of {', '.join(sorted(others))} were interpolated at the rows of {main.topic}. A rig file with"
        " the joints of one topic alone takes the rows of that topic."
    ]


def _apart(stream: Stream, columns: Mapping[str, FloatArray], main: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of a stream's columns, and a note: efforts that the joint states have too get the topic before them.

    Such a topic has other torques than the drives' efforts, for example those of torque sensors.
    """
    measured = stream.kind is Kind.measured and all(name.endswith("/effort") for name in stream.names)
    if not measured or not any(name in columns for name in stream.names):
        return stream.names, ()
    topic = stream.topic.strip("/")
    names = tuple(f"{topic}/{name}" for name in stream.names)
    joint = stream.names[0].rpartition("/")[0]
    return names, (
        f"{main} and {stream.topic} both have efforts: columns of the latter are called {names[0]} and so on. If"
        f" they are of torque sensors, write `columns: {{{joint}/torque: {names[0]}}}`, for each joint.",
    )


def _timed(stream: Stream) -> _Timed:
    """Sorted by time, the last of rows of one time.

    Rows without a stamp are dropped where most rows have one: a simulated clock had not begun. Else all rows count at
    the time at which they were recorded.
    """
    stamps, received = (np.frombuffer(each, dtype=np.int64) for each in (stream.stamps, stream.received))
    has = stamps != 0
    stamped = 2 * int(has.sum()) > has.size
    rows = np.flatnonzero(has) if stamped else np.arange(has.size)
    time = (stamps if stamped else received)[rows]
    order = np.argsort(time, kind="stable")
    keep = order[np.append(np.diff(time[order]) > 0, True)]
    notes: tuple[str, ...] = ()
    if not stamped:
        some = "no stamps" if not has.any() else "few stamps"
        notes = (f"{stream.topic} has {some}: its rows have the time at which they were recorded.",)
    elif not has.all():
        notes = (f"{int((~has).sum())} of {has.size} rows of {stream.topic} have no stamp and were dropped.",)
    if len(keep) < len(time):
        notes += (f"{len(time) - len(keep)} rows of {stream.topic} repeat a stamp and were dropped.",)
    return _Timed(stream, time[keep], stream.table()[rows[keep]], notes)


def _delay(stream: Stream) -> float | None:
    """Median time from sending to recording [s]; None without stamps."""
    stamps = np.frombuffer(stream.stamps, dtype=np.int64)
    known = stamps != 0
    if not known.any():
        return None
    return 1e-9 * float(np.median((np.frombuffer(stream.received, dtype=np.int64) - stamps)[known]))


def _on_clock(timed: _Timed, delay: float | None, topic: str) -> tuple[_Timed, tuple[str, ...]]:
    """On the clock of the main topic, where the senders' clocks differ, or one of the two has no stamps.

    A row without a stamp was sent before it was recorded: by the delay of the main topic, the best estimate there is.
    """
    own = _delay(timed.stream)
    if own is None and delay is not None and 0.0 < delay < CLOCKS_AGREE:
        note = (
            f"{timed.stream.topic} was taken {1e3 * delay:.3g} ms before its recording, as {topic} is recorded so long"
            " after its stamps."
        )
        return timed._replace(time=timed.time - round(1e9 * delay)), (note,)
    if (delay or 0.0) == (own or 0.0) or abs((own or 0.0) - (delay or 0.0)) < CLOCKS_AGREE:
        return timed, ()
    shift = (own or 0.0) - (delay or 0.0)
    note = f"The clock of {timed.stream.topic} differs from that of {topic} by {shift:.4g} s; its rows were moved."
    return timed._replace(time=timed.time + round(1e9 * shift)), (note,)


def _resampled(timed: _Timed, time: IntArray) -> FloatArray:
    """(T, n) the stream at `time` [ns]; NaN where it has nothing."""
    base = int(time[0])
    own, at = 1e-9 * (timed.time - base), 1e-9 * (time - base)
    if timed.stream.kind is Kind.commanded:
        row = np.searchsorted(own, at + 1e-12, side="right") - 1
        return np.where((row >= 0)[:, None], timed.table[np.maximum(row, 0)], np.nan)
    last = timed.table[-1] if timed.stream.kind is Kind.planned else np.nan * timed.table[-1]
    ends = zip(timed.table.T, last.tolist(), strict=True)
    return np.column_stack([np.interp(at, own, column, left=np.nan, right=end) for column, end in ends])


def _how(timed: _Timed) -> str:
    span = 1e-9 * float(timed.time[-1] - timed.time[0])
    rate = f"{(len(timed.time) - 1) / span:.4g} Hz" if span > 0.0 else "one message"
    how = {
        Kind.measured: "interpolated",
        Kind.feedback: "interpolated",
        Kind.commanded: "the last value is held",
        Kind.planned: "interpolated between points, then held",
    }
    what = ", ".join(sorted({name.rpartition("/")[2] for name in timed.stream.names if "[" not in name}))
    return f"{what or 'What'} of {timed.stream.topic} ({rate}) was resampled to these rows ({how[timed.stream.kind]})."


def _assigned(columns: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns `TOPIC[i]` of arrays named after joints: a position command after the joint whose position is nearest."""
    arrays = dict.fromkeys(name.rpartition("[")[0] for name in columns if name.endswith("]"))
    notes = []
    for topic in arrays:
        names = [name for name in columns if name.rpartition("[")[0] == topic]
        joints = [name.removesuffix("/position") for name in columns if name.endswith("/position")]
        joints = [j for j in joints if "/" in j and topic.startswith(f"/{j.rpartition('/')[0]}/")] or joints
        suffix = _commanded(topic)
        if suffix == "position_command":
            joints, sure = _nearest([columns[name] for name in names], {j: columns[f"{j}/position"] for j in joints})
            why = "each to the joint whose position is nearest" + ("" if sure else ", which is not certain")
        else:
            why = "in the order of the joint states, which is a guess"
        if len(joints) < len(names):
            notes.append(f"{topic} has {len(names)} values for {len(joints)} joints and was left out.")
            columns = {name: values for name, values in columns.items() if name not in names}
            continue
        told = [f"{joint}/{suffix}" for joint in joints[: len(names)]]
        columns = {dict(zip(names, told, strict=True)).get(name, name): values for name, values in columns.items()}
        notes.append(f"The values of {topic} were assigned to {', '.join(told)}: {why}.")
    return columns, notes


def _commanded(topic: str) -> str:
    words = topic.lower()
    if "effort" in words or "torque" in words:
        return "torque_command"
    return "velocity_command" if "velocity" in words else "position_command"


def _nearest(commands: Sequence[FloatArray], positions: dict[str, FloatArray]) -> tuple[list[str], bool]:
    """The joint of each command by least squares of their differences, and whether no other order comes near."""
    from scipy.optimize import linear_sum_assignment

    names = list(positions)
    if len(names) < len(commands):
        return names, False
    error = [[np.sqrt(np.nanmean((command - positions[name]) ** 2)) for name in names] for command in commands]
    cost = np.nan_to_num(np.array(error), nan=1e9)
    rows, best = linear_sum_assignment(cost)
    total = float(cost[rows, best].sum())
    others = []
    for row, column in zip(rows, best, strict=True):
        barred = cost.copy()
        barred[row, column] = 1e6 * (1.0 + cost.max())
        again = linear_sum_assignment(barred)
        others.append(float(barred[again].sum()))
    return [names[i] for i in best], total < CLEARLY_BEST * min(others)
