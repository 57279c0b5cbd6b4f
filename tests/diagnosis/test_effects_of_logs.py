"""Causes that only some logs can show, each found by the whole search among all effects of the library, and alone.

The motion is a closed form and so is the effort that the drive is asked for. The recorded torque is what the drive
delivers of it, less friction and the rotor's inertia, so the simulation integrates nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lsim

from .log_files import Change, write_logs
from .rigs import Joint, Motion, servo

QUIET = Joint(torque_noise=0.05, encoder_step=1e-5)
VOLTAGE = replace(QUIET, drive="voltage", gain=0.4)
BACK_EMF = 1.2
"""k_e of the winding [V s/rad]."""


def asked(joint: Joint, m: Motion) -> np.ndarray:
    """The effort (T,) that the drive is asked for."""
    return joint.gain * (m.tau + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v))


def delivering(joint: Joint, drive: Callable[[Motion, np.ndarray], np.ndarray]) -> Joint:
    """The joint whose drive acts on `drive(motion, effort)` instead of the effort; the load takes the difference."""

    def changed(m: Motion) -> np.ndarray:
        effort = asked(joint, m)
        return np.asarray((drive(m, effort) - effort) / joint.gain)

    return replace(joint, sensor=changed)


def supply(time: np.ndarray) -> np.ndarray:
    """A battery under a load that comes and goes [V]."""
    return 24.0 + 3.0 * np.sin(1.3 * time)


def celsius(time: np.ndarray) -> np.ndarray:
    """A winding that warms by 60 K and cools down again."""
    return 25.0 + 60.0 * np.sin(np.pi * time / 16.0) ** 2


def winding_current(m: Motion, effort: np.ndarray) -> np.ndarray:
    """R i + k_e qdot (T,) of T di/dt + i = (V - k_e qdot)/R: what acts beside a back-EMF that counts as friction."""
    response = effort - BACK_EMF * m.v
    _, lagged, _ = lsim(([1.0], [0.02, 1.0]), response - response[0], m.time)
    return np.asarray(lagged + response[0] + BACK_EMF * m.v)


def warm(m: Motion, effort: np.ndarray) -> np.ndarray:
    """R_25 i + k_e qdot (T,) of R i = V - k_e qdot, R = R_25 (1 + 0.0039 (T - 25))."""
    return np.asarray((effort - BACK_EMF * m.v) / (1.0 + 0.0039 * (celsius(m.time) - 25.0)) + BACK_EMF * m.v)


def gear_loss(m: Motion) -> np.ndarray:
    """15 % of the load's torque while the joint drives the load, 35 % while the load drives the joint."""
    passed = m.tau
    return np.asarray(np.where(passed * m.v > 0.0, 0.15, 0.35) * np.abs(passed) * np.sign(m.v))


def late(column: str, delay: float) -> Change:
    """The column as it was `delay` before."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        time = table["time"].to_numpy()
        return table.assign(**{column: CubicSpline(time, table[column])(np.maximum(time - delay, 0.0))})

    return change


def with_column(name: str, values: Callable[[np.ndarray], np.ndarray]) -> Change:
    """The table with one column more."""
    return lambda table: table.assign(**{f"joint/{name}": values(table["time"].to_numpy())})


def bump(m: Motion) -> np.ndarray:
    """A cable that bears against the link about 0.2 rad [N m]."""
    return np.asarray(2.0 * np.exp(-(((m.q - 0.2) / 0.2) ** 2)))


@dataclass(frozen=True)
class Case:
    """A joint, what is done to its logs, key of the effect, true values, and how far a value may be off (relative)."""

    joint: Joint
    change: Change
    effect: str
    truth: Mapping[str, float]
    within: float = 0.05


def plain(table: pd.DataFrame) -> pd.DataFrame:
    """The log as it is."""
    return table


CASES = {
    "a supply that sags": Case(
        delivering(VOLTAGE, lambda m, y: y * supply(m.time) / 24.0),
        with_column("supply_voltage", supply),
        "supply_sag",
        {"supply_sensitivity": 1.0},
    ),
    "a bridge at full duty": Case(
        delivering(VOLTAGE, lambda m, y: np.clip(y, -0.25 * supply(m.time), 0.25 * supply(m.time))),
        with_column("supply_voltage", supply),
        "saturation.supply",
        {"limit_per_volt": 0.25},
    ),
    "a winding that warms": Case(
        delivering(VOLTAGE, warm),
        with_column("temperature", celsius),
        "winding_temperature",
        {"resistance_per_kelvin": 0.0039, "back_emf": BACK_EMF},
    ),
    "a winding that lags": Case(
        delivering(VOLTAGE, winding_current), plain, "current_lag.winding", {"lag": 0.02, "back_emf": BACK_EMF}
    ),
    "a gear that is hard to back-drive": Case(
        replace(QUIET, extra=gear_loss),
        plain,
        "directional_efficiency",
        {"driving_friction": 0.15, "backdriven_friction": 0.35},
    ),
    "a command that comes late": Case(
        servo(torque_noise=0.05, encoder_step=1e-5),
        late("joint/position_command", -0.012),
        "delay.command",
        {"delay": 0.012},
    ),
    "a torque sensor that comes late": Case(
        QUIET, late("joint/torque", 0.006), "delay.torque_sensor", {"delay": 0.006}
    ),
    "a load over the position": Case(replace(QUIET, extra=bump), plain, "position_dependent_load", {}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_cause_is_found_alone_and_its_value_is_right(tmp_path, name: str) -> None:
    case = CASES[name]
    report = write_logs(tmp_path, case.joint, case.change).report(assess_residual=False)
    joint = report["joints"]["joint"]
    assert [effect["key"] for effect in joint["effects"]] == [case.effect]
    (effect,) = joint["effects"]
    for parameter, true in case.truth.items():
        assert effect["parameters"][parameter]["value"] == pytest.approx(true, rel=case.within)
