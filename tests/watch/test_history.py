"""Trends against closed forms and by repetition, records, and the page."""

import json
from contextlib import nullcontext
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import linregress
from scipy.stats import t as student

from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.report.comparison import history_page, history_sentences
from drake_tc.watch.changes import Known
from drake_tc.watch.history import Session, further_unit, read_history, trend_of, trends

from .conftest import the_command_finds

START = datetime(2026, 3, 1, tzinfo=UTC)


def test_with_equal_intervals_and_a_large_spread_it_is_ordinary_regression():
    rng = np.random.default_rng(1)
    days = np.linspace(0.0, 90.0, 9)
    values = 5.0 + 0.01 * days + rng.normal(0.0, 0.2, 9)
    found = trend_of(days, [Known(v, 1e-4) for v in values])
    plain = linregress(days, values)
    assert found.slope == pytest.approx(plain.slope, rel=1e-3)
    half = student.ppf(0.975, 7) * plain.stderr
    assert found.slope_ci95 == pytest.approx((plain.slope - half, plain.slope + half), rel=1e-2)


def test_intervals_of_slopes_hold_in_19_of_20_cases():
    rng = np.random.default_rng(2)
    held = []
    for _ in range(400):
        n, slope = int(rng.integers(4, 10)), float(rng.normal(0.0, 0.02))
        days, deviations = np.sort(rng.uniform(0.0, 120.0, n)), rng.uniform(0.02, 0.2, n)
        spread = rng.choice([0.0, 0.1])
        values = 3.0 + slope * days + rng.normal(0.0, np.hypot(deviations, spread))
        low, high = trend_of(days, [Known(v, s) for v, s in zip(values, deviations, strict=True)]).slope_ci95
        held.append(low <= slope <= high)
    assert 0.92 <= np.mean(held) <= 0.98


def test_two_sessions_have_no_trend_and_its_uncertainty_grows_beyond_the_last():
    assert trend_of(np.array([0.0, 5.0]), [Known(1.0, 0.1), Known(2.0, 0.1)]) is None
    found = trend_of(np.array([0.0, 5.0, 11.0, 16.0]), [Known(v, 0.1) for v in (1.0, 1.4, 2.2, 2.4)])
    widths = [high - low for _, low, high in map(found.at, (16.0, 24.0, 60.0))]
    assert widths[0] < widths[1] < widths[2] and found.drifts


def test_a_further_unit_spreads_as_the_units_do():
    rng = np.random.default_rng(3)
    units = [Known(4.0 + rng.normal(0.0, 0.5), 0.01) for _ in range(200)]
    found = further_unit(units)
    assert found.value == pytest.approx(4.0, abs=0.15) and found.deviation == pytest.approx(0.5, rel=0.15)
    alike = further_unit([Known(4.0, 0.2), Known(4.0, 0.2)])
    assert alike.deviation == pytest.approx(0.2 / np.sqrt(2.0))


def sessions(serial: str, slope: float, seed: int) -> list[Session]:
    rng = np.random.default_rng(seed)
    out = []
    for k in range(7):
        coulomb = Known(5.0 + slope * k + float(rng.normal(0.0, 0.05)), 0.04)
        parameters = {"knee": {"coulomb.coulomb": coulomb, "drive.gain": Known(0.1, 0.001)}}
        units = {"knee": {"coulomb.coulomb": "N*m", "drive.gain": "A/(N*m)"}}
        out.append(
            Session(serial, START + timedelta(days=14 * k), {"knee": "unchanged"}, {"knee": 25.0}, parameters, units)
        )
    return out


def test_a_page_names_what_drifts_and_the_spread_between_units():
    both = sorted([*sessions("A1", 0.2, 1), *sessions("B2", 0.0, 2)], key=lambda s: s.time)
    (sentence,) = history_sentences(both)
    assert sentence.startswith("A1, knee: coulomb drifts by 0.4")
    assert trends(both, "A1", "knee")["coulomb.coulomb"].drifts
    page = history_page(both)
    assert "a further unit, 95 %" in page and "<svg" in page


def test_a_page_of_one_session_promises_nothing():
    page = history_page(sessions("A1", 0.0, 1)[:1])
    assert "A trend needs 3 sessions" in page and "1 session of 1 unit" in page and "No parameter drifts" not in page


def test_the_command_keeps_sessions_and_models_of_units(diagnosed, same, worn, own_effects, tmp_path):
    """The first session and the last are comparisons that other tests look at; the others are computed."""
    folder, logs = tmp_path / "history", [tmp_path / f"{month}.parquet" for month in range(3)]
    diagnosed.later(5, coulomb=1.15).to_parquet(logs[1])
    diagnosed.later(2, coulomb=1.3).to_parquet(logs[2])
    logs[0].touch()
    for month, known in enumerate((same, None, worn)):
        words = ["--model", diagnosed.model, "--log", logs[month], "--out", tmp_path / "out", "--history", folder]
        words += ["--serial", "A 17", "--time", f"2026-0{month + 1}-01T00:00:00"]
        with the_command_finds(known) if known else nullcontext():
            assert run(["compare", *map(str, words)]) in (0, 1)
    assert [s.time.month for s in read_history(folder)] == [1, 2, 3]
    assert sorted(path.name for path in folder.glob("*.yaml")) == ["A-17.yaml"]
    found = trends(read_history(folder), "A 17", "simulated_knee")["coulomb.coulomb"]
    assert found.slope * 59.0 == pytest.approx(1.8, abs=0.3)
    again = ["--model", folder / "A-17.yaml", "--rig", diagnosed.rig, "--log", logs[2]]
    assert run(["compare", *map(str, again), "--out", str(tmp_path / "again")]) == 0
    ranges = ["export", str(folder / "A-17.yaml"), "--ranges", "--to", "parquet", "--out", str(tmp_path / "r.parquet")]
    assert run(ranges) == 0


def test_a_file_that_is_no_record_is_named(tmp_path: Path):
    (tmp_path / "x.json").write_text(json.dumps({"a": 1}), encoding="utf-8")
    with pytest.raises(ParamsError, match="expected a record"):
        read_history(tmp_path)
