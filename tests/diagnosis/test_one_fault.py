"""Close-loop on logs of which one contradicts itself or the others: it is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import LogError

from .log_files import Logs, write_logs
from .rigs import Joint

NOISY = Joint(duration=12.0, torque_noise=0.25, encoder_step=1e-4, extra=lambda m: 1.2 * m.v * np.abs(m.v))
POSITION, CURRENT, TORQUE = "joint/position", "joint/current", "joint/torque"


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


@pytest.mark.parametrize("fault", REFUSED)
def test_a_run_that_contradicts_itself_or_the_others_is_refused(logs, tmp_path, fault):
    change, says = REFUSED[fault]
    with pytest.raises(LogError) as caught:
        with_fault(logs, tmp_path, change).report(assess_residual=False)
    assert says in str(caught.value) and str(caught.value).startswith(str(tmp_path / "one.csv"))
    assert "\n" not in str(caught.value)
