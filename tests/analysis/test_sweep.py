import os
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from drake_tc.analysis.sweep import SweepError, point_seed, processes, scheduler_executor, sweep
from drake_tc.errors import ParamsError
from tests.benchmarks.sweep_speed import sweep_rows

from . import sweep_functions as functions


@pytest.fixture(scope="module")
def pool():
    with processes(2) as executor:
        yield executor


def test_seeds_are_those_of_numpys_spawned_children():
    children = np.random.SeedSequence(7).spawn(5)
    wanted = [int(child.generate_state(1, np.uint64)[0]) >> 1 for child in children]
    assert [point_seed(7, i) for i in range(5)] == wanted
    assert len(set(wanted)) == 5
    assert sweep(lambda point, seed: seed, range(5), seed=7) == wanted


def test_the_same_bits_wherever_it_runs_and_in_whatever_chunks(pool):
    points = np.linspace(0.0, 1.0, 23).tolist()
    here = sweep(functions.drawn, points, seed=3)
    assert sweep(functions.drawn, points, seed=3, executor=pool) == here
    assert sweep(functions.drawn, points, seed=3, executor=pool, chunk=7) == here
    assert sweep(functions.drawn, points, seed=3, chunk=5) == here
    with ThreadPoolExecutor(2) as threads:
        assert sweep(functions.drawn, points, seed=3, executor=threads) == here
    assert sweep(functions.drawn, points, seed=4) != here


@pytest.mark.slow
def test_the_same_bits_on_a_dask_cluster_which_survives_a_killed_worker(tmp_path):
    distributed = pytest.importorskip("distributed")
    points = np.linspace(0.0, 1.0, 23).tolist()
    marked = [(number, str(tmp_path)) for number in range(20)]
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        scheduler_executor(cluster.scheduler_address) as executor,
    ):
        assert sweep(functions.drawn, points, seed=3, executor=executor) == sweep(functions.drawn, points, seed=3)
        found = sweep(functions.killed_once, marked, seed=1, executor=executor)
        assert found == [(number, point_seed(1, number)) for number in range(20)]
        assert (tmp_path / "been_3").exists() and (tmp_path / "been_17").exists()
        with pytest.raises(SweepError) as caught:
            sweep(functions.odd_ones_fail, range(4), executor=executor)
        assert caught.value.results == [0, None, 2, None]


def test_a_worker_that_a_broken_pool_forgets_is_ended_too():
    with processes(2) as own:
        for done in [own.submit(time.sleep, 0.5) for _ in range(2)]:
            done.result()
        killed, forgotten = own.processes
        forgotten.terminate = lambda: None
        killed.kill()
        with pytest.raises(BrokenExecutor):
            own.submit(time.sleep, 60.0).result()
        restart = threading.Thread(target=own.restart, daemon=True)
        restart.start()
        restart.join(20.0)
        forgotten.kill()  # so that a failure does not hang
        assert not restart.is_alive()
        assert own.submit(abs, -3).result() == 3


def test_a_killed_worker_loses_nothing(pool, tmp_path):
    marked = [(number, str(tmp_path)) for number in range(20)]
    found = sweep(functions.killed_once, marked, seed=1, executor=pool, chunk=3)
    assert found == [(number, point_seed(1, number)) for number in range(20)]
    assert (tmp_path / "been_3").exists() and (tmp_path / "been_17").exists()


def test_a_point_that_always_kills_its_worker_has_failed_and_no_other(pool):
    with pytest.raises(SweepError, match=r"point 5 \(5\): its process died 3 times") as caught:
        sweep(functions.always_killed, range(9), executor=pool, chunk=4)
    assert caught.value.results == [0, 1, 2, 3, 4, None, 6, 7, 8]
    assert [point.index for point in caught.value.failed] == [5]


def test_a_worker_that_dies_while_the_next_one_is_being_started_loses_nothing(monkeypatch):
    """Then the pool closes the pipes that the process being started is to have, and `submit` raises from there."""
    submit, closed = ProcessPoolExecutor.submit, iter([False, False, True])

    def submitted(self, *args, **kwargs):
        if next(closed, False):
            raise OSError("handle is closed")
        return submit(self, *args, **kwargs)

    monkeypatch.setattr(ProcessPoolExecutor, "submit", submitted)
    with processes(2) as executor:
        assert sweep(functions.square, range(9), executor=executor, chunk=2) == [number**2 for number in range(9)]
    assert next(closed, None) is None


@pytest.mark.parametrize("where", ["here", "processes"])
def test_an_exception_is_reported_with_its_point_in_one_line_and_the_rest_is_kept(pool, where):
    with pytest.raises(SweepError) as caught:
        sweep(functions.odd_ones_fail, [0, 1, 2, 3], executor=None if where == "here" else pool)
    assert str(caught.value) == "sweep: point 1 (1): ValueError: no odd numbers: 1; 2 of 4 points failed"
    assert caught.value.results == [0, None, 2, None]


