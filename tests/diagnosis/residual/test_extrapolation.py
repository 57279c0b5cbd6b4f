"""An error of effects that extrapolate is told from a missing effect and from an event."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.residual.structure import FEATURES
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.residual.verdict import beyond_training
from drake_tc.effects.library import effect

from ..rigs import Joint, record, rig_of

FLOOR = 0.01
THERMAL = (effect("thermal_friction"),)
JOINT = Joint(duration=12.0, period=4e-3)


@pytest.fixture(scope="module")
def samples() -> Samples:
    return build_samples([record(JOINT, "warm")], rig_of(JOINT), "joint")


def found(samples: Samples, gain, effects=THERMAL, hottest: float = 60.0):
    """What is said of a residual `gain(temperature)` times noise; the run warms up from 24, the training ends at 30."""
    size = samples.rows.size
    warming = np.linspace(24.0, hottest, size)
    x = np.random.default_rng(1).standard_normal((2, size, len(FEATURES)))
    column = FEATURES.index("temperature")
    x[0, :, column], x[1, :, column] = np.linspace(24.0, 30.0, size), warming
    noise = FLOOR * np.random.default_rng(2).standard_normal(size)
    after = noise * np.vectorize(gain)(warming)
    split = DataSplit(samples, after, after)
    return beyond_training((split, split), (x[0], x[1]), effects, "current", FLOOR)


def hot(celsius: float) -> float:
    return 1.0 if celsius < 31.0 else 8.0


def test_an_error_where_the_run_is_warmer_than_any_before(samples):
    beyond = found(samples, hot)
    assert beyond is not None
    assert (beyond.signal, beyond.runs, beyond.trained, beyond.reached) == (
        "temperature",
        ("warm",),
        (24.0, 30.0),
        (24.0, 60.0),
    )
    assert beyond.share > 0.98


@pytest.mark.parametrize(
    ("gain", "changes"),
    [
        (hot, {"effects": (effect("stribeck"),)}),
        (hot, {"hottest": 30.2}),
        (lambda celsius: 8.0, {}),
        (lambda celsius: 1.0, {}),
        (lambda celsius: 8.0 if celsius < 27.0 else 1.0, {}),
    ],
)
def test_an_error_that_has_nothing_to_do_with_it(samples, gain, changes):
    """Another effect, a range that was covered, an error everywhere, none, and one inside the range."""
    assert found(samples, gain, **changes) is None


def test_the_signal_that_explains_the_error_is_named(samples):
    """Stribeck friction is a curve over the velocity, beyond whose range single rows lie by chance."""
    beyond = found(samples, hot, (effect("stribeck"), *THERMAL))
    assert beyond is not None
    assert beyond.signal == "temperature"


@pytest.mark.parametrize(
    ("units", "drive", "unit"),
    [
        (JointUnits("revolute", "current"), "current", "A"),
        (JointUnits("revolute", "position_servo"), "position_servo", "rad"),
        (JointUnits("prismatic", "position_servo"), "position_servo", "m"),
        (JointUnits("prismatic", "torque"), "torque", "N"),
    ],
)
def test_an_error_where_the_efforts_are_larger_than_any_before(samples, units, drive, unit):
    """A drive that gives way above 80 % of its effort, which only the held-out run reaches: no effect is needed."""
    samples = replace(samples, units=units)
    effort = samples.signals.effort[samples.rows]
    most = 0.8 * np.abs(effort).max()
    large = np.abs(effort) > 1.1 * most
    x = np.random.default_rng(1).standard_normal((2, samples.rows.size, len(FEATURES)))
    noise = FLOOR * np.random.default_rng(2).standard_normal(samples.rows.size)
    after = np.where(large, 20.0, 1.0) * noise
    small = replace(samples, signals=replace(samples.signals, effort=np.clip(samples.signals.effort, -most, most)))
    splits = (DataSplit(small, noise, noise), DataSplit(samples, after, after))
    beyond = beyond_training(splits, (x[0], x[1]), (), drive, FLOOR)
    assert beyond is not None
    assert (beyond.signal, beyond.unit, beyond.runs) == ("effort", unit, ("warm",))
    assert np.ptp(beyond.trained) < 0.95 * np.ptp(beyond.reached)
