"""Where a sweep runs: processes of this machine that come back when one dies, or a Dask cluster.

`sweep`: a function at many points, through any executor, with the same results bit for bit.

What a worker of a sweep does: points one after another, each with its own seed, on one thread of linear algebra.
"""

import math
import os
import pickle
import reprlib
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, forkserver, get_context
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.errors import DrakeTcError, ParamsError

T = TypeVar("T")
END_TIME = 2.0
"""A worker that was asked to end does so within this time [s]."""
QUIET_TRACKER = "ignore::UserWarning:multiprocessing.resource_tracker"
"""Python's own tracker of semaphores cleans up after an interrupted command, and would write to stderr that it did."""
CONNECT_TIME = 10.0
"""A scheduler answers within this time [s]."""


class RestartingProcesses(Executor):
    """Spawned processes, as `concurrent.futures.ProcessPoolExecutor`; after one has died, `restart` starts all anew.

    The pool belongs to the caller's own process and is not part of any result, so it may change.

    Attributes:
        workers: Most processes at a time.
        processes: Those that were started; one thread submits, so that they are told from those of others.
    """

    def __init__(self, workers: int, preload: Sequence[str] = ()) -> None:
        """Start no worker yet; workers come with the first call. See `processes` for `preload`.

        Raises:
            ParamsError: less than one worker.
        """
        if workers < 1:
            raise ParamsError(f"workers: expected at least 1, got {workers}")
        self.workers = workers
        self.processes: set[BaseProcess] = set()
        self._preload = tuple(preload)
        self._pool = self._fresh()

    def _fresh(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self.workers, mp_context=_context(self._preload), initializer=threadpool_limits, initargs=(1,)
        )

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """As `Executor.submit`; a pool that has broken, or breaks meanwhile, gives a future that says so."""
        broken: Future[T] = Future()
        before = set(active_children())
        try:
            with _deaf_to_interrupts():
                return self._pool.submit(fn, *args, **kwargs)
        except BrokenExecutor as error:
            broken.set_exception(error)
        except OSError as error:  # a process died while the next one was being started: its pipes are closed
            broken.set_exception(BrokenProcessPool(f"no process could be started: {error}"))
        finally:
            self.processes |= set(active_children()) - before
        return broken

    def restart(self) -> None:
        """New processes; what was under way is lost.

        A broken pool asks its processes to end and waits for them, but does not ask one that was being started when
        another one died. So all of them are killed here.
        """
        for worker in self.processes:
            worker.kill()
        self.processes.clear()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._fresh()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """As `Executor.shutdown`."""
        self._pool.shutdown(wait=wait, cancel_futures=cancel_futures)


def _context(preload: Sequence[str]) -> BaseContext:
    """How processes are started: spawned, or, where modules are preloaded, forked from a server that has them."""
    if QUIET_TRACKER not in sys.warnoptions:  # what processes that are started from now on are told
        sys.warnoptions.append(QUIET_TRACKER)
    if not preload or sys.platform != "linux":  # elsewhere system libraries do not survive a fork
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(list(preload))
    with _deaf_to_interrupts():
        forkserver.ensure_running()
    return context


@contextmanager
def processes(workers: int, preload: Sequence[str] = ()) -> Iterator[RestartingProcesses]:
    """Worker processes, ended on the way out; after an exception or an interrupt at once, whatever they compute.

    Never forked from the caller: a script that uses them guards its own start by `if __name__ == "__main__":`.

    Args:
        workers: How many.
        preload: Modules that all of them need and that take long to import. On Linux one server imports them, once and
            beside the caller, and every worker is a fork of it; the first server of a process serves all later calls.

    Raises:
        ParamsError: less than one worker.
    """
    before = set(active_children())
    pool = RestartingProcesses(workers, preload)
    try:
        yield pool
    except BaseException:
        _end(set(active_children()) - before)
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown(cancel_futures=True)


