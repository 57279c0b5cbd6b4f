"""Where a sweep runs: processes of this machine that come back when one dies, or a Dask cluster."""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, forkserver, get_context
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from drake_tc.errors import ParamsError

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
