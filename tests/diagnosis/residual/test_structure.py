"""What is left: planted structure is seen and named, noise of any colour is not."""

from dataclasses import replace

import numpy as np
import pytest
from mailed import Mailed
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.priors import LEAST_FRACTION
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.residual.over_time import slow_share, spectral_line
from drake_tc.diagnosis.residual.structure import FEATURES, assess_residual, cross_predict, features, share_explained
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.effects.library import effect

from ..rigs import Joint, record, rig_of

JOINT = Joint(duration=30.0, period=4e-3, torque_noise=0.25)
NOISE = 0.02
FLOOR = 0.5 * NOISE
KNOWN = BalanceCoefficients(1.0 / JOINT.gain, JOINT.viscous, JOINT.coulomb, 0.0)


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
        made.append(DataSplit(s, after, after))
    return made


def assess(made, floor, seed=0, **load):
    x = tuple(features(s.samples, KNOWN, servo=False, load_measured=True) for s in made)
    return assess_residual(*made, x, floor, seed, **load)


def nothing(s, x):
    return np.zeros(s.rows.size)


def test_a_function_of_two_signals_is_structure_that_depends_on_them(samples):
    found = assess(sides(samples, lambda s, x: 0.1 * x.position * x.velocity), FLOOR)
    assert found.structured
    assert set(found.depends_on[:2]) == {"position", "velocity"}
    assert found.confined_to == ()
    assert found.fraction > 0.7
    assert found.explainable_rms < 2.0 * NOISE  # what is left once the function is known: mostly the noise


def test_a_touched_stretch_is_confined_to_its_run_and_time(samples):
    def touch(s, x):
        second = np.array([name == "two" for name in s.runs])[s.run]
        return np.where(second & (x.time > 11.0) & (x.time < 13.0), 0.4, 0.0)

    found = assess(sides(samples, touch), FLOOR)
    assert found.structured
    assert "time" in found.depends_on
    assert {c.run for c in found.confined_to} == {"two"}
    # half-second blocks
    assert_allclose(min(c.start for c in found.confined_to), 11.0, atol=0.6)
    assert_allclose(max(c.end for c in found.confined_to), 13.0, atol=0.6)


def test_a_spectral_line_is_found_at_its_frequency(samples, frequency=21.0):
    made = sides(samples, lambda s, x: 0.06 * np.sin(2 * np.pi * frequency * x.time + 1.0 + s.run))
    found, share = spectral_line(made[1])
    assert_allclose(found, frequency, atol=0.5 / JOINT.duration)  # half of the resolution
    assert share > 0.5
    assessed = assess(made, FLOOR)
    assert assessed.structured
    assert "time" in assessed.depends_on
    assert_allclose(assessed.period_hz, frequency, atol=0.5 / JOINT.duration)


def test_coloured_noise_is_quiet(samples, rho=0.99, seed=2):
    found = assess(sides(samples, nothing, seed, rho), FLOOR, seed)
    assert not found.structured
    assert found.depends_on == ()
    assert found.confined_to == ()
    assert found.period_hz is None


def wander(s, x):
    """A random walk of each run, and a level beside it in the held-out run."""
    steps = np.random.default_rng([5, len(s.runs)]).standard_normal(s.rows.size)
    walk = np.cumsum(steps) * 0.05 / np.sqrt(s.rows.size)
    return walk + (0.3 if s.runs == ("held",) else 0.0)


def warming(samples):
    """The samples with a temperature that rises slowly and evenly."""
    made = []
    for s in samples:
        signals = replace(s.signals, temperature=20.0 + 0.1 * s.signals.time)
        made.append(replace(s, signals=signals))
    return made


def test_a_held_out_run_on_which_the_torque_sensor_has_wandered_is_no_structure(samples):
    made = sides(warming(samples), wander)
    found = assess(made, FLOOR, sensor=True)
    assert not found.structured
    assert found.excess
    assert found.fraction < LEAST_FRACTION
    assert assess(made, FLOOR).structured, "without a torque sensor the model does not carry over"


def test_friction_that_warms_stays_structure_beside_a_torque_sensor(samples):
    made = sides(warming(samples), lambda s, x: 0.02 * x.direction * (x.temperature - 20.0))
    assert assess(made, FLOOR, sensor=True).structured


def test_what_is_slow_is_explained_by_its_neighbourhood_in_time(samples):
    made = sides(samples, nothing)[1]
    time = made.samples.signals.time[made.samples.rows]
    line = replace(made, after=0.1 + 0.01 * time)
    assert slow_share(line, 1.5) > 0.99
    assert abs(slow_share(made, 1.5)) < 0.1  # white noise
    fast = replace(made, after=np.sin(2.0 * np.pi * time / 0.5))
    assert slow_share(fast, 1.5) < 0.05