def _end(workers: Iterable[BaseProcess]) -> None:
    """Ask processes to end, and end those that have not done so in time."""
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.join(END_TIME)
        if worker.is_alive():
            worker.kill()


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes that are started within the block never see SIGINT: it is the caller's to handle, who ends them.

    The caller gets an interrupt of the meantime when the block ends.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def scheduler_executor(address: str) -> Iterator[Executor]:
    """The workers of the Dask scheduler at `address`, such as "tcp://127.0.0.1:8786"; they need drake_tc installed.

    Raises:
        ParamsError: Dask is not installed, or nothing answers at the address.
    """
    try:
        import distributed
    except ImportError:
        raise ParamsError("scheduler: expected the package `distributed`; install drake-tc[cluster]") from None
    dask: Any = distributed
    try:
        client = dask.Client(address, timeout=CONNECT_TIME, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ParamsError(
            f"scheduler {address!r}: expected a Dask scheduler, such as tcp://127.0.0.1:8786; {error or 'no answer'}"
        ) from None
    with client:
        executor: Executor = client.get_executor(pure=False)
        yield executor


__all__ = ["FailedPoint", "SweepError", "point_seed", "processes", "scheduler_executor", "sweep"]


Function = Callable[[Any, int], Any]
"""Of a point and its seed."""
LONGEST_POINT = 120
"""Characters of a point in a message."""


@dataclass(frozen=True)
class FailedPoint:
    """A point that has no result.

    Attributes:
        index: Where it stands among the points.
        point: Itself, as text.
        why: The exception, or that its process died; one line.
    """

    index: int
    point: str
    why: str

    def __str__(self) -> str:
        return f"point {self.index} ({self.point}): {self.why}"


def point_seed(seed: int, index: int) -> int:
    """The point's own seed, below 2^63: of child `index` of numpy's `SeedSequence(seed)`, whoever computes it."""
    child = np.random.SeedSequence(seed, spawn_key=(index,))
    return int(child.generate_state(1, np.uint64)[0] >> np.uint64(1))


def failed(index: int, point: object, why: str) -> FailedPoint:
    """A failed point, its texts cut down to one line."""
    text = " ".join(repr(point).split())
    short = text if len(text) <= LONGEST_POINT else f"{text[: LONGEST_POINT - 3]}..."
    return FailedPoint(index, short, " ".join(why.split()))


def run_points(function: Function, points: Sequence[tuple[int, Any]], seed: int, caller: int) -> list[Any]:
    """The results of some (index, point); a FailedPoint where the function raises.

    Linear algebra on several threads sums in another order: outside the process `caller`, where `sweep` itself sees
    to that, it is held to one from here on.
    """
    if os.getpid() != caller:
        threadpool_limits(1)
    out: list[Any] = []
    for index, point in points:
        try:
            out.append(function(point, point_seed(seed, index)))
        except Exception as error:
            name = "" if isinstance(error, DrakeTcError) else f"{type(error).__name__}: "
            out.append(failed(index, point, f"{name}{error}"))
    return out


Progress = Callable[[str, float], None]
Item = tuple[int, Any]
CHUNKS = 64
"""About so many chunks, where their size is not given."""
TRIES = 3
"""A point whose process dies this often, when nothing else runs beside it, has failed."""


class SweepError(DrakeTcError):
    """Points that failed, after all others were done.

    Attributes:
        results: In the order of the points; None where a point failed.
        failed: Those points.
    """

    def __init__(self, results: list[Any], failed: Sequence[FailedPoint]) -> None:
        """Name the first one, and how many there are."""
        more = f"; {len(failed)} of {len(results)} points failed" if len(failed) > 1 else ""
        super().__init__(f"sweep: {failed[0]}{more}")
        self.results, self.failed = results, tuple(failed)


def sweep(
    function: Function,
    points: Iterable[Any],
    *,
    executor: Executor | None = None,
    chunk: int | None = None,
    progress: Progress | None = None,
    seed: int = 0,
) -> list[Any]:
    """function(point, seed of the point) at every point.

    The seed of point i is that of child i of numpy's `SeedSequence(seed)`, and linear algebra runs on one thread
    everywhere: the results do not depend on who computes them, nor on chunks and their order (on machines of one kind;
    another CPU may round differently). A worker that dies is restarted and its points are done again; a point at which
    it dies time after time has failed. A point that fails takes no other with it.

    Args:
        function: At the top of a module, so that it can be sent to a process.
        points: What can be pickled.
        executor: Any of `concurrent.futures`, `processes(n)` or `scheduler_executor(address)`; None: here, one by one.
        chunk: Points that are sent together; None: such that there are about 64 chunks.
        progress: Told how many are done, and which share.
        seed: Of the sweep.

    Returns:
        One result a point, in the order of the points.

    Raises:
        SweepError: points failed; it has the results of all others.
        ParamsError: a function or point that cannot be sent, or an executor that died and cannot be restarted.
    """
    items = list(enumerate(points))
    size = max(1, math.ceil(len(items) / CHUNKS)) if chunk is None else chunk
    if size < 1:
        raise ParamsError(f"chunk: expected at least 1 point, got {chunk}")
    chunks = [items[first : first + size] for first in range(0, len(items), size)]
    results: list[Any] = [None] * len(items)
    done = 0

    def keep(part: Sequence[Item], values: Sequence[Any]) -> None:
        nonlocal done
        for (index, _), value in zip(part, values, strict=True):
            results[index] = value
        done += len(part)
        if progress:
            progress(f"{done} of {len(items)}", done / len(items))

    with threadpool_limits(1):
        if executor is None:
            for part in chunks:
                keep(part, run_points(function, part, seed, os.getpid()))
        else:
            _Dispatch(executor, function, seed, keep).run(chunks)
    wrong = [value for value in results if isinstance(value, FailedPoint)]
    if wrong:
        raise SweepError([None if isinstance(value, FailedPoint) else value for value in results], wrong)
    return results


class _Dispatch:
    """Chunks through an executor: as many under way as keep it busy, lost ones again, the second time alone."""

    def __init__(
        self, executor: Executor, function: Function, seed: int, keep: Callable[[Sequence[Item], Sequence[Any]], None]
    ) -> None:
        self._executor, self._function, self._seed, self._keep = executor, function, seed, keep
        workers = getattr(executor, "workers", getattr(executor, "_max_workers", None))
        self._most = 2 * workers + 1 if workers else None

    def run(self, chunks: Sequence[Sequence[Item]]) -> None:
        """All chunks. A chunk lost twice comes to single points, one at a time: only then is it known whose fault."""
        suspects = self._side_by_side(self._side_by_side(chunks))
        for item in (item for part in suspects for item in part):
            self._alone(item)

    def _submit(self, part: Sequence[Item]) -> Future[list[Any]]:
        return self._executor.submit(run_points, self._function, part, self._seed, os.getpid())

    def _side_by_side(self, chunks: Sequence[Sequence[Item]]) -> list[Sequence[Item]]:
        """Run the chunks; those that were under way when a worker died are returned."""
        waiting, lost = deque(chunks), []
        running: dict[Future[list[Any]], Sequence[Item]] = {}
        try:
            while waiting or running:
                while waiting and (self._most is None or len(running) < self._most):
                    part = waiting.popleft()
                    running[self._submit(part)] = part
                finished = wait(running, return_when=FIRST_COMPLETED).done
                broken = False
                for future in finished:
                    part = running.pop(future)
                    values, died = self._outcome(future, part)
                    if died is None:
                        self._keep(part, values)
                    else:
                        broken = broken or isinstance(died, BrokenExecutor)
                        lost.append(part)
                if broken:
                    lost += self._settle(running)
                    running.clear()
                    self._restart()
        finally:
            for future in running:
                future.cancel()
        return lost

    def _settle(self, running: dict[Future[list[Any]], Sequence[Item]]) -> list[Sequence[Item]]:
        """Of a broken pool: keep what was finished, return the rest."""
        lost = []
        wait(running)
        for future, part in running.items():
            values, died = self._outcome(future, part)
            if died is None:
                self._keep(part, values)
            else:
                lost.append(part)
        return lost

    def _alone(self, item: Item) -> None:
        """One point while nothing else runs."""
        for _ in range(TRIES):
            values, died = self._outcome(self._submit([item]), [item])
            if died is None:
                self._keep([item], values)
                return
            if isinstance(died, BrokenExecutor):
                self._restart()
        self._keep([item], [failed(*item, f"its process died {TRIES} times")])

    def _restart(self) -> None:
        restart = getattr(self._executor, "restart", None)
        if restart is None:
            raise ParamsError(
                f"executor: a worker of {type(self._executor).__name__} died and it cannot be restarted;"
                " use processes(n) of drake_tc.analysis.sweep"
            )
        restart()
        try:
            self._executor.submit(os.getpid).result()
        except BrokenExecutor:
            raise ParamsError(
                "sweep: worker processes die before they begin; a script that starts them needs a file of its own and"
                ' `if __name__ == "__main__":` around its start'
            ) from None

    def _outcome(self, future: Future[list[Any]], part: Sequence[Item]) -> tuple[list[Any], BaseException | None]:
        """(values, None), or ([], what killed the worker).

        Raises:
            ParamsError: the chunk could not be sent, or its results not sent back, or what came back is none.
        """
        try:
            values: Any = future.result()
            if isinstance(values, list) and len(values) == len(part):
                return values, None
            raise ParamsError(
                f"sweep: a worker sent {reprlib.repr(values)} for {len(part)} points; expected a list of as many"
                " results: is the same version of drake_tc installed there?"
            )
        except (BrokenExecutor, CancelledError) as error:
            return [], error
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            name = getattr(self._function, "__qualname__", repr(self._function))
            raise ParamsError(
                f"sweep: expected a function, points and results that can be pickled; {name}: {error}"
            ) from None
        except Exception as error:
            if type(error).__name__ == "KilledWorker":  # of Dask, which need not be installed
                return [], error
            if isinstance(error, ParamsError):
                raise
            # what a function raises comes back as a FailedPoint: this one is of the way there or back
            raise ParamsError(
                f"sweep: what a worker sent cannot be read ({type(error).__name__}: {reprlib.repr(str(error))});"
                " is the same version of drake_tc installed there?"
            ) from error
