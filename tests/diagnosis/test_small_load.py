"""A geared joint whose friction outweighs its load: noise of the current is neither structure nor an effect."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.logs.record import Run

from .pendulum_rig import JOINT, Swing, record, rig_of, runs_of

GEARED = Swing(duration=12.0, period=4e-3, moment=0.3, zero=0.0, constant=0.0, inertia=0.01, coulomb=1.5, viscous=0.5)
CURRENT = f"{JOINT}/current"
PENDULUM = {"pendulum": {"mass": GEARED.moment / (9.81 * 0.3), "length": 0.3}}
SHARE = 0.03
"""RMS of the coloured noise over that of the current."""


def noisy(run: Run, time_constant: float, seed: int) -> Run:
    """The run with Ornstein-Uhlenbeck noise on its current: correlation exp(-|t|/T), RMS 3 % of the current's."""
    current = run.columns[CURRENT]
    pole = float(np.exp(-run.period / time_constant))
    white = np.random.default_rng(seed).standard_normal(current.size + 5000)
    noise = lfilter([1.0], [1.0, -pole], white)[5000:]
    noise *= SHARE * np.sqrt(np.mean(current**2)) / np.std(noise)
    return replace(run, columns=dict(run.columns) | {CURRENT: current + noise})


def diagnosed(swing: Swing, load: Any, time_constant: float, options: DiagnosisOptions | None = None) -> JointResult:
    runs: Sequence[Run] = [*runs_of(swing)[0], record(swing, "held", 7, 1.3)]
    train, held = [noisy(run, time_constant, k) for k, run in enumerate(runs)][:2], noisy(runs[2], time_constant, 2)
    return diagnose_joint(train, [held], rig_of(swing, load), JOINT, options or DiagnosisOptions())


@pytest.mark.parametrize(
    ("load", "time_constant"),
    [
        (PENDULUM, 0.02),
        pytest.param("unknown", 0.02, marks=pytest.mark.slow),
        pytest.param("unknown", 0.3, marks=pytest.mark.slow),
    ],
    ids=["pendulum", "unknown", "unknown, slow"],
)
def test_noise_of_the_current_is_more_than_noise_and_nothing_else(load: Any, time_constant: float) -> None:
    result = diagnosed(GEARED, load, time_constant)
    assert result.unexplained.floors > 3.0
    assert result.verdict == "unexplained_residual", "from the motion, the current cannot be told"
    assert not result.effects


def test_a_torque_of_position_and_speed_is_structure() -> None:
    planted = replace(GEARED, extra=lambda q, v, a: 0.25 * np.sin(3.0 * q) * np.tanh(v / 0.2) * np.abs(v))
    result = diagnosed(planted, PENDULUM, 0.02, DiagnosisOptions(effects=()))
    assert result.verdict == "unexplained_structure"
    assert {"position", "velocity"} & set(result.unexplained.depends_on)
