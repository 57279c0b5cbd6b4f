"""What commands with sweeps share: who computes, and for which joints."""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING

from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.analysis.tracking_error import JointTask


@contextmanager
def worker_executor(workers: int, scheduler: str | None) -> Iterator[Executor | None]:
    """Processes of this machine, a Dask cluster where an address is given, or None for one worker: this process.

    Raises:
        ParamsError: nothing answers at the address, or Dask is not installed.
    """
    from drake_tc.analysis.sweep import processes, scheduler_executor

    if scheduler is not None:
        with scheduler_executor(scheduler) as executor:
            yield executor
    elif workers > 1:
        with processes(workers) as executor:
            yield executor
    else:
        yield None


def tasks_of(tasks: Sequence["JointTask"], joints: Sequence[str] | None) -> list["JointTask"]:
    """The tasks of some joints, of all where none is named.

    Raises:
        ParamsError: a joint that is not there.
    """
    names = [task.joint for task in tasks]
    for joint in joints or []:
        if joint not in names:
            raise ParamsError(f"no joint {joint!r}; joints: {', '.join(names)}")
    return [task for task in tasks if not joints or task.joint in joints]
