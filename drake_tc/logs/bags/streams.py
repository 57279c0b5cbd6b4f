"""What the messages of one topic hold: rows of numbers with the sender's and the receiver's time stamps."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from drake_tc.types import FloatArray

COMMAND_WORDS = ("command", "cmd", "desired", "reference", "target", "setpoint", "goal")
"""In the name of a topic: its joint states are commanded, not measured."""


class Kind(StrEnum):
    """What a stream holds, and so how it is brought to another clock.

    A measurement is interpolated; a command is held; between the points of a trajectory it is interpolated, too. The
    feedback of a controller repeats a measurement.
    """

    measured = "measured"
    feedback = "feedback"
    commanded = "commanded"
    planned = "planned"


@dataclass
class Stream:
    """Rows of one topic and one set of names.

    Attributes:
        topic: Of the bag.
        kind: Measured or commanded.
        names: Of the columns; canonical names, or `command_0 ...` of an array whose joints are not told.
        stamps: (T,) the sender's clock [ns]; 0 where a message has none.
        received: (T,) the recorder's clock [ns].
        values: T rows after each other.
    """

    topic: str
    kind: Kind
    names: tuple[str, ...]
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, stamp: int, received: int, row: Sequence[float]) -> None:
        """Append one row of `len(names)` numbers."""
        self.stamps.append(stamp)
        self.received.append(received)
        self.values.extend(row)

    def replan(self, stamp: int, received: int) -> None:
        """Begin a new trajectory: drop what was planned for later, and start from what is commanded now."""
        width, later = len(self.names), None
        while self.received and self.received[-1] > received:
            later = self.received.pop(), self.values[-width:]
            self.stamps.pop()
            del self.values[-width:]
        if not self.received:
            return
        now = self.values[-width:]
        if later is not None:
            share = (received - self.received[-1]) / (later[0] - self.received[-1])
            now = array("d", (a + share * (b - a) for a, b in zip(now, later[1], strict=True)))
        self.add(stamp, received, now)

    def __len__(self) -> int:
        """Rows so far."""
        return len(self.stamps)

    def table(self) -> FloatArray:
        """(T, n) the rows."""
        return np.frombuffer(self.values, dtype=np.float64).reshape(len(self), len(self.names))

    def columns(self) -> Mapping[str, FloatArray]:
        """(T,) by name."""
        return dict(zip(self.names, self.table().T, strict=True))


def complete(streams: Sequence[Stream]) -> list[Stream]:
    """The streams, where those of one topic's measurements that share columns are one; what a message lacks is NaN."""
    result: list[Stream] = []
    for stream in streams:
        alike = [
            s for s in result if (s.topic, s.kind) == (stream.topic, Kind.measured) and set(s.names) & set(stream.names)
        ]
        if not alike:
            result.append(stream)
            continue
        parts = [*alike, stream]
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        whole = Stream(stream.topic, stream.kind, names)
        for part in parts:
            table = np.full((len(part), len(names)), np.nan)
            table[:, [names.index(name) for name in part.names]] = part.table()
            whole.stamps += part.stamps
            whole.received += part.received
            whole.values.frombytes(table.tobytes())
        result = [s for s in result if not any(s is each for each in alike)]
        result.append(whole)
    return result


def is_command(topic: str) -> bool:
    """Whether a topic's name says that it holds commands."""
    return any(word in topic.lower() for word in COMMAND_WORDS)


def place(topic: str, frame: str, generic: Sequence[str]) -> str:
    """Name of a sensor from its topic, without words that every such topic has; else its frame, else "main".

    Args:
        topic: Such as "/torso/imu/data".
        frame: `header.frame_id` of its messages.
        generic: Words that name no sensor, such as "imu" and "data".
    """
    for text in (topic, frame):
        words = [word for word in text.replace("/", "_").lower().split("_") if word and word not in generic]
        name = "_".join("".join(c for c in word if c.isalnum()) for word in words)
        if name:
            return name
    return "main"
