"""`bench sweep`: what processes gain on a sweep, and how long a map of 10^4 loops takes."""

import time
from collections.abc import Callable

from drake_tc.analysis.stability_map import Axis, stability_map
from drake_tc.analysis.sweep import processes, sweep
from drake_tc.control.joint_loop import JointLoop
from tests.benchmarks.figures import BenchmarkRow

Progress = Callable[[str, float], None]
WORK = 400_000
"""Steps of arithmetic a point: a few hundredths of a second."""


def busy_point(point: int, seed: int) -> float:
    """A fixed amount of arithmetic in the interpreter; the time that it took [s]."""
    begin, total = time.perf_counter(), 0.0
    for i in range(point):
        total += i * 0.5
    return time.perf_counter() - begin


def sweep_rows(
    progress: Progress, workers: int = 2, repeats: int = 3, points: int = 192, side: int = 100
) -> list[BenchmarkRow]:
    """Speed-up of two processes over one, both spawned and warm, and a stability map of side x side loops.

    The points' own time over wall time says how busy the processes were kept, also where others use the machine.

    Args:
        progress: Told what is timed and which share is done.
        workers: Processes.
        repeats: Timings of the speed-up; the two are taken in turn, as a shared machine's speed changes.
        points: Of the sweep that is timed.
        side: Windows and gains of the map.
    """
    work = [WORK] * points
    gains, busy = [], []
    with processes(1) as alone, processes(workers) as many:
        for executor, number in ((alone, 1), (many, workers)):
            sweep(busy_point, [WORK] * 4 * number, executor=executor, chunk=1)
        for turn in range(repeats):
            progress(f"speed-up, turn {turn + 1} of {repeats}", 0.6 * turn / repeats)
            seconds = []
            for executor in (alone, many):
                begin = time.perf_counter()
                own = sweep(busy_point, work, executor=executor)
                seconds.append(time.perf_counter() - begin)
            gains.append(seconds[0] / seconds[1])
            busy.append(sum(own) / seconds[1])
        progress("map of 10^4 loops", 0.6)
        loop = JointLoop.with_equivalent_gains(
            1.0, 0.01, inertia=1.0, link_inertia=0.4, k_tau=1e-4, k_v=7e-3, k_tau_model=1e-4, k_v_model=7e-3
        )
        x = Axis("window", tuple(float(n) for n in range(3, 3 + side)))
        y = Axis("kp", tuple(5.0 / side * k for k in range(side)))
        begin = time.perf_counter()
        found = stability_map(loop, x, y, executor=many, progress=lambda text, share: progress(text, 0.6 + 0.4 * share))
        seconds_of_map = time.perf_counter() - begin
    each = 1e3 * workers * seconds_of_map / found.radius.size
    ordered, kept = sorted(gains), sorted(busy)
    name = f"speed-up of {workers} processes over one, {points} points"
    share_of_time = f"points' own time over wall time, {workers} processes"
    return [
        BenchmarkRow(name, ordered[len(ordered) // 2], "-", p99=ordered[-1], n=repeats),
        BenchmarkRow(share_of_time, kept[len(kept) // 2], "-", p99=kept[-1], n=repeats),
        BenchmarkRow(f"stability map of {side} x {side} loops", seconds_of_map, "s"),
        BenchmarkRow("one loop of that map, on one core", each, "ms"),
    ]
