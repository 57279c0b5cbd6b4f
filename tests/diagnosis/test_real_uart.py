"""The UART backlash stand: published spans, and play told apart from the servo's dead zone."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.benchmarks.backlash_bench import BacklashReport
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.real_uart import rows, stand_reports

STEP = 360.0 / 4096.0


@pytest.fixture(scope="module")
def reports(data: Path) -> dict[str, BacklashReport]:
    return stand_reports(data)


def test_spans_of_the_single_servo(reports: dict[str, BacklashReport]) -> None:
    report = reports["single/servo_5"]
    assert_allclose(np.degrees(report.loaded_span.value), 1.25, rtol=0.10)
    assert_allclose(np.degrees(report.unloaded_span.value), 0.62, rtol=0.10)


def test_spans_of_the_coupled_pair(reports: dict[str, BacklashReport]) -> None:
    for joint, loaded, unloaded in (("servo_1", 0.62, 0.47), ("servo_2", 0.67, 0.46)):
        report = reports[f"nocomp2/{joint}"]
        assert_allclose(np.degrees(report.loaded_span.value), loaded, rtol=0.10)
        assert_allclose(np.degrees(report.unloaded_span.value), unloaded, rtol=0.10)


def test_the_same_gears_with_another_servo_setting_change_the_drive_and_not_the_play(
    reports: dict[str, BacklashReport],
) -> None:
    # both files hold the same coupled pair; the second raised the P gain and set the dead band to zero
    for joint in ("servo_1", "servo_2"):
        stock, changed = reports[f"nocomp2/{joint}"], reports[f"pgain_zero_db/{joint}"]
        assert_allclose(np.degrees(stock.drive.dead_zone), STEP, rtol=1e-6)
        assert changed.drive.low == 0.0
        assert changed.drive.dead_zone < 0.5 * np.radians(STEP)
        assert changed.drive.gain > 1.5 * stock.drive.gain
        assert changed.lower_bound  # the stiffer servo closes the gap before it is seen


def test_most_of_the_single_servos_loaded_span_is_play(reports: dict[str, BacklashReport]) -> None:
    report = reports["single/servo_5"]
    assert not report.lower_bound
    assert report.play.low > 4.0 * report.drive.dead_zone
    # the drive's own setting is one count; the encoder brackets it
    assert report.drive.low <= np.radians(STEP) <= report.drive.high


@pytest.fixture(scope="module")
def table(data: Path) -> dict[str, BenchmarkRow]:
    return {row.name: row for row in rows(data)}


def test_table_says_what_is_met(table: dict[str, BenchmarkRow]) -> None:
    assert table["single/servo_5/loaded_span"].met
    assert table["single/servo_5/play"].met is None
    wanted = [row for row in table.values() if row.met is not None]
    assert sum(bool(row.met) for row in wanted) >= len(wanted) - 3
