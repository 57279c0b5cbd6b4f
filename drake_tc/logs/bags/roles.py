"""What the joint states of each topic are: measured, commanded, or neither, and which of several topics is taken."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from drake_tc.logs.bags.messages import Kind, Stream

OTHERS = (
    *("leader", "teleop", "teleoperation"),
    *("filtered", "filter", "smoothed", "smooth", "lowpass", "predicted", "prediction", "estimated", "estimate"),
    *("ik", "solution", "plan", "planned", "planner", "ghost", "fake", "mock"),
)
"""Words of topics whose joint states are no measurements of the robot: another arm's, copies, and intentions."""
LEADERS, FOLLOWERS = ("master",), ("puppet", "follower", "slave")
"""Words of the arm that is led by hand, where another topic has a word of the arm that follows."""
STATES = ("joint_states", "joint_state")
"""Last part of the topic in which drivers publish what they measure."""


@dataclass(frozen=True)
class Taken:
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


def words_of(topic: str) -> list[str]:
    """The words of a topic in small letters: split at signs and at changes of case."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", topic)]


def is_other(topic: str, topics: Collection[str]) -> bool:
    """Whether a topic's name says that its joint states are no measurements, such as those of a leader arm.

    Args:
        topic: Of the bag.
        topics: All of them.
    """
    words = words_of(topic)
    follows = any(word in FOLLOWERS for each in topics for word in words_of(each))
    return any(word in OTHERS or (follows and word in LEADERS) for word in words)


def without_others(streams: Sequence[Stream]) -> tuple[list[Stream], list[Stream]]:
    """The streams of joints that may be measured or commanded, with all other kinds of streams; and the others."""
    topics = {stream.topic for stream in streams}
    mine = [s for s in streams if not (_has_joints(s) and is_other(s.topic, topics))]
    return mine, [s for s in streams if not any(s is each for each in mine)]


def taken(streams: Sequence[Stream], others: Sequence[Stream]) -> Taken:
    """One stream for each column of the joints.

    Of several topics with one column, `.../joint_states` is taken for measurements, and a controller's reference goes
    before a trajectory; a controller's feedback is taken where there is nothing else. Else none is taken: a rig file
    has to name one.

    Args:
        streams: `without_others`.
        others: The others.
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
    return Taken(tuple(result), aside, undecided, (*_commands_hint(result, aside), *hints))


def _has_joints(stream: Stream) -> bool:
    return any(name.endswith(("/position", "/position_command", "/velocity", "/effort")) for name in stream.names)


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
    """Why a column is missing that some topics may hold, and what to write into the rig file.

    Args:
        column: That a rig file names, or `canonical`.
        canonical: What the column is used for.
        topics: That may hold it.
    """
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
