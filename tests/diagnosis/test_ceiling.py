"""What is left: planted structure is seen and named, noise of any colour is not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.ceiling import SIGNALS, StructureOptions, features, judge, share_explained, spectral_line
from drake_tc.diagnosis.preparation import build_samples
from drake_tc.diagnosis.result import Side
from drake_tc.diagnosis.samples import Samples

from .rigs import Joint, record, rig_of

JOINT = Joint(duration=30.0, period=4e-3, torque_noise=0.25)
NOISE = 0.02
FLOOR = 0.5 * NOISE
OPTIONS = StructureOptions()


@pytest.fixture(scope="module")
def samples() -> tuple[Samples, Samples]:
    rig = rig_of(JOINT)
    train = build_samples([record(JOINT, "one"), record(JOINT, "two", 0.9, 1)], rig, "joint")
    held = build_samples([record(JOINT, "held", 2.3, 2)], rig, "joint", width_s=train.light.width_s)
    return train, held


def sides(samples, left, seed=0, rho=0.0):
    """Both sides with a residual `left(signals)` on top of noise with the correlation of an AR(1) process."""
    made = []
    for k, s in enumerate(samples):
        white = np.random.default_rng([seed, k]).standard_normal(s.rows.size + 2000)
        noise = NOISE * np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], white)[2000:]
        after = noise + left(s, s.signals.take(s.rows))
        made.append(Side(s, after, after))
    return made


def nothing(s, x):
    return np.zeros(s.rows.size)


def test_a_function_of_two_signals_is_structure_that_depends_on_them(samples):
    found = judge(*sides(samples, lambda s, x: 0.1 * x.position * x.velocity), FLOOR, OPTIONS)
    assert found.structured
    assert set(found.depends_on[:2]) == {"position", "velocity"}
    assert found.confined_to == ()
    assert found.fraction > 0.7
    assert found.ceiling < 2.0 * NOISE  # what is left once the function is known: mostly the noise


def test_a_function_of_the_load_alone_names_it_first(samples):
    found = judge(*sides(samples, lambda s, x: 0.06 * np.sign(np.sin(x.load_torque))), FLOOR, OPTIONS)
    assert found.structured
    assert found.depends_on[0] == "load_torque"


def test_a_touched_stretch_is_confined_to_its_run_and_time(samples):
    def touch(s, x):
        second = np.array([name == "two" for name in s.runs])[s.run]
        return np.where(second & (x.time > 11.0) & (x.time < 13.0), 0.4, 0.0)

    found = judge(*sides(samples, touch), FLOOR, OPTIONS)
    assert found.structured
    assert "time" in found.depends_on
    assert {c.run for c in found.confined_to} == {"two"}
    # half-second blocks
    assert_allclose(min(c.start for c in found.confined_to), 11.0, atol=0.6)
    assert_allclose(max(c.end for c in found.confined_to), 13.0, atol=0.6)


@pytest.mark.parametrize("frequency", [1.7, 21.0])
def test_a_spectral_line_is_found_at_its_frequency(samples, frequency):
    made = sides(samples, lambda s, x: 0.06 * np.sin(2 * np.pi * frequency * x.time + 1.0 + s.run))
    found, share = spectral_line(made[1])
    assert_allclose(found, frequency, atol=0.5 / 30.0)  # half of the resolution of 30 s
    assert share > 0.5
    judged = judge(*made, FLOOR, OPTIONS)
    assert judged.structured
    assert "time" in judged.depends_on
    assert_allclose(judged.period_hz, frequency, atol=0.5 / 30.0)


@pytest.mark.parametrize(("rho", "seed"), [(0.0, 0), (0.9, 1), (0.99, 2), (0.99, 3)])
def test_noise_of_any_colour_is_quiet(samples, rho, seed):
    found = judge(*sides(samples, nothing, seed, rho), FLOOR, OPTIONS, seed)
    assert not found.structured
    assert found.depends_on == ()
    assert found.confined_to == ()
    assert found.period_hz is None


def test_structure_below_what_the_sensors_resolve_is_nothing(samples):
    found = judge(*sides(samples, lambda s, x: 0.1 * x.position * x.velocity), 100.0 * FLOOR, OPTIONS)
    assert not found.structured


def test_what_an_imperfect_form_leaves_beside_a_large_removal_is_nothing(samples):
    made = [replace(s, before=30.0 * s.before) for s in sides(samples, lambda s, x: 0.04 * x.position * x.velocity)]
    assert not judge(*made, 0.1 * FLOOR, OPTIONS).structured


def test_share_explained_is_the_coefficient_of_determination():
    rng = np.random.default_rng(0)
    y = rng.standard_normal(500)
    guess = 0.7 * y + 0.1 * rng.standard_normal(500)
    wanted = 1.0 - np.var(y - guess) / np.var(y) - np.mean(y - guess) ** 2 / np.var(y)
    assert_allclose(share_explained(y, guess), wanted, rtol=1e-9)
    assert share_explained(y, -y) == 0.0


def test_features_are_the_named_signals_on_the_rows(samples):
    made = features(sides(samples, nothing)[0])
    assert made.shape == (samples[0].rows.size, len(SIGNALS))
    assert_allclose(made[:, SIGNALS.index("velocity")], samples[0].signals.velocity[samples[0].rows])
    assert_allclose(made[:, SIGNALS.index("temperature")], 0.0)  # not recorded: constant, never NaN
