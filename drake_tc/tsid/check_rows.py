"""Rows of tasks and limits, checked once where a law is built: a wrong shape is an error there and not a lost tick."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.limits.base import Limit
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows
from drake_tc.tsid.tasks.base import Task
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

T = TypeVar("T")


def check_rows(terms: Terms, tasks: Sequence[Task], limits: Sequence[Limit]) -> None:
    """Evaluate each task at its own rest reference and each limit, and check what comes.

    Args:
        terms: At a state where all rows must be finite, the robot's start.
        tasks: Of a law.
        limits: Of a law.

    Raises:
        ParamsError: `rest` or `rows` failed, or an array has another shape or type than the protocols say; the message
            names the task or limit.
    """
    for task in tasks:
        _check_task(f"task {task.name!r}", task, terms)
    for limit in limits:
        _check_limit(f"limit {limit.name!r}", limit, terms)


def _check_task(who: str, task: Task, terms: Terms) -> None:
    reference = _evaluated(f"{who}: rest", lambda: task.rest(terms))
    _expect(f"{who}: rest", reference, (task.reference_size,))
    rows = _evaluated(f"{who}: rows", lambda: task.rows(terms, reference))
    if not isinstance(rows, TaskRows):
        raise ParamsError(f"{who}: rows must return TaskRows, got {type(rows).__name__}")
    count = _length(f"{who}: target", rows.target)
    _expect(f"{who}: weight", rows.weight, (count,))
    _check_parts(who, rows.matrix, count, terms)
    for name, values in (("target", rows.target), ("weight", rows.weight)):
        if not np.isfinite(values).all():
            raise ParamsError(f"{who}: {name} is not finite at the robot's starting posture: {values.tolist()}")


def _check_limit(who: str, limit: Limit, terms: Terms) -> None:
    rows = _evaluated(f"{who}: rows", lambda: limit.rows(terms))
    if not isinstance(rows, LimitRows):
        raise ParamsError(f"{who}: rows must return LimitRows, got {type(rows).__name__}")
    count = _length(f"{who}: lower", rows.lower)
    _expect(f"{who}: upper", rows.upper, (count,))
    _check_parts(who, rows.matrix, count, terms)
    if len(rows.labels) != count:
        raise ParamsError(f"{who}: expected {count} labels, one a row, got {len(rows.labels)}")
    if np.isnan(rows.lower).any() or np.isnan(rows.upper).any():
        raise ParamsError(f"{who}: lower or upper is NaN at the robot's starting posture; infinite means no limit")


def _check_parts(who: str, matrix: Parts, count: int, terms: Terms) -> None:
    if not isinstance(matrix, Parts):
        raise ParamsError(f"{who}: matrix must be Parts(vdot=..., force=..., torque=...), got {type(matrix).__name__}")
    columns = {"vdot": terms.bias.size, "force": terms.contact_bias.size, "torque": terms.actuated.size}
    for name, width in columns.items():
        part = getattr(matrix, name)
        if part is not None:
            _expect(f"{who}: matrix.{name}", part, (count, width))
            if not np.isfinite(part).all():
                raise ParamsError(f"{who}: matrix.{name} is not finite at the robot's starting posture")


def _evaluated(what: str, call: Callable[[], T]) -> T:
    try:
        return call()
    except Exception as error:
        raise ParamsError(f"{what} failed at the robot's starting posture: {type(error).__name__}: {error}") from error


def _length(what: str, values: FloatArray) -> int:
    if not (isinstance(values, np.ndarray) and values.ndim == 1):
        raise ParamsError(f"{what} must be an array of one dimension, got shape {np.shape(values)}")
    return int(values.size)


def _expect(what: str, values: FloatArray, shape: tuple[int, ...]) -> None:
    if not (isinstance(values, np.ndarray) and values.shape == shape):
        raise ParamsError(f"{what}: expected an array of shape {shape}, got shape {np.shape(values)}")
