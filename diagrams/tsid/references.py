"""What a scenario asks of the tasks and the contacts over time, as sources of the controller's ports."""

from collections.abc import Mapping, Sequence

import numpy as np
from drake_tc.diagrams.tsid.scenario import KnotSpec, SpanSpec
from pydrake.polynomial import Polynomial
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.law import Law
from drake_tc.tsid.tasks.base import Task
from drake_tc.tsid.tasks.com import ComTask
from drake_tc.tsid.tasks.frame import FrameTask
from drake_tc.types import FloatArray

POSITION = {ComTask: (0, 3, 6), FrameTask: (4, 10, 16)}
"""Where position, velocity and acceleration stand in the reference of a task that can be moved."""


def task_source(law: Law, name: str, spec: KnotSpec) -> TrajectorySource:
    """A source of the reference of the task `name`, its resting place moved along the knots.

    Raises:
        ParamsError: no such task, one that has no place, or times that do not increase.
    """
    tasks = {task.name: task for task in law.tasks}
    movable = [key for key, task in tasks.items() if type(task) in POSITION]
    if name not in movable:
        raise ParamsError(f"motion: wanted one of the tasks {', '.join(movable)}; got {name!r}")
    task: Task = tasks[name]
    rest = task.rest(law.starting_terms())
    try:
        path = knot_trajectory(spec.times, spec.offsets)
    except ParamsError as error:
        raise ParamsError(f"motion.{name}: {error}") from None
    return TrajectorySource(_moved(rest, path, POSITION[type(task)]))


def _moved(rest: FloatArray, path: PiecewisePolynomial, places: tuple[int, int, int]) -> PiecewisePolynomial:
    """(m,) `rest` with a path (3,) added at its position, and the path's derivatives at the other two places."""
    orders = [path, path.derivative(1), path.derivative(2)]
    pieces = []
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
    """A source of `active_contacts`: 0 while a contact is lifted, else 1; it changes half a tick early.

    Raises:
        ParamsError: a contact that is not there.
    """
    names = [contact.name for contact in contacts]
    for name in lifted:
        if name not in names:
            raise ParamsError(f"lifted: no contact {name!r}; contacts: {', '.join(names) or 'none'}")
    spans = [span for every in lifted.values() for span in every]
    edges = {t for span in spans for t in (span.begin, span.end) if 0.0 < t <= duration}
    times = np.array(sorted({0.0, *edges, duration + 1.0}))
    values = np.ones((len(names), times.size))
    for name, every in lifted.items():
        for span in every:
            values[names.index(name), (span.begin <= times) & (times < span.end)] = 0.0
    breaks = times.copy()
    breaks[1:] -= 0.5 * period
    return TrajectorySource(PiecewisePolynomial.ZeroOrderHold(breaks, values))
