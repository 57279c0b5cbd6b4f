"""What a scenario asks of the tasks and the contacts over time, as sources of the controller's ports.

What moves, where it goes or turns, and when, as data.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.polynomial import Polynomial
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.control.reference_source import ReferenceSource
from drake_tc.control.references import Path, Slerp, Swing
from drake_tc.control.rotation import quaternion_of, rotation_matrix
from drake_tc.control.trajectories import Chain, knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.law import Law
from drake_tc.tsid.rows import Task
from drake_tc.tsid.tasks import ComTask, FrameTask, OrientationTask
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class TurnSpec:
    """How an orientation turns about an axis of the world: through angles, resting at each, or to and fro.

    Attributes:
        axis: Of any length but zero.
        times: Of the angles [s], increasing, two at least; none for to and fro.
        angles: From its resting orientation [rad], one a time.
        amplitude: Of the motion to and fro [rad]; with no times.
        frequency_hz: Of that [Hz].
        begin: When it starts [s].
        rise: In which its amplitude grows from 0 [s].
    """

    axis: tuple[float, ...]
    times: tuple[float, ...] = ()
    angles: tuple[float, ...] = ()
    amplitude: float = 0.0
    frequency_hz: float = 1.0
    begin: float = 0.0
    rise: float = 1.0

    def __post_init__(self) -> None:
        if len(self.axis) != 3:
            raise ParamsError(f"turn.axis: expected three numbers, got {len(self.axis)}")
        if len(self.times) == 1 or len(self.angles) != len(self.times):
            raise ParamsError(
                f"turn: expected no times, or two or more and as many angles, got {len(self.times)} and"
                f" {len(self.angles)}"
            )
        if self.times and self.amplitude:
            raise ParamsError("turn: expected either times and angles or an amplitude, got both")
        if not all(later > earlier for earlier, later in pairwise(self.times)):
            raise ParamsError(f"turn.times: expected increasing times [s], got {list(self.times)}")


@dataclass(frozen=True)
class KnotSpec:
    """Where a task goes: its resting place moved by offsets, joined smoothly, at rest at both ends; or how it turns.

    Attributes:
        times: Of the knots [s], increasing, two at least.
        offsets: One a knot, [x, y, z] in the world [m].
        turn: In place of knots, for an orientation.
    """

    times: tuple[float, ...] = ()
    offsets: tuple[tuple[float, ...], ...] = ()
    turn: TurnSpec | None = None

    def __post_init__(self) -> None:
        if self.turn is not None and not self.times and not self.offsets:
            return
        if self.turn is not None:
            raise ParamsError("motion: expected either times and offsets or a turn, got both")
        if len(self.times) < 2 or len(self.offsets) != len(self.times):
            raise ParamsError(
                f"motion: expected two times or more and as many offsets, got {len(self.times)} and {len(self.offsets)}"
            )
        if any(len(offset) != 3 for offset in self.offsets):
            raise ParamsError("motion: expected offsets of three numbers [x, y, z]")


@dataclass(frozen=True)
class SpanSpec:
    """A stretch of time, begin <= t < end.

    Attributes:
        begin: Its begin [s].
        end: Its end [s].
    """

    begin: float
    end: float = math.inf

    def __post_init__(self) -> None:
        if not self.begin < self.end:
            raise ParamsError(f"span: expected begin < end [s], got {self.begin:g} and {self.end:g}")


POSITION = {ComTask: (0, 3, 6), FrameTask: (4, 10, 16)}
"""Where position, velocity and acceleration stand in the reference of a task that can be moved."""
ROUNDING = 1e-6
"""Of a tick, by which a time may be later than it and still count as at it."""


def task_source(law: Law, name: str, spec: KnotSpec) -> TrajectorySource | ReferenceSource:
    """A source of the reference of the task `name`, its resting place moved along the knots, or turned.

    Raises:
        ParamsError: no such task, one that has no place or does not turn, or times that do not increase.
    """
    tasks = {task.name: task for task in law.tasks}
    if spec.turn is not None:
        turning = [key for key, task in tasks.items() if isinstance(task, OrientationTask)]
        if name not in turning:
            raise ParamsError(
                f"motion: turn: expected one of the tasks of orientation: {', '.join(turning) or 'none'}, got {name!r}"
            )
        return ReferenceSource(_turned(tasks[name].rest(law.starting_terms())[:4], spec.turn))
    movable = [key for key, task in tasks.items() if type(task) in POSITION]
    if name not in movable:
        raise ParamsError(f"motion: expected one of the tasks {', '.join(movable)}, got {name!r}")
    task: Task = tasks[name]
    rest = task.rest(law.starting_terms())
    try:
        path = knot_trajectory(spec.times, spec.offsets)
    except ParamsError as error:
        raise ParamsError(f"motion.{name}: {error}") from None
    return TrajectorySource(_moved(rest, path, POSITION[type(task)]))


def _turned(rest: FloatArray, turn: TurnSpec) -> Path:
    """The orientation `rest` (quaternion) as it turns."""
    start, axis = _quadruple(rest), np.array(turn.axis)
    if not turn.times:
        x, y, z = turn.axis
        return Swing(start, (x, y, z), turn.amplitude, turn.frequency_hz, turn.begin, turn.rise)
    length = np.linalg.norm(axis)
    if not length > 0.0:
        raise ParamsError("motion: turn.axis: expected a direction, got zero")
    first = rotation_matrix(rest)
    half = [0.5 * angle for angle in turn.angles]
    turns = [rotation_matrix(np.array([np.cos(a), *(np.sin(a) * axis / length)])) for a in half]
    places = [_quadruple(quaternion_of(matrix @ first)) for matrix in turns]
    spans = zip(pairwise(turn.times), pairwise(places), strict=True)
    return Chain(tuple(Slerp(one, other, begin, end - begin) for (begin, end), (one, other) in spans))


def _quadruple(values: FloatArray) -> tuple[float, float, float, float]:
    w, x, y, z = values.tolist()
    return w, x, y, z


def _moved(rest: FloatArray, path: PiecewisePolynomial, places: tuple[int, int, int]) -> PiecewisePolynomial:
    """(m,) `rest` with a path (3,) added at its position, and the path's derivatives at the other two places."""
    orders = [path, path.derivative(1), path.derivative(2)]
    pieces: list[Any] = []
    for segment in range(path.get_number_of_segments()):
        rows = [[Polynomial(value)] for value in rest.tolist()]
        for order, first in zip(orders, places, strict=True):
            for axis in range(3):
                rows[first + axis][0] = rows[first + axis][0] + order.getPolynomial(segment, axis, 0)
        pieces.append(np.array(rows))
    return PiecewisePolynomial(pieces, path.get_segment_times())


