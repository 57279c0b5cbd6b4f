"""How late the ticks of a real-time controller are, at 1 kHz against the simulated leg in another process, on LCM.

Of several rounds the one with the fewest missed deadlines counts: what other processes of the machine take is theirs.
"""

import subprocess
import sys
from collections.abc import Callable

from drake_tc.diagrams.hardware_loop import controller
from drake_tc.errors import ParamsError
from drake_tc.hardware.lcm_link import LcmLink
from drake_tc.hardware.link import real_time_priority
from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec, RunReport
from drake_tc.hardware.stepper import ControllerStepper
from tests.benchmarks.figures import BenchmarkRow

PRIORITY = 40
URL = "udpm://239.255.76.68:7668?ttl=0"
"""A bus of its own, so that a robot on the default one is left alone."""
ROBOT = "from drake_tc.diagrams.hardware_loop import robot; from drake_tc.hardware.simulated_robot import serve"


def permitted_priority() -> int:
    """`PRIORITY` where the process may have it, else 0."""
    try:
        with real_time_priority(PRIORITY):
            return PRIORITY
    except ParamsError:
        return 0


def measured(seconds: float, priority: int) -> RunReport:
    """One round.

    Args:
        seconds: From the first command to the stop.
        priority: Of both processes.
    """
    code = f"{ROBOT}; serve(robot(), {URL!r}, priority={priority and priority + 1})"
    robot = subprocess.Popen([sys.executable, "-c", code])
    try:
        made = controller()
        link = LcmLink(ControllerStepper(made, made.controlled.period).inputs, len(made.controlled.joints), URL)
        spec = RealTimeSpec(patience=60.0, stop_time=0.2, priority=priority)
        return RealTimeLoop(made, link, spec).run(seconds)
    finally:
        robot.terminate()
        robot.wait(30.0)


def real_time_rows(seconds: float, rounds: int, report: Callable[[str, float], None]) -> list[BenchmarkRow]:
    """Figures of the best round.

    Args:
        seconds: Of a round.
        rounds: How many.
        report: Told what is done and which share.
    """
    priority, reports = permitted_priority(), []
    for number in range(rounds):
        report(f"round {number + 1} of {rounds}", number / rounds)
        reports.append(measured(seconds, priority))
    best = min(reports, key=lambda each: (each.ended != "duration", each.miss_share))
    note = f"best of {rounds} rounds of {seconds:g} s, " + (f"SCHED_FIFO {priority}" if priority else "no priority")
    counts, n = best.counts, best.counts.ticks
    flags = ", ".join(f"{name} {number}" for name, number in best.flags.items())
    rows = [BenchmarkRow("deadlines missed", best.miss_share, "share", n=n, note=note)]
    rows += [
        BenchmarkRow(name, float(value), n=n, note=flags if "held" in name else "")
        for name, value in (
            ("ticks skipped", counts.skipped),
            ("readings late", counts.late),
            ("readings missing", counts.missing),
            ("ticks held before the stop", max(counts.held - round(0.2 / best.period), 0)),
            ("errors", counts.link_errors + counts.controller_errors),
        )
    ]
    titles = {"wake": "tick began late by", "work": "tick took"}
    shares = best.percentiles()
    return rows + [
        BenchmarkRow(f"{titles[name]}: {share.replace('_', '.')}", 1e6 * value, "us", n=n)
        for name, found in shares.items()
        for share, value in found.items()
    ]
