"""What must not change a diagnosis: order of the files, units, the direction of the joint, and the seed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from .log_files import Logs, figures, found, write_logs
from .rigs import Joint

NOISY = Joint(duration=8.0, period=4e-3, torque_noise=0.25, encoder_step=1e-4, extra=lambda m: 1.2 * m.v * np.abs(m.v))
LOOKED_FOR = ("quadratic_viscous", "load_dependent_friction", "torque_ripple", "delay.loop")
SAME = {"rtol": 1e-6, "atol": 0.0}
"""The same arithmetic in another order, or through the 17 digits of a CSV file in other units."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return write_logs(tmp_path_factory.mktemp("logs"), NOISY)


@pytest.fixture(scope="module")
def plain(logs: Logs) -> dict[str, Any]:
    report = logs.report(*LOOKED_FOR)
    assert found(report) == ["quadratic_viscous"]
    return report


def require_same(report: dict[str, Any], plain: dict[str, Any]) -> None:
    assert report["verdict"] == plain["verdict"]
    assert found(report) == found(plain)
    assert_allclose(figures(report), figures(plain), **SAME)


def other_units(table: pd.DataFrame) -> pd.DataFrame:
    factors = {"position": 180.0 / np.pi, "current": 1e3, "torque": 1e3}
    return table.assign(**{f"joint/{name}": table[f"joint/{name}"] * factor for name, factor in factors.items()})


def test_order_units_and_direction_together_change_nothing(tmp_path, plain: dict[str, Any]) -> None:
    """Rows of `cases/faults.py` tell them apart."""
    units = {"position": "-deg", "current": "-mA", "torque": "-mN*m"}
    made = write_logs(tmp_path, NOISY, other_units, {"units": units})
    require_same(replace(made, train=made.train[::-1]).report(*LOOKED_FOR), plain)


def test_the_seed_of_the_resampling_changes_no_figure(logs: Logs, plain: dict[str, Any]) -> None:
    require_same(logs.report(*LOOKED_FOR, seed=1), plain)
