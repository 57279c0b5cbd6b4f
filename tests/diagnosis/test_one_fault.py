"""Close-loop on logs of which one has a fault: effect and value are those of the sound logs, or it is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError

from .log_files import Logs, found, write_logs
from .rigs import Joint

NOISY = Joint(duration=12.0, torque_noise=0.25, encoder_step=1e-4, extra=lambda m: 1.2 * m.v * np.abs(m.v))
POSITION, CURRENT, TORQUE = "joint/position", "joint/current", "joint/torque"
Fault = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


def _rows(rng: np.random.Generator, table: pd.DataFrame) -> slice:
    at = int(rng.integers(5, len(table) - 900))
    return slice(at, at + int(rng.integers(30, 800)))


def zero(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[_rows(rng, table), rng.choice([POSITION, TORQUE])] = 0.0
    return table


def saturated(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
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
    rows = _rows(rng, table)
    return table.drop(index=range(rows.start, rows.stop)).reset_index(drop=True)


def blank(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[_rows(rng, table), rng.choice([POSITION, CURRENT, TORQUE])] = np.nan
    return table


def frozen(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    rows, name = _rows(rng, table), rng.choice([POSITION, TORQUE])
    table.loc[rows, name] = table.loc[rows.start, name]
    return table


def turned(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    name = rng.choice([CURRENT, TORQUE])
    return table.assign(**{name: -table[name]})


def clock(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    table.loc[rng.integers(5, len(table) - 5) :, "time"] += rng.choice([0.02, 0.5, 60.0])
    return table


MENDED: dict[str, Fault] = {
    each.__name__: each for each in (zero, saturated, spike, turn, gap, blank, frozen, turned, clock)
}


def reversed_time(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(time=table["time"].to_numpy()[::-1])


def exchanged(one: str, other: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{one: table[other], other: table[one]})

    return change


REFUSED: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "position and current": (exchanged(POSITION, CURRENT), "friction would drive joint in this run"),
    "position and torque": (exchanged(POSITION, TORQUE), "the joints of robots do not"),
    "current and torque": (exchanged(CURRENT, TORQUE), "'joint/current' and 'joint/torque' are exchanged"),
    "position turned": (lambda t: t.assign(**{POSITION: -t[POSITION]}), "column 'joint/position' has the wrong sign"),
    "torque in mN m": (lambda t: t.assign(**{TORQUE: 1e3 * t[TORQUE]}), "the runs are not of one joint"),
    "another joint": (lambda t: t.assign(**{CURRENT: 3.0 * t[CURRENT]}), "the runs are not of one joint"),
    "clock in ms": (lambda t: t.assign(time=1e3 * t["time"]), "units: {time: ms}"),
    "time backwards": (reversed_time, "time goes backwards"),
}


def with_fault(logs: Logs, folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Logs:
    """The logs with the first training run changed."""
    path = folder / "one.csv"
    change(pd.read_csv(logs.train[0])).to_csv(path, index=False)
    return replace(logs, train=(path, *logs.train[1:]))


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return write_logs(tmp_path_factory.mktemp("logs"), NOISY)


def value_of(report: dict[str, Any]) -> tuple[float, float]:
    """Value and half the 95 % interval of the quadratic friction."""
    assert found(report) == ["quadratic_viscous"]
    (effect,) = report["joints"]["joint"]["effects"]
    told = effect["parameters"]["quadratic_viscous"]
    return told["value"], 0.5 * float(np.ptp(told["ci95"]))


@pytest.fixture(scope="module")
def sound(logs: Logs) -> tuple[float, float]:
    return value_of(logs.report(assess_residual=False))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("fault", MENDED)
def test_one_fault_changes_no_diagnosis(logs, sound, tmp_path, fault, seed):
    rng = np.random.default_rng([seed, list(MENDED).index(fault)])
    report = with_fault(logs, tmp_path, lambda table: MENDED[fault](table, rng)).report(assess_residual=False)
    value, half = value_of(report)
    assert abs(value - sound[0]) <= half + sound[1]


@pytest.mark.parametrize("fault", REFUSED)
def test_a_run_that_contradicts_itself_or_the_others_is_refused(logs, tmp_path, fault):
    change, says = REFUSED[fault]
    with pytest.raises(LogError) as caught:
        with_fault(logs, tmp_path, change).report(assess_residual=False)
    assert says in str(caught.value) and str(caught.value).startswith(str(tmp_path / "one.csv"))
    assert "\n" not in str(caught.value)
