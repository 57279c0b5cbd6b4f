"""The quasi-direct-drive pendulum: encoder ripple in every run, and the model equation on a run that was held out."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from readme_quotes_real import differing_cells

from drake_tc.bench.real_dfki import GOOD, TORQUE_PER_AMPERE, WANTED, WIDTHS, good_runs, held_out, rows
from drake_tc.bench.real_fit import HeldOut
from drake_tc.filtering.common_kernel import CommonKernel

MOTOR_TURNS = 6.0  # the gear's ratio: the encoder is on the motor's side


@pytest.fixture(scope="module")
def results(data: Path) -> dict[str, HeldOut]:
    return held_out(data, WIDTHS["shared_band"])


@pytest.mark.parametrize("name", sorted(GOOD))
def test_every_run_shows_the_encoder_err_twice_a_motor_turn(data: Path, name: str) -> None:
    run = good_runs(data)[0][name]
    part = next(run.segments())
    q, current = run.columns["pendulum/position"][part], run.columns["pendulum/current"][part]
    kernel = CommonKernel(0.1, run.period)
    inside = kernel.valid(q.size)
    a, v = kernel.second_derivative(q), kernel.derivative(q)
    needed = (0.154 * a + 0.676 * 9.81 * 0.45 * kernel.smooth(np.sin(q)))[inside]
    common = [kernel.smooth(current), v, kernel.smooth(np.tanh(v / 0.05)), np.ones_like(q)]

    def left(cycles: float) -> tuple[float, float]:
        waves = [0.154 * kernel.second_derivative(f(cycles * q)) for f in (np.cos, np.sin)]
        x = np.stack([*common, *waves], axis=-1)[inside]
        theta = np.linalg.lstsq(x, needed, rcond=None)[0]
        return float(np.sum((needed - x @ theta) ** 2)), float(np.hypot(*theta[-2:]))

    tried = np.arange(8.0, 16.1, 0.5)
    best = tried[int(np.argmin([left(n)[0] for n in tried]))]
    # half a cycle is what the travel of these runs (less than two turns) can tell apart
    assert_allclose(best, 2 * MOTOR_TURNS, rtol=0.0, atol=0.5)
    assert_allclose(left(12.0)[1], 1.2e-3, rtol=0.35)  # rad: below half of the encoder's step of 2.9 mrad


@pytest.mark.parametrize(("name", "reached"), [("ddp", 0.112), ("direct_collocation", 0.169)])
def test_held_out_residual_in_the_band_that_torque_and_motion_share(
    results: dict[str, HeldOut], name: str, reached: float
) -> None:
    result = results[name]
    share = result.command_error(result.chosen) / result.command_rms()
    assert share <= reached  # 0.15 was wanted: met for ddp, missed for direct_collocation
    assert result.command_error(result.chosen) <= result.command_error(result.baseline)


def test_held_out_residual_of_the_ddp_run(results: dict[str, HeldOut]) -> None:
    result = results["ddp"]
    assert result.command_error(result.chosen) * TORQUE_PER_AMPERE <= WANTED
    assert np.isfinite(result.chosen.gain)


@pytest.mark.slow
def test_the_readme_quotes_what_is_computed(data: Path) -> None:
    assert differing_cells("real-dfki", {row.name: row for row in rows(data)}) == []
