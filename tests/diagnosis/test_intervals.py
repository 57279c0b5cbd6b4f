"""95 % intervals of a joint's parameters: they hold the truth, follow the units of the drive, and end at bounds."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.parameters import rests_on_bound
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.library import effect

from .rigs import Joint, Motion, record, rig_of

TRUTH = {("drive", "gain"): 0.08, ("viscous", "viscous"): 6.0, ("coulomb", "coulomb"): 3.0}
SHORT = Joint(duration=12.0, period=4e-3)


def coloured(seed: int, rho: float, size: float) -> Callable[[Motion], np.ndarray]:
    """An error of the torque sensor with the autocorrelation of an AR(1) process and RMS `size` [N m]."""

    def error(m: Motion) -> np.ndarray:
        white = np.random.default_rng(seed).standard_normal(m.q.size + 500)
        return np.asarray(size * np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], white)[500:])

    return error


def diagnosed(joints: tuple[Joint, Joint], *keys: str, seed: int = 0) -> JointResult:
    """Of a training run and a held-out run, where these effects alone are looked for."""
    train, held = (record(joint, f"run{k}", 0.9 * k, seed + 1000 * k) for k, joint in enumerate(joints))
    options = DiagnosisOptions(effects=tuple(map(effect, keys)), assess_residual=False)
    return diagnose_joint([train], [held], rig_of(joints[0]), "joint", options)


@pytest.mark.parametrize(
    ("rho", "seeds"),
    [(0.98, 4), pytest.param(0.0, 12, marks=pytest.mark.slow), pytest.param(0.98, 12, marks=pytest.mark.slow)],
)
def test_intervals_hold_the_truth_under_white_and_under_slow_noise(rho, seeds):
    inside, width = [], []
    for seed in range(seeds):
        joints = tuple(replace(SHORT, sensor=coloured(2 * seed + k, rho, 0.5)) for k in range(2))
        found = diagnosed((joints[0], joints[1]), seed=seed).final_parameters
        for (key, name), true in TRUTH.items():
            low, high = found[key][name].ci95
            inside.append(low <= true <= high)
            width.append((high - low) / true)
    assert np.mean(inside) >= 0.83  # of 36 at 95 %, fewer than 30 hold in one case in 10^3
    assert max(width) < (0.05 if rho == 0.0 else 0.55)


def test_parts_of_a_log_that_disagree_widen_the_interval():
    def halves(m):
        return 0.6 * np.sign(m.time - m.time.mean()) * m.v

    joint = replace(SHORT, extra=halves)
    low, high = diagnosed((joint, joint)).final_parameters["viscous"]["viscous"].ci95
    assert low < TRUTH["viscous", "viscous"] < high
    # twenty parts at 5.4 or 6.6 N m s/rad tell their mean to 0.6/sqrt(19); the fit's residual alone tells it to 0.08
    assert 0.5 * (high - low) == pytest.approx(1.96 * 0.6 / np.sqrt(19.0), rel=0.35)


def test_shape_parameters_have_intervals_too():
    waved = replace(SHORT, torque_noise=0.4, extra=lambda m: 1.5 * np.sin(11.0 * m.q))
    inside = []
    for seed in range(2):
        found = diagnosed((waved, waved), "torque_ripple", seed=seed).final_parameters["torque_ripple"]
        low, high = found["cycles_per_turn"].ci95
        assert high - low < 0.5
        inside.append(low <= 11.0 <= high)
    assert all(inside)


@pytest.mark.parametrize(
    ("drive", "gain", "dead"), [("current", "A/(N*m)", "A"), ("position_servo", "rad/(N*m)", "rad")]
)
def test_units_follow_the_drive(drive, gain, dead):
    width = 0.1 if drive == "current" else 3e-3
    joint = replace(SHORT, drive=drive, gain=0.08 if drive == "current" else 2e-3, torque_noise=0.05)
    joint = replace(
        joint, extra=lambda m: width / joint.gain * np.sign(m.tau + 0.3 * m.a + 6.0 * m.v + 3.0 * np.sign(m.v))
    )
    found = diagnosed((joint, joint), "deadzone").final_parameters
    assert (found["drive"]["gain"].unit, found["deadzone"]["deadzone"].unit) == (gain, dead)
    assert found["viscous"]["viscous"].unit == "N*m*s/rad"
    low, high = found["deadzone"]["deadzone"].ci95
    assert low - 0.01 * width <= width <= high + 0.01 * width


def test_an_interval_ends_at_the_bound_of_its_parameter():
    """Friction of 0.05 N m under 2 N m of slow noise cannot be told from none, and is never negative."""
    noisy = tuple(replace(SHORT, coulomb=0.05, sensor=coloured(k, 0.98, 2.0)) for k in range(2))
    coulomb = diagnosed((noisy[0], noisy[1])).final_parameters["coulomb"]["coulomb"]
    assert coulomb.ci95[0] == 0.0 and coulomb.ci95[1] > 0.05


@pytest.mark.parametrize("value", [0.3, 0.0])
def test_the_answer_for_a_numpy_value_can_be_written_to_the_report(value):
    assert json.dumps(rests_on_bound(np.float64(value), 0.0, 10.0)) == ("true" if value == 0.0 else "false")
