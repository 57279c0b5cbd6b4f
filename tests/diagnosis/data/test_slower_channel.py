"""A torque with short spikes from a topic of 60 Hz in a log of 200 Hz: the other channels see more of the spikes."""

from collections.abc import Mapping

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

from ..rigs import sines

RIG = parse_rig({"joint": "joint", "drive": "current", "load": "torque"})
PERIOD, TOPIC, DECAY = 5e-3, 1.0 / 60.0, 0.03
GAIN, VISCOUS, COULOMB = 0.25, 0.8, 1.0


def samples(seed: int, slower: Mapping[str, float]) -> Samples:
    """Rows of a joint whose load jumps by up to 15 N m about once a second and decays in 30 ms."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(60.0 / PERIOD)) * PERIOD
    begins, sizes = rng.uniform(0.0, 60.0, 60), rng.uniform(-15.0, 15.0, 60)

    def load(at: np.ndarray) -> np.ndarray:
        since = at[:, None] - begins
        return 3.0 * np.sin(2.1 * at) + np.sum(sizes * np.exp(-np.maximum(since, 0.0) / DECAY) * (since >= 0.0), axis=1)

    q, v, _ = sines(time, ((0.13, 0.5, 0.0), (0.41, 0.35, 1.1)), float(rng.uniform(0.0, 3.0)))
    sampled = np.arange(-1.0, 60.0 / TOPIC + 2.0) * TOPIC
    channels = {
        "joint/position": q,
        "joint/current": GAIN * (load(time) + VISCOUS * v + COULOMB * np.sign(v)),
        "joint/torque": np.interp(time, sampled, load(sampled)),
    }
    run = Run("run", None, time, PERIOD, channels, np.zeros(time.size, dtype=np.int64), slower=slower)
    return build_samples([run], RIG, "joint")


def fitted(seed: int, slower: Mapping[str, float]) -> tuple[float, float]:
    """Error of the declared model [A] and of its drive gain [A/(N m)]."""
    found = fit(Columns(samples(seed, slower)), [Term(effect(key)) for key in ("viscous", "coulomb")])
    return found.cv_rms, abs(found.gain - GAIN)


@pytest.mark.parametrize("seed", [41, 42, 43])
def test_no_channel_tells_more_than_the_slowest(seed: int) -> None:
    """The kernel leaves out much of what only the current has; the rest of a jump is folded into the torque's band."""
    error_as_if_fast, gain_as_if_fast = fitted(seed, {})
    error, gain = fitted(seed, {"joint/torque": TOPIC})
    assert error < 2.0 / 3.0 * error_as_if_fast
    assert gain < 0.5 * gain_as_if_fast


def test_a_slow_channel_that_is_not_in_the_balance_changes_nothing() -> None:
    assert samples(44, {"joint/motor_position": 0.05}).light == samples(44, {}).light
    assert samples(44, {"joint/torque": TOPIC}).light.width_s == pytest.approx(4.0 * TOPIC)
