"""Several robots in one bag, whose joints have the same names."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from drake_tc.logs.bags.streams import Kind, Stream


def by_robot(streams: Sequence[Stream]) -> tuple[list[Stream], tuple[str, ...]]:
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