def test_structure_below_what_the_sensors_resolve_is_nothing(samples):
    found = assess(sides(samples, lambda s, x: 0.1 * x.position * x.velocity), 100.0 * FLOOR)
    assert not found.structured


def test_what_an_imperfect_form_leaves_beside_a_large_removal_is_nothing(samples):
    made = [replace(s, before=30.0 * s.before) for s in sides(samples, lambda s, x: 0.04 * x.position * x.velocity)]
    assert not assess(made, 0.1 * FLOOR).structured


def test_share_explained_is_the_coefficient_of_determination():
    rng = np.random.default_rng(0)
    y = rng.standard_normal(500)
    guess = 0.7 * y + 0.1 * rng.standard_normal(500)
    wanted = 1.0 - np.var(y - guess) / np.var(y) - np.mean(y - guess) ** 2 / np.var(y)
    assert_allclose(share_explained(y, guess), wanted, rtol=1e-9)
    assert share_explained(y, -y) == 0.0


def test_features_are_the_command_and_smoothed_motion(samples):
    split = sides(samples, nothing)[0]
    made = features(split.samples, KNOWN, servo=False, load_measured=True)
    signals, rows = samples[0].signals, samples[0].rows
    assert made.shape == (rows.size, len(FEATURES))
    assert_allclose(made[:, FEATURES.index("command")], signals.command[rows])
    # the motion is slow against the wider kernel, so both kernels give the same velocity to a percent of its range;
    # at the ends of a run the wider kernel reaches beyond it
    inner = (signals.time[rows] > 0.5) & (signals.time[rows] < JOINT.duration - 0.5)
    velocity = made[inner, FEATURES.index("velocity")]
    assert_allclose(velocity, signals.velocity[rows][inner], atol=0.01 * np.ptp(velocity))
    assert_allclose(made[:, FEATURES.index("temperature")], 0.0)  # not recorded: constant, never NaN


def coloured(size, period, low_hz, high_hz, rms, seed):
    """Gaussian noise (T,) of the given RMS between two frequencies."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(size))
    frequency = np.fft.rfftfreq(size, period)
    spectrum[(frequency < low_hz) | (frequency > high_hz)] = 0.0
    noise = np.fft.irfft(spectrum, size)
    return rms * noise / np.std(noise)


@pytest.mark.parametrize(
    ("drive", "channel", "rms", "band"),
    [
        pytest.param("position_servo", "torque", 0.6, (0.05, 0.3), marks=pytest.mark.slow),
        ("current", "effort", None, (1.0, 5.0)),
    ],
)
def test_noise_on_one_channel_is_no_structure(drive, channel, rms, band):
    """The joint lacks nothing; a channel has independent noise of several noise floors."""
    joint = replace(JOINT, drive=drive, gain=2e-3 if drive == "position_servo" else 0.08, torque_noise=0.05)
    size = rms if rms is not None else 0.6 * joint.gain
    splits, x, fitted = [], [], None
    for number, (names, shift) in enumerate(((("one", "two"), (0.0, 0.9)), (("held",), (2.3,)))):
        runs = []
        for k, (name, by) in enumerate(zip(names, shift, strict=True)):
            run = record(joint, name, by, 10 * number + k)
            command = "position_command" if drive == "position_servo" else "current"
            column = f"joint/{ {'effort': command}.get(channel, channel) }"
            noise = coloured(len(run), run.period, *band, size, 100 * number + k)
            runs.append(replace(run, columns=dict(run.columns) | {column: run.columns[column] + noise}))
        made = build_samples(runs, rig_of(joint), "joint")
        columns = Columns(made)
        fitted = fit(columns, [Term(effect("viscous")), Term(effect("coulomb"))]) if fitted is None else fitted
        left = fitted.gain * (columns.target - columns.design(fitted.terms) @ fitted.beta)
        splits.append(DataSplit(made, left, left))
        x.append(
            features(
                made,
                BalanceCoefficients.of(fitted.terms, fitted.beta),
                servo=drive == "position_servo",
                load_measured=True,
            )
        )
    floor = 0.25 * float(np.sqrt(np.mean(splits[1].after ** 2)))
    found = assess_residual(*splits, tuple(x), floor)
    assert not found.structured, found
    assert found.excess  # four floors are left: that is said, but not called structure


def test_workers_predict_what_this_process_predicts():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((900, 3))
    y = np.sin(2.0 * x[:, 0]) + 0.1 * rng.standard_normal(900)
    group, workers = np.arange(900) // 30, Mailed()
    alone, beside = (cross_predict((x, x[:, 1:]), y, group, 0, executor) for executor in (None, workers))
    assert len(workers.sent) == 8, "four folds of two sets of features"
    np.testing.assert_array_equal(beside, alone)
    assert share_explained(y, alone[0]) > 0.9
    assert share_explained(y, alone[1]) < 0.05, "without the signal that it depends on"