def test_a_long_point_is_cut_in_the_message():
    with pytest.raises(SweepError) as caught:
        sweep(lambda point, seed: 1 / 0, [[0.0] * 1000])
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize(("function", "why"), [(lambda point, seed: 0, "lambda"), (functions.unsendable, "unsendable")])
def test_what_cannot_be_sent_is_refused_in_one_line(pool, function, why):
    with pytest.raises(ParamsError, match=f"can be pickled; .*{why}"):
        sweep(function, range(3), executor=pool)
    assert sweep(functions.square, range(3), executor=pool) == [0, 1, 4]  # the pool still works


def test_an_executor_that_cannot_be_restarted_says_what_to_use():
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as plain,
        pytest.raises(ParamsError, match=r"ProcessPoolExecutor died and it cannot be restarted; use processes"),
    ):
        sweep(functions.always_killed, range(9), executor=plain)


def test_a_script_that_its_workers_cannot_import_is_told_so_in_one_line():
    script = """
from drake_tc.analysis.sweep import processes, sweep
from tests.benchmarks.sweep_speed import busy_point
if __name__ == "__main__":
    with processes(1) as executor:
        sweep(busy_point, [1], executor=executor)
"""
    done = subprocess.run([sys.executable], input=script, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "ParamsError: sweep: worker processes die before they begin; a script" in done.stderr.splitlines()[-1]


def test_progress_ends_at_one_and_never_falls(pool):
    told = []
    for executor in (None, pool):
        told.clear()
        sweep(functions.square, range(200), executor=executor, progress=lambda text, share: told.append((text, share)))
        shares = [share for _, share in told]
        assert shares == sorted(shares) and told[-1] == ("200 of 200", 1.0)
        assert 40 <= len(told) <= 70


def test_nothing_to_do_and_bad_numbers():
    assert sweep(functions.square, []) == []
    with pytest.raises(ParamsError, match="chunk: expected at least 1"):
        sweep(functions.square, [1], chunk=0)
    with pytest.raises(ParamsError, match="workers: expected at least 1, got 0"), processes(0):
        pass


def test_linear_algebra_has_one_thread_while_it_runs_and_what_it_had_afterwards():
    def threads(point, seed):
        return max((entry["num_threads"] for entry in threadpool_info()), default=1)

    before = [entry["num_threads"] for entry in threadpool_info()]
    assert sweep(threads, [0]) == [1]
    assert [entry["num_threads"] for entry in threadpool_info()] == before


def test_an_interrupt_leaves_no_process_behind():
    told = threading.Event()

    def interrupt(text, share):
        told.set()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), processes(1) as executor:
        sweep(functions.square, range(1000), executor=executor, progress=interrupt)
    assert told.is_set()
    with pytest.raises(RuntimeError, match=r"after shutdown|not usable anymore"):
        executor.submit(os.getpid).result()


@pytest.mark.skipif("distributed" in sys.modules, reason="asks for its absence")
def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ParamsError, match=r"install drake-tc\[cluster\]"), scheduler_executor("tcp://127.0.0.1:1"):
        pass


@pytest.mark.slow
def test_nobody_answers_at_the_address():
    pytest.importorskip("distributed")
    with pytest.raises(ParamsError, match="expected a Dask scheduler"), scheduler_executor("tcp://127.0.0.1:1"):
        pass


@pytest.mark.slow
def test_the_benchmark_of_sweeps_has_its_rows():
    told = []
    rows = sweep_rows(lambda text, share: told.append(share), workers=2, repeats=1, points=8, side=3)
    assert [row.unit for row in rows] == ["-", "-", "s", "ms"] and all(row.value > 0.0 for row in rows)
    assert "8 points" in rows[0].name and "3 x 3" in rows[2].name
    assert told == sorted(told) and told[-1] == 1.0


class Rubbish(Executor):
    """A cluster whose workers send something else."""

    def __init__(self, sent):
        self.sent = sent

    def submit(self, function, /, *arguments, **more):
        future = Future()
        if isinstance(self.sent, BaseException):
            future.set_exception(self.sent)
        else:
            future.set_result(self.sent)
        return future


@pytest.mark.parametrize(
    "sent", [None, [], [1.0] * 99, b"\x80\x04rubbish", {"a": 1}, ValueError("bad magic"), EOFError(), OSError(5, "x")]
)
def test_a_worker_that_sends_rubbish_is_told_in_one_line(sent):
    with pytest.raises(ParamsError, match=r"^sweep: .*is the same version of drake_tc installed there\?$") as caught:
        sweep(functions.drawn, [0.0, 1.0], executor=Rubbish(sent))
    assert "\n" not in str(caught.value)
