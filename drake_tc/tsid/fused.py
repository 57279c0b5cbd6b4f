"""The problem of a tick by one compiled call (`drake_tc.kernels.tsid.problem`), and what it is called with.

A whole tick by one compiled call (`drake_tc.kernels.tsid.warm_tick`), from where the last tick ended.

Tasks and limits of a law become tables, one set for each set of active contacts.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.assembly import AffineMap
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.model import SHORTEST, TsidModel
from drake_tc.tsid.program_solver import over_y, sizes_of
from drake_tc.tsid.robust import convex
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.measures import BOX_DAMPING, EXACT, WIDTH
from drake_tc.tsid.robust.scaled import ScaledProblem, ScaledRows, TorqueError
from drake_tc.tsid.rows import LeastSquares, Limit, Parts, Task, Terms
from drake_tc.types import FloatArray, IntArray

WRITTEN_OUT = 0
TASK_KINDS = ("", "com", "posture", "frame", "orientation", "force", "torque", "momentum", "pressure")
LIMIT_KINDS = ("", "bounds", "forces", "viable")
"""In the order of the constants of `drake_tc.kernels.tsid.rows`."""
_COLUMNS, KIND, ROWS = 5, 0, 1


class Entry(NamedTuple):
    """A task or limit as numbers.

    Attributes:
        kind: One of the kinds.
        rows: How many.
        integers: As `drake_tc.kernels.tsid.rows` reads them.
        numbers: The same.
    """

    kind: str
    rows: int
    integers: tuple[Any, ...]
    numbers: tuple[Any, ...]


class Tables(NamedTuple):
    """Of one set of active contacts.

    Attributes:
        tasks: (., 5).
        limits: (., 5), in the order of the rows.
        integers: What both point into.
        numbers: The same.
        free_tasks: Places of tasks that give no numbers of their own, and are asked for rows each tick.
        free_limits: The same of limits, as places in their table.
    """

    tasks: IntArray
    limits: IntArray
    integers: IntArray
    numbers: FloatArray
    free_tasks: tuple[int, ...]
    free_limits: tuple[int, ...]


def entry_of(item: Any, contacts: ActiveContacts) -> Entry | None:
    """Numbers of a task or limit; None where it has none, or where a subclass gives other rows than they say."""
    mine, theirs = _definer(item, "compiled_entry"), _definer(item, "rows")
    if mine is None or theirs is None or "rows" in getattr(item, "__dict__", {}) or not issubclass(mine, theirs):
        return None
    entry: Entry = item.compiled_entry(contacts)
    return entry


def _definer(item: Any, name: str) -> Any:
    return next((each for each in type(item).__mro__ if name in vars(each)), None)


def tables_of(tasks: Sequence[Any], limits: Sequence[Any], contacts: ActiveContacts) -> Tables:
    """Numbers of all tasks and limits."""
    integers: list[IntArray] = []
    numbers: list[FloatArray] = []
    free_tasks, free_limits = [], []
    reference, task_table, limit_table = 0, [], []
    for place, task in enumerate(tasks):
        entry = entry_of(task, contacts)
        task_table.append(_row(entry, TASK_KINDS, integers, numbers, reference))
        reference += task.reference_size
        if entry is None:
            free_tasks.append(place)
    for place, limit in enumerate(limits):
        entry = entry_of(limit, contacts)
        limit_table.append(_row(entry, LIMIT_KINDS, integers, numbers, 0))
        if entry is None:
            free_limits.append(place)
    return Tables(
        np.array(task_table, dtype=np.int64).reshape(-1, _COLUMNS),
        np.array(limit_table, dtype=np.int64).reshape(-1, _COLUMNS),
        np.concatenate([np.zeros(0, dtype=np.int64), *integers]),
        np.concatenate([np.zeros(0), *numbers]),
        tuple(free_tasks),
        tuple(free_limits),
    )


def _row(
    entry: Entry | None, kinds: tuple[str, ...], integers: list[IntArray], numbers: list[FloatArray], reference: int
) -> list[int]:
    if entry is None:
        return [WRITTEN_OUT, 0, 0, 0, reference]
    row = [kinds.index(entry.kind), entry.rows, _size(integers), _size(numbers), reference]
    integers += [np.atleast_1d(np.asarray(part, dtype=np.int64)).ravel() for part in entry.integers]
    numbers += [np.atleast_1d(np.asarray(part, dtype=np.float64)).ravel() for part in entry.numbers]
    return row


def _size(parts: Sequence[Any]) -> int:
    return sum(part.size for part in parts)


_PROBLEM = Kernel("tsid.problem", "problem")
NO_POSE, LOST = 1, 2
"""As `drake_tc.kernels.tsid.problem` has them."""


class ProgramResult(NamedTuple):
    """Of one tick.

    Attributes:
        code: LOST where an input is not finite or too large, NO_POSE where a base's quaternion says nothing, else 0.
        causes: Accelerations and forces that torques cause.
        scaled: The problem over the torques.
        relaxed: For how many rows of limits one gave way.
    """

    code: int
    causes: AffineMap
    scaled: ScaledProblem
    relaxed: int


class WrittenRows(NamedTuple):
    """Rows of tasks and limits that are not tables, over (vdot, f, tau) and two columns more, at one state.

    Attributes:
        rows: (., nv + k + n + 2); of tasks target and weight come last, of limits the two sides.
        task_sizes: How many of each task, in their order.
        limit_sizes: The same of limits.
        relaxed: For how many rows of limits one gave way.
    """

    rows: FloatArray
    task_sizes: tuple[int, ...]
    limit_sizes: tuple[int, ...]
    relaxed: int


NO_ROWS = WrittenRows(np.zeros((0, 0)), (), (), 0)


LARGEST = 1e6
"""No input in SI units is as large; one that is counts as not finite. R is clipped to it in a status."""


class FusedProblem:
    """One compiled call a tick; holds constants alone, so that many contexts share it.

    Attributes:
        asks: Whether tasks or limits are no tables, and give their rows at each state.
    """

    def __init__(
        self,
        model: TsidModel,
        tasks: Sequence[Task],
        limits: Sequence[Limit],
        error: TorqueError,
        damping: float,
    ) -> None:
        """Prepare the constants.

        Args:
            model: Of the robot.
            tasks: Of the law.
            limits: In the order of their rows.
            error: Of the torques.
            damping: Of the contacts [1/s].
        """
        self._model, self._tasks, self._limits, self._error = model, tuple(tasks), tuple(limits), error
        numbers = LARGEST, SHORTEST, damping, model.mass, model.nq, model.nv, error.plain
        self._options: FloatArray = np.array(numbers, dtype=np.float64)
        self._tables: dict[tuple[int, ...], Tables] = {}
        self._arguments: dict[tuple[int, ...], tuple[Any, ...]] = {}
        first = self.tables(model.create_scratch().select(None))
        self.asks = bool(first.free_tasks or first.free_limits)
        bounded = first.limits.size > 0 and first.limits[0, KIND] == LIMIT_KINDS.index("bounds")
        self._bounds = model.n if bounded else 0

    def tables(self, contacts: ActiveContacts) -> Tables:
        """Of all tasks and limits while these contacts carry; each set is made once."""
        known = self._tables.get(contacts.index)
        if known is None:
            known = self._tables[contacts.index] = tables_of(self._tasks, self._limits, contacts)
        return known

    def written_out(self, terms: Terms, references: Sequence[FloatArray]) -> WrittenRows:
        """Rows of the tasks and limits that are no tables."""
        tables, sizes = self.tables(terms.contacts), sizes_of(terms)
        tasks = [self._tasks[i].rows(terms, references[i]) for i in tables.free_tasks]
        limits = [self._limits[row].rows(terms) for row in tables.free_limits]
        blocks = [_block(rows.matrix, sizes, rows.target, rows.weight) for rows in tasks]
        blocks += [_block(rows.matrix, sizes, rows.lower, rows.upper) for rows in limits]
        return WrittenRows(
            np.concatenate([np.zeros((0, sum(sizes) + 2)), *blocks]),
            tuple(rows.target.size for rows in tasks),
            tuple(rows.lower.size for rows in limits),
            sum(rows.relaxed for rows in limits),
        )

    def task_sizes(self, contacts: ActiveContacts, written: WrittenRows) -> list[int]:
        """Rows of each task; arguments as `arguments` takes them."""
        tables = self.tables(contacts)
        tasks = _sized(tables, written)[0] if self.asks else tables.tasks
        sizes: list[int] = tasks[:, ROWS].tolist()
        return sizes

    def arguments(self, contacts: ActiveContacts, written: WrittenRows) -> tuple[Any, ...]:
        """The law as the compiled call takes it (`kernels.tsid.problem.LAW`); each set of contacts' is made once.

        Args:
            contacts: That carry.
            written: Rows of tasks and limits that are no tables.
        """
        known = None if self.asks else self._arguments.get(contacts.index)
        if known is None:
            model, tables, error = self._model, self.tables(contacts), self._error
            tasks, limits = _sized(tables, written) if self.asks else (tables.tasks, tables.limits)
            places = contacts.places, model.actuated, model.positions
            tabled = tasks, limits, tables.integers, tables.numbers, written.rows
            known = model.tree_arguments, (*places, *tabled, error.scale, error.root, self._options, contacts.entries)
            if not self.asks:
                self._arguments[contacts.index] = known
        return known

    def problem(self, given: FloatArray, contacts: ActiveContacts, written: WrittenRows) -> ProgramResult:
        """The problem at a state.

        Args:
            given: (nq + nv + .,) q, v and all references.
            contacts: That carry.
            written: Rows of tasks and limits that are no tables.
        """
        code, relaxed, motion, push, cost, target, rows, lower, upper, noise, certain, _, sure = _PROBLEM(
            given, self.arguments(contacts, written)
        )
        error = self._error
        whole = ScaledRows(rows, lower, upper, self._bounds)
        scaled = ScaledProblem(LeastSquares(cost, target), whole, certain, sure, noise, error.scale)
        return ProgramResult(code, AffineMap(motion, push), scaled, relaxed + written.relaxed)


def _block(parts: Parts, sizes: tuple[int, int, int], first: FloatArray, second: FloatArray) -> FloatArray:
    return np.concatenate([over_y(parts, sizes), first[:, None], second[:, None]], axis=1)


def _sized(tables: Tables, written: WrittenRows) -> tuple[IntArray, IntArray]:
    """The tables with the places of the rows that are written out."""
    tasks, limits, start = tables.tasks.copy(), tables.limits.copy(), 0
    for table, places, sizes in (
        (tasks, tables.free_tasks, written.task_sizes),
        (limits, tables.free_limits, written.limit_sizes),
    ):
        for place, size in zip(places, sizes, strict=True):
            table[place, ROWS : ROWS + 2] = size, start
            start += size
    return tasks, limits


_WARM_TICK = Kernel("tsid.warm_tick", "warm_tick")
_FOUND = 0
"""As `drake_tc.kernels.tsid.problem` has it."""
_RELAXED = 7
"""`drake_tc.tsid.law.Status.RELAXED`."""


class WarmTick:
    """One compiled call a tick; holds constants alone, so that many contexts share it."""

    def __init__(self, fused: FusedProblem, formulation: Formulation, model: TsidModel) -> None:
        """Prepare the constants.

        Args:
            fused: The problem of a tick.
            formulation: One that this `solves`.
            model: Of the robot.
        """
        measure, options = formulation.measure, formulation.options
        weight = 0.0 if measure == "classic" else formulation.weight
        boxed, kind = measure == "box", convex.RECTANGLE if measure == "rectangle" else convex.PLAIN
        weights = (0.0, weight) if boxed else (weight, 0.0)
        accuracy, exact = options.accuracy * weight, EXACT if measure == "classic" else 0.0
        numbers = kind, *weights, BOX_DAMPING * weights[1], WIDTH, accuracy, exact
        ends = options.budget.iterations, LARGEST, model.force_size
        self._form: FloatArray = np.array((*numbers, *ends), dtype=np.float64)
        self._fused, self._relaxed = fused, model.n + model.nv + model.force_size + _RELAXED

    @staticmethod
    def solves(formulation: Formulation) -> bool:
        """Whether it is a trade-off by one program, and no clock may end it."""
        one = formulation.use == "trade_off" or formulation.measure == "classic"
        return type(formulation) is Formulation and one and math.isinf(formulation.options.budget.seconds)

    def __call__(
        self,
        given: FloatArray,
        contacts: ActiveContacts,
        written: WrittenRows,
        before: FloatArray,
        after: FloatArray,
    ) -> bool:
        """The tick; False where there is no problem, or no torque of it by this call alone.

        Args:
            given: (nq + nv + .,) q, v and all references.
            contacts: That carry.
            written: Rows of tasks and limits that are no tables.
            before: (S,) what the last tick left, as `TickMemory` lays it out.
            after: (S,) the same of this tick, written where there is one.
        """
        code: int = _WARM_TICK(given, self._fused.arguments(contacts, written), self._form, before, after)
        if code == _FOUND and written.relaxed:
            after[self._relaxed] += written.relaxed
        return code == _FOUND
