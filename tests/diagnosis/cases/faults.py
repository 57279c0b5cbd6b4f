# ruff: noqa: E501  (one row of the table a line)
"""One run with a fault among sound ones, input that is refused, and other ways to write the same logs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.logs.record import Run

from ..log_files import Change
from ..rigs import Joint, Logged, record, servo
from .case import ANY, Case, Is, Record, Recorded
from .recorders import SHIFTS, logs_of, recorder, rig_of, scaled, written

NOISY = Joint(duration=12.0, torque_noise=0.25, encoder_step=1e-4, extra=lambda m: 1.2 * m.v * np.abs(m.v))
QUIET = Joint(duration=24.0, torque_noise=0.05, encoder_step=1e-5)
POSITION, CURRENT, TORQUE = "joint/position", "joint/current", "joint/torque"
Fault = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


def rows(rng: np.random.Generator, table: pd.DataFrame) -> slice:
    at = int(rng.integers(5, len(table) - 900))
    return slice(at, at + int(rng.integers(30, 800)))


def zero(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[rows(rng, table), rng.choice([POSITION, TORQUE])] = 0.0
    return table


def clipped(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    name = rng.choice([POSITION, TORQUE])
    limit = rng.uniform(0.5, 0.9) * table[name].abs().max()
    return table.assign(**{name: table[name].clip(-limit, limit)})


def spike(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    name = rng.choice([POSITION, TORQUE])
    table.loc[rng.integers(5, len(table) - 5), name] += 30.0 * np.ptp(table[name])
    return table


def turn(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[rng.integers(5, len(table) - 5) :, POSITION] += 2.0 * np.pi
    return table


def gap(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    lost = rows(rng, table)
    return table.drop(index=range(lost.start, lost.stop)).reset_index(drop=True)


def blank(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[rows(rng, table), rng.choice([POSITION, CURRENT, TORQUE])] = np.nan
    return table


def frozen(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    still, name = rows(rng, table), rng.choice([POSITION, TORQUE])
    table.loc[still, name] = table.loc[still.start, name]
    return table


def turned(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    name = rng.choice([CURRENT, TORQUE])
    return table.assign(**{name: -table[name]})


def clock(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[rng.integers(5, len(table) - 5) :, "time"] += rng.choice([0.02, 0.5, 60.0])
    return table


def first_run(fault: Fault, joint: Joint = NOISY) -> Record:
    """The first training run has the fault."""

    def run(number: int, seed: int) -> Run | pd.DataFrame:
        made = record(joint, f"run_{number}", SHIFTS[number], number)
        table = pd.DataFrame({"time": made.time, **made.columns})
        return made if number else fault(table, np.random.default_rng(seed))

    return recorder(rig_of(joint), run)


def only(change: Change) -> Fault:
    return lambda table, rng: change(table)


def exchanged(one: str, other: str) -> Fault:
    return lambda table, rng: table.assign(**{one: table[other], other: table[one]})


DRAG = {"quadratic_viscous": {"quadratic_viscous": Is(1.2, 0.05)}}
REFUSED: dict[str, tuple[Fault, str]] = {
    "position and current exchanged": (exchanged(POSITION, CURRENT), "friction would drive joint in this run"),
    "position and torque exchanged": (exchanged(POSITION, TORQUE), "the joints of robots do not"),
    "current and torque exchanged": (exchanged(CURRENT, TORQUE), "'joint/current' and 'joint/torque' are exchanged"),
    "position turned": (only(scaled(position=-1.0)), "column 'joint/position' has the wrong sign"),
    "torque in mN m": (only(scaled(torque=1e3)), "the runs are not of one joint"),
    "another joint": (only(scaled(current=3.0)), "the runs are not of one joint"),
    "clock in ms": (only(lambda t: t.assign(time=1e3 * t["time"])), r"units: \{time: ms\}"),
    "time backwards": (only(lambda t: t.assign(time=t["time"].to_numpy()[::-1])), "time goes backwards"),
}
MENDED = (zero, clipped, spike, turn, gap, blank, frozen, turned, clock)

# ---- gross errors of all runs

SHORT = replace(QUIET, duration=8.0)
SIGNS = {
    "of a servo": servo(duration=8.0, torque_noise=0.25, encoder_step=1e-5),
    "under much friction": replace(SHORT, coulomb=30.0, viscous=20.0, torque_noise=0.25),
    "of a noisy sensor": replace(SHORT, torque_noise=8.0),
}


def moving(q: Callable[[np.ndarray], np.ndarray], noise: float = 1e-4) -> Record:
    """A motion beside a current and a torque that have nothing to do with it."""
    log = Logged(duration=8.0)

    def run(number: int, seed: int) -> Run:
        time, rng = log.times(), np.random.default_rng([seed, number])
        position = q(time + 0.37 * number) + noise * rng.standard_normal(time.size)
        columns = {
            POSITION: position,
            CURRENT: np.sin(time),
            TORQUE: np.cos(time) + 0.1 * rng.standard_normal(time.size),
        }
        return log.run(f"run_{number}", columns)

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 0.3}}, run)


def steady(number: int, seed: int) -> Run:
    """One constant speed: viscous and Coulomb friction are the same column."""
    log = Logged(duration=12.0)
    time, rng = log.times(), np.random.default_rng([seed, number])
    load = 4.0 * np.sin(2.0 * np.pi * 0.29 * time + number)
    columns = {
        POSITION: 0.3 * time + 1e-5 * rng.standard_normal(time.size),
        CURRENT: 0.08 * (load + 6.0 * 0.3 + 3.0),
        TORQUE: load + 0.1 * rng.standard_normal(time.size),
    }
    return log.run(f"run_{number}", columns)


def with_held(of: Callable[[Recorded], list[Path]]) -> Record:
    def write(folder: Path, seed: int) -> Recorded:
        made = logs_of(replace(QUIET, duration=6.0))(folder, seed)
        return replace(made, held=of(made))

    return write


def as_parquet(made: Recorded) -> list[Path]:
    """The first training run in another format."""
    path = made.rig.parent / "again.parquet"
    with np.load(made.train[0]) as log:
        pd.DataFrame(dict(log)).to_parquet(path, index=False)
    return [path]


def alone(folder: Path, seed: int) -> Recorded:
    made = logs_of(QUIET)(folder, seed)
    return Recorded(made.rig, made.train[:1], [])


GROSS = [
    *(Case(f"faults: a torque of the wrong sign {name}", logs_of(joint, scaled(torque=-1.0)), verdicts=ANY, may_refuse="sign") for name, joint in SIGNS.items()),
    *(Case(f"faults: a torque of the right sign {name}", logs_of(joint)) for name, joint in SIGNS.items()),
    Case("faults: a current of the wrong sign in all runs", logs_of(SHORT, scaled(current=-1.0)), verdicts=ANY, may_refuse="sign|current"),
    Case("faults: all columns turned are a joint in the other direction",
         logs_of(SHORT, scaled(position=-1.0, torque=-1.0, current=-1.0)), values={"drive.gain": Is(0.08, 0.01)}),
    Case("faults: degrees declared as radians are refused", logs_of(QUIET, scaled(position=180.0 / np.pi), {"units": {"position": "rad"}}), refusal="deg"),
    Case("faults: a run that is fitted and held out is refused", with_held(lambda made: list(made.train[:1])), refusal="same"),
    Case("faults: a run that is held out in another format is refused", with_held(as_parquet), refusal="same"),
    Case("faults: one run is refused", alone, refusal="two"),
    Case("faults: one constant speed is refused", recorder(rig_of(NOISY), steady), refusal="cannot tell|one direction"),
    Case("faults: a joint that rests is refused", moving(lambda t: 0.0 * t), refusal="too little motion"),
    Case("faults: a rig file without a drive is refused", recorder({"joint": "joint"}, lambda n, s: record(QUIET, f"run_{n}", SHIFTS[n])), refusal="drive"),
    Case("faults: an unknown key of the rig file is refused", logs_of(SHORT, rig={"drive_gian": 0.08}), refusal="drive_gian.*drive_gain"),
    Case("faults: a declared effect that nobody knows is refused", logs_of(SHORT, rig={"declared": {"stribek": None}}), refusal="stribek.*stribeck"),
    Case("faults: a missing column is refused", logs_of(SHORT, lambda t: t.drop(columns=CURRENT)), refusal="no column.*joint/current"),
]  # fmt: skip

# ---- the same logs, written in another way

PLAIN = logs_of(NOISY)
MIXED = logs_of([NOISY, replace(NOISY, period=5e-3), NOISY])


def swapped(of: Record) -> Record:
    def write(folder: Path, seed: int) -> Recorded:
        made = of(folder, seed)
        return replace(made, train=[*made.train][::-1])

    return write


def renamed(folder: Path, seed: int) -> Recorded:
    made = [
        record(NOISY, name, shift, 1000 * seed + n) for n, (name, shift) in enumerate(zip("zam", SHIFTS, strict=False))
    ]
    return written(folder, rig_of(NOISY), made)


TWINS: dict[str, tuple[Record, Record]] = {
    "the order of the files": (PLAIN, swapped(PLAIN)),
    "the order of files of different periods": (MIXED, swapped(MIXED)),
    "the names of the files": (PLAIN, renamed),
    "units": (PLAIN, logs_of(NOISY, scaled(position=180.0 / np.pi, current=1e3, torque=1e3),
                             {"units": {"position": "deg", "current": "mA", "torque": "mN*m"}})),
    "the direction of the joint": (PLAIN, logs_of(NOISY, rig={"units": {"position": "-rad", "current": "-A", "torque": "-N*m"}})),
    "a clock that begins later": (PLAIN, logs_of(NOISY, lambda table: table.assign(time=table["time"] + 1000.0))),
}  # fmt: skip

CASES = [
    *(Case(f"faults: one run with {fault.__name__}", first_run(fault), DRAG, seeds=(0, 1)) for fault in MENDED),
    *(Case(f"faults: one run, {name}, is refused", first_run(fault), refusal=rf"run_0\.npz.*{says}") for name, (fault, says) in REFUSED.items()),
    *GROSS,
    *(Case(f"faults: {name} changes nothing", record_, DRAG, twin=twin, verdicts=ANY) for name, (record_, twin) in TWINS.items()),
]  # fmt: skip
