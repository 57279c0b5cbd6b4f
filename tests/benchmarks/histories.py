"""Histories of simulated joints: repeated sessions of one joint that wears, for the trends of `compare --history`.

The joints are those of `months`, without a lubricant whose friction follows the temperature, so that the true rate of
each parameter is known. From session to session friction differs by a hundredth beside its drift, and the drive gain
not at all; the room, the motions and the loads are others. Half of all parameters do not drift.
"""

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from drake_tc.joint_simulator.spec import Drive, Joint, RigSpec, Sensors
from drake_tc.loops.recording import Progress
from tests.benchmarks.blind.joints import draw_joint, draw_pendulum
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.months import DURATION, RATE, SESSION_SPREAD, record, write_rig

SESSIONS, SPAN_DAYS = 6, 180.0
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
LARGEST = {"viscous": 0.4, "coulomb": 0.4, "gain": 0.05}
"""Largest relative drift over the whole history."""
NAMES = {"viscous": "viscous.viscous", "coulomb": "coulomb.coulomb", "gain": "drive.gain"}
SIZE = {"viscous": "damping", "coulomb": "coulomb", "gain": "gain"}
"""What of the simulated joint the parameter of the model is."""


@dataclass(frozen=True)
class History:
    """One joint, the days of its sessions, and what it is on each of them.

    Attributes:
        first: Rig on the day of the model.
        days: (S,) since then. later: Rigs of the sessions, without the spread from session to session.
        slopes: By name of the parameter, the true rate [unit/day].
    """

    first: RigSpec
    days: tuple[float, ...]
    later: tuple[RigSpec, ...]
    slopes: dict[str, float]


@dataclass(frozen=True)
class ToldTrend:
    """Of one parameter of one joint: the true rate, and value and interval of the trend's.

    `invented`: for each session of the joint, whether an effect was told, of which there is none.
    """

    number: int
    name: str
    slope: float
    found: float
    ci95: tuple[float, float]
    invented: tuple[bool, ...]

    @property
    def holds(self) -> bool:
        """Whether the interval holds the true rate."""
        return self.ci95[0] <= self.slope <= self.ci95[1]


def draw_history(seed: int, number: int) -> History:
    """The joint of this number."""
    rng = np.random.default_rng([seed, number, 54])
    pendulum = draw_pendulum(rng) if rng.random() < 0.3 else None
    drives: tuple[Drive, ...] = ("current", "voltage", "position_servo")
    joint = draw_joint(rng, drives[number % 3], pendulum=pendulum)
    first = RigSpec(
        name=f"history_{number}", group="null", kind="none", strength="", joint=joint, seed=int(rng.integers(2**31)),
        sensors=Sensors(rate_hz=RATE, torque_noise=float(rng.uniform(0.05, 0.25))), pendulum=pendulum,
        duration=DURATION,
    )  # fmt: skip
    drift = {name: float(rng.uniform(-most, most) * (rng.random() < 0.5)) for name, most in LARGEST.items()}
    days = tuple(float(day) for day in np.sort(rng.uniform(0.05, 1.0, SESSIONS) * SPAN_DAYS))
    later = []
    for day in days:
        own = _after(joint, drift, day)
        own = replace(own, ambient=joint.ambient + float(rng.normal(0.0, 1.0)))
        later.append(replace(first, joint=own, seed=int(rng.integers(2**31)), hand=float(rng.uniform(0.6, 1.3))))
    end = _after(joint, drift, SPAN_DAYS)
    slopes = {NAMES[n]: (getattr(end, of) - getattr(joint, of)) / SPAN_DAYS for n, of in SIZE.items()}
    return History(first, days, tuple(later), slopes)


def _after(joint: Joint, drift: dict[str, float], day: float) -> Joint:
    """The joint after some days; of the viscous friction the part that no drive causes drifts."""
    share = day / SPAN_DAYS
    return replace(joint, **{name: getattr(joint, name) * (1.0 + share * size) for name, size in drift.items()})


def watch_history(seed: int, number: int, root: Path) -> list[ToldTrend]:
    """Simulate, diagnose, compare session by session, and read the trends."""
    import warnings

    from drake_tc.diagnosis.options import DiagnosisOptions
    from drake_tc.diagnosis.result.models import models_of
    from drake_tc.diagnosis.run import close_loop
    from drake_tc.errors import DrakeTcError
    from drake_tc.watch.compare import compare
    from drake_tc.watch.history import add_session, read_history, trends

    warnings.simplefilter("ignore")
    history, folder = draw_history(seed, number), root / f"history_{number}"
    kept, options = folder / "history", DiagnosisOptions(assess_residual=False)
    invented: list[bool] = []
    rng = np.random.default_rng([history.first.seed, 1])
    then = record(history.first, ("static", "sine", "multisine"), folder, "then", np.ones(2), rng)
    write_rig(history.first, folder)
    models_of(close_loop(folder / "rig.yaml", then[:2], then[2:], options), folder)
    for session, (day, spec) in enumerate(zip(history.days, history.later, strict=True)):
        spread = np.exp(rng.normal(0.0, SESSION_SPREAD, 2))
        logs = record(spec, ("static", "multisine"), folder, f"day_{session}", spread, rng)
        try:
            found = compare(folder / "model_after.yaml", logs, options=options)
            invented.append(found.verdict == "new_effect")
        except DrakeTcError:
            continue  # a session that is refused leaves no record
        add_session(found, kept, "unit", BEGIN + timedelta(days=day))
    drawn = trends(read_history(kept), "unit", "joint")
    return [
        ToldTrend(number, name, slope, drawn[name].slope, drawn[name].slope_ci95, tuple(invented))
        for name, slope in history.slopes.items()
        if name in drawn
    ]


def told_histories(seed: int, count: int, folder: Path, pool: Executor, progress: Progress) -> list[ToldTrend]:
    """The trends of `count` joints."""
    waiting = [pool.submit(watch_history, seed, number, folder) for number in range(count)]
    out: list[ToldTrend] = []
    for done, each in enumerate(waiting):
        out += each.result()
        progress("histories", (done + 1) / max(count, 1))
    return out


def history_rows(told: list[ToldTrend]) -> list[BenchmarkRow]:
    """Shares of trends whose interval holds the true rate, and of drifts that are seen or invented."""
    still = [t for t in told if t.slope == 0.0]
    moving = [t for t in told if t.slope != 0.0]
    invented = [each for t in told if t.name == NAMES["gain"] for each in t.invented]
    rows = [
        BenchmarkRow.share("trends whose interval holds the true rate", [t.holds for t in told], "within", 0.95, 0.03),
        BenchmarkRow.share("sessions in which an effect is told that is not there", invented, "max", 0.01),
        BenchmarkRow.share("trends of what does not drift: told to drift", [not t.holds for t in still]),
        BenchmarkRow.share("trends of what drifts: told to drift", [not t.ci95[0] <= 0.0 <= t.ci95[1] for t in moving]),
    ]
    names = dict.fromkeys(t.name for t in told)
    return rows + [
        BenchmarkRow.share(f"trends of {name}: interval holds", [t.holds for t in told if t.name == name])
        for name in names
    ]
