"""Logs as users have them: wrong signs and units, unrecorded disturbances, coarse encoders, a run given twice."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drake_tc.errors import DrakeTcError

from .log_files import Logs, floors, found, write_logs
from .rigs import Extra, Joint, Motion, servo

QUIET = Joint(duration=24.0, torque_noise=0.05, encoder_step=1e-5)
"""A joint that lacks nothing."""
RED = ("unexplained_structure", "unexplained_residual")
GREEN_FLOORS = 3.0


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    report = write_logs(tmp_path_factory.mktemp("quiet"), QUIET).report()
    assert report["verdict"] == "no_missing_effect"
    assert floors(report) < GREEN_FLOORS
    return report


def torque_of(report: dict[str, Any], count: float) -> float:
    """So many noise floors as a torque [N m]."""
    return float(count * report["joints"]["joint"]["noise_floor"] / QUIET.gain)


def turned(*names: str):
    """Tables in which these columns have the wrong sign."""
    return lambda table: table.assign(**{f"joint/{name}": -table[f"joint/{name}"] for name in names})


def require_red(report: dict[str, Any]) -> None:
    assert report["verdict"] in RED
    assert found(report) == []


SIGNS = {
    "servo": servo(duration=8.0, torque_noise=0.25, encoder_step=1e-5),
    "high_friction": Joint(duration=8.0, coulomb=30.0, viscous=20.0, torque_noise=0.25, encoder_step=1e-5),
    "noisy_sensor": Joint(duration=8.0, torque_noise=8.0, encoder_step=1e-5),
}


@pytest.mark.parametrize("name", SIGNS)
def test_a_torque_of_the_wrong_sign_is_refused_or_turned_and_said(tmp_path, name: str) -> None:
    joint = SIGNS[name]
    right = write_logs(tmp_path / "right", joint).report(assess_residual=False)
    try:
        wrong = write_logs(tmp_path / "wrong", joint, turned("torque")).report(assess_residual=False)
    except DrakeTcError as refusal:
        assert "sign" in str(refusal)
        return
    assert any("sign" in note for note in wrong["joints"]["joint"]["notes"])
    assert found(wrong) == found(right)
    assert floors(wrong) < 1.5 * floors(right)


def test_a_pendulum_that_runs_against_its_declared_weight_is_refused_or_said(tmp_path) -> None:
    def hanging(m: Motion) -> np.ndarray:
        return 8.0 * np.sin(m.q) + 0.3 * m.a - m.tau  # no hand: the load is the pendulum alone

    joint = servo(duration=12.0, encoder_step=1e-5, extra=hanging)
    pendulum = {"mass": 8.0 / 9.81, "length": 1.0, "inertia": 0.3, "zero": float(np.pi)}
    try:
        report = write_logs(tmp_path, joint, rig={"load": {"pendulum": pendulum}}).report(assess_residual=False)
    except DrakeTcError as refusal:
        assert any(word in str(refusal) for word in ("sign", "zero", "gain"))
        return
    assert any("sign" in note or "zero" in note or "gain" in note for note in report["joints"]["joint"]["notes"])


def test_degrees_without_a_stated_unit_are_refused(tmp_path) -> None:
    def degrees(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{"joint/position": np.rad2deg(table["joint/position"])})

    logs = write_logs(tmp_path, QUIET, degrees)
    with pytest.raises(DrakeTcError, match=r"set units: \{position: deg\}"):
        logs.report()


def random_torque(size: float, highest_hz: float) -> Extra:
    """Torque [N m RMS] from 0.3 Hz up to the highest frequency that no column records; another one in every run."""

    def extra(m: Motion) -> np.ndarray:
        rng = np.random.default_rng(round(1e6 * abs(float(m.q[0]))))
        spectrum = np.fft.rfft(rng.standard_normal(m.time.size))
        f = np.fft.rfftfreq(m.time.size, float(m.time[1]))
        torque = np.fft.irfft(np.where((f > 0.3) & (f < highest_hz), spectrum, 0.0), m.time.size)
        return np.asarray(size * torque / np.std(torque))

    return extra


@pytest.mark.parametrize("highest_hz", [4.0, 20.0])
def test_a_random_disturbance_of_45_floors_is_no_green_verdict(
    tmp_path, quiet: dict[str, Any], highest_hz: float
) -> None:
    joint = replace(QUIET, duration=16.0, extra=random_torque(torque_of(quiet, 45.0), highest_hz))
    require_red(write_logs(tmp_path, joint).report())


def touch(size: float) -> Extra:
    """A hand that rests on the link from 8 to 16 s [N m]."""

    def extra(m: Motion) -> np.ndarray:
        since, until = (1.0 / (1.0 + np.exp(-(m.time - t) / 0.05)) for t in (8.0, 16.0))
        return np.asarray(size * (since - until))

    return extra


@pytest.mark.parametrize("touched", ["one", "held"])
def test_a_touch_of_eight_seconds_and_75_floors_is_no_green_verdict(
    tmp_path, quiet: dict[str, Any], touched: str
) -> None:
    joints = dict.fromkeys(("one", "two", "held"), QUIET)
    joints[touched] = replace(QUIET, extra=touch(torque_of(quiet, 75.0)))
    require_red(write_logs(tmp_path, joints).report())


def test_a_run_that_is_fitted_and_held_out_is_refused(tmp_path) -> None:
    logs = write_logs(tmp_path, replace(QUIET, duration=6.0))
    with pytest.raises(DrakeTcError, match="same"):
        replace(logs, held=logs.train[:1]).report()


def test_a_run_that_is_held_out_in_another_format_is_refused(tmp_path) -> None:
    logs = write_logs(tmp_path, replace(QUIET, duration=6.0))
    again = tmp_path / "again.parquet"
    pd.read_csv(logs.train[0]).to_parquet(again, index=False)
    with pytest.raises(DrakeTcError, match="same"):
        replace(logs, held=(again,)).report(assess_residual=False)


STEP = 2.0 * np.pi / 4096.0


def coarse_logs(tmp_path, *, jitter: bool) -> Logs:
    """A servo with a 12-bit encoder, logged at some 190 Hz; with `jitter` the clock's steps vary by 10 %."""
    period = 5.3e-3
    joint = servo(duration=24.0, period=period, torque_noise=0.05)

    def polled(table: pd.DataFrame) -> pd.DataFrame:
        time = table["time"].to_numpy()
        if jitter:
            rng = np.random.default_rng(time.size)
            time = time + 0.1 * period * rng.standard_normal(time.size).clip(-3.0, 3.0)
        smooth = {name: np.interp(time, table["time"], table[name]) for name in table.columns if name != "time"}
        error = smooth["joint/position_command"] - smooth["joint/position"]
        q = np.round(smooth["joint/position"] / STEP) * STEP
        return pd.DataFrame({"time": time, **smooth, "joint/position": q, "joint/position_command": q + error})

    return write_logs(tmp_path / ("jitter" if jitter else "even"), joint, polled)


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("coarse")
    return {jitter: coarse_logs(folder, jitter=jitter).report() for jitter in (False, True)}


def test_a_jittering_clock_does_not_hide_the_steps_of_the_encoder(coarse: dict[bool, dict[str, Any]]) -> None:
    even, jittered = (coarse[jitter]["joints"]["joint"]["noise_floor"] for jitter in (False, True))
    assert 0.7 < jittered / even < 1.5


@pytest.mark.parametrize("jitter", [False, True])
def test_a_coarse_encoder_is_no_missing_effect(coarse: dict[bool, dict[str, Any]], jitter: bool) -> None:
    assert found(coarse[jitter]) == []
    assert coarse[jitter]["verdict"] == "no_missing_effect"
    assert 0.5 < floors(coarse[jitter]) < 2.0