def contact_source(
    contacts: Sequence[Contact], lifted: Mapping[str, Sequence[SpanSpec]], duration: float, period: float
) -> TrajectorySource:
    """A source of `active_contacts`: 0 at the ticks at which a contact is lifted, else 1; it changes half a tick early.

    Raises:
        ParamsError: a contact that is not there.
    """
    names = [contact.name for contact in contacts]
    for name in lifted:
        if name not in names:
            raise ParamsError(f"lifted: no contact {name!r}; contacts: {', '.join(names) or 'none'}")
    last = math.ceil(duration / period) + 1

    def tick(instant: float) -> int:
        """The first at this time or later."""
        return min(max(math.ceil(min(instant, duration + period) / period - ROUNDING), 0), last)

    spans = {name: [(tick(span.begin), tick(span.end)) for span in every] for name, every in lifted.items()}
    ticks = np.array(sorted({0, last, *(edge for every in spans.values() for span in every for edge in span)}))
    values = np.ones((len(names), ticks.size))
    for name, every in spans.items():
        for begin, end in every:
            values[names.index(name), (begin <= ticks) & (ticks < end)] = 0.0
    breaks = np.maximum(ticks - 0.5, 0.0) * period
    hold: Any = PiecewisePolynomial.ZeroOrderHold  # the stubs ask for lists; the functions take arrays too
    return TrajectorySource(hold(breaks, values))
