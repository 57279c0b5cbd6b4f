"""Ages of channels, against logs whose channels are late in closed form, and against fits with other priors."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from drake_tc.diagnosis.ages import truncated, with_uncertain_ages
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import Posterior
from drake_tc.diagnosis.model import JointModel
from drake_tc.diagnosis.priors import LATE, LATE_S, SERVO_LAG_S
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.search import equally_noisy
from drake_tc.diagnosis.split import with_needed
from drake_tc.effects.current_lag import CurrentLag
from drake_tc.effects.delay import Delay, shift
from drake_tc.effects.saturation import Saturation
from tests.diagnosis.rigs import Joint, motion, record, rig_of

SERVO = Joint(drive="position_servo", gain=2e-3, torque_noise=0.02, encoder_noise=1e-5)
LATENESS = 1e-3


def heard(joint: Joint, late: str = "", seconds: float = 0.0) -> Evidence:
    """The evidence of three runs in which the record of one channel is late."""

    def run(name: str, turn: float, seed: int) -> Any:
        made, m = record(joint, name, turn, seed), motion(joint, turn)
        was = {
            "position": m.q - seconds * m.v + 0.5 * seconds**2 * m.a,
            "torque": m.tau - seconds * np.gradient(m.tau, joint.period),
            "position_command": made.columns["joint/position_command"]
            - seconds * np.gradient(made.columns["joint/position_command"], joint.period),
        }
        noise = made.columns["joint/position"] - m.q if late == "position" else 0.0
        columns = dict(made.columns) | ({f"joint/{late}": was[late] + noise} if late else {})
        return replace(made, columns=columns)

    train = [run(f"run{k}", 0.4 * k, k) for k in range(2)]
    model = joint_model(prepare_joint(train, [run("held", 2.1, 9)], rig_of(joint), "joint"))
    return Evidence(model).tempered(model.declared)


@pytest.mark.parametrize(
    ("late", "channel", "age"),
    [
        ("position", "position", LATENESS),
        ("torque", "torque", LATENESS),
        ("position_command", "command", -LATENESS),  # the drive acts on a newer command than the recorded one
    ],
)
def test_a_late_record_changes_the_residual_by_its_age_s_column(late: str, channel: str, age: float) -> None:
    """The residual under the true parameters, of a log with a late channel less that of the log without."""
    joint = replace(SERVO, torque_noise=0.0, encoder_noise=0.0)
    left = []
    for seconds in (0.0, LATENESS):
        train, declared = (model := heard(joint, late, seconds).model).train, model.declared
        columns = np.concatenate([b.values for b in model.blocks(train, declared)], axis=1)
        true = joint.gain * np.array([1.0, joint.viscous, joint.coulomb])
        age_column = train.age_columns(model.ages, joint.viscous)[:, list(model.ages).index(channel)]
        of_rows = np.full((len(train.samples.signals), 2), np.nan)
        of_rows[train.samples.rows] = np.stack([train.recorded.effort(()) - columns @ true, age_column], axis=1)
        left.append(of_rows)
    both = np.isfinite(left[0][:, 0]) & np.isfinite(left[1][:, 0])
    own, column = (left[1] - left[0])[both, 0], left[1][both, 1]
    assert abs(np.corrcoef(own, column)[0, 1]) > 0.99
    assert own @ column / (column @ column) == pytest.approx(age, rel=0.05)


@pytest.mark.parametrize("age", [0.0, 4e-3])
def test_a_late_command_comes_before_the_limit_of_the_drive(age: float) -> None:
    """The column is the slope, and what the fit subtracts the value, of the limited effort over the command's age."""
    model = heard(SERVO).model
    samples, own, at = model.train.samples, model.train.samples.signals, []
    limit = Term(Saturation(), {"limit": 0.4 * float(np.abs(own.effort[samples.rows]).max())})
    terms, beta = [*model.declared, limit], np.array([1.0 / SERVO.gain, SERVO.viscous, SERVO.coulomb])
    split = with_needed(model.train.recorded, terms, beta, measured=True, ages={"command": age} if age else {})
    for a in (age, age + 1e-5):
        goal = split.clean.samples.signals.command
        late = np.concatenate([shift(goal[s], a / own.period) for s in samples.segments])
        at.append(samples.reduce(np.clip(own.effort + late - goal, -limit.shape["limit"], limit.shape["limit"])))
    column = split.age_columns(["command"], SERVO.viscous)[:, 0]
    assert np.mean(np.abs(split.reduced_slope("inside")) < 1e-12) > 0.1, "rows in the limit know no age"
    assert rms((at[0] - at[1]) / 1e-5 - column) < 0.02 * rms(column)
    assert rms(split.target(terms) - age * column - at[0]) < 1e-3 * age * rms(column) + 1e-12


@pytest.mark.parametrize(("channel", "age"), [("effort", 0.0), ("effort", 3e-3), ("torque", 0.0)])
def test_an_age_acts_behind_the_lag_of_the_drive(channel: str, age: float) -> None:
    """The lag acts on an exact effort at its age, and its inverse on what a load at its age needs of a noisy effort."""
    joint, exact = replace(SERVO, drive="current", gain=0.08), channel == "effort"
    runs = [record(joint, name, turn, seed) for name, turn, seed in (("run0", 0.0, 0), ("run1", 0.4, 1))]
    model = joint_model(prepare_joint(runs, runs[1:], rig_of(joint), "joint"))
    lag = Term(CurrentLag(), {"lag": 8e-3})
    terms, beta = [*model.declared, lag], np.array([1.0 / joint.gain, joint.viscous, joint.coulomb])
    ages, shares = ({channel: age} if age else {}), (np.array([float(exact)]), np.zeros(1))
    split = with_needed(model.train.recorded, terms, beta, measured=True, ages=ages, shares=shares)
    samples, at = split.samples, list[np.ndarray]()
    through = partial(samples.by_segment, lag.effect, lag.shape)
    for a in (age, age + 1e-5):
        if exact:
            at.append(samples.reduce(through(by(samples.signals.effort, a, samples))))
        else:
            at.append(samples.reduce(-through(joint.gain * by(samples.signals.slow_torque, a, samples), undo=True)))
    column = split.age_columns([channel], joint.viscous)[:, 0]
    assert rms((at[0] - at[1]) / 1e-5 - column) < 0.02 * rms(column)
    assert not exact or rms(split.target(terms) - age * column - at[0]) < 1e-3 * age * rms(column) + 1e-12


def by(values: np.ndarray, seconds: float, samples: Samples) -> np.ndarray:
    """Values (T,) that many seconds later, stretch by stretch."""
    return np.concatenate([shift(values[s], -seconds / samples.signals.period) for s in samples.segments])


def averaged(joint: Joint, channel: str) -> tuple[np.ndarray, np.ndarray, JointModel]:
    """What a channel changes that is the mean over its period, x + T^2/24 d^2x/dt^2; columns of nuisances (N, k)."""
    left = []
    for share in (0.0, 1.0):
        run, m = record(joint, "run", 0.4, 0), motion(joint, 0.4)
        x = m.q if channel == "position" else run.columns[f"joint/{channel}"]
        bent = m.a if channel == "position" else np.gradient(np.gradient(x, joint.period), joint.period)
        columns = {**run.columns, f"joint/{channel}": x + share * joint.period**2 / 24.0 * bent}
        model = joint_model(prepare_joint([replace(run, columns=columns)], [run], rig_of(joint), "joint"))
        train = model.train
        known = np.concatenate([b.values for b in model.blocks(train, model.declared)], axis=1)
        own = train.recorded.effort(()) - known @ (joint.gain * np.array([1.0, joint.viscous, joint.coulomb]))
        nuisances = np.concatenate([block.values for block in model.nuisances(train)], axis=1)
        of_rows = np.full((len(train.samples.signals), 1 + nuisances.shape[1]), np.nan)
        of_rows[train.samples.rows] = np.column_stack([own, nuisances])
        left.append(of_rows)
    both = np.isfinite(left[0][:, 0]) & np.isfinite(left[1][:, 0])
    return (left[1] - left[0])[both, 0], left[1][both, 1:], model


def test_an_averaged_position_is_a_lag_of_the_damping_which_the_age_of_the_rate_leaves_open() -> None:
    joint = replace(SERVO, torque_noise=0.0, encoder_noise=0.0, period=0.01)
    change, columns, model = averaged(joint, "position")
    rate = columns[:, list(model.ages).index("rate")]
    age = float(change @ rate / (rate @ rate))
    assert age == pytest.approx(joint.period**2 / 24.0 / (joint.gain * joint.viscous), rel=0.1)
    mean, deviation = model.ages["rate"]
    assert abs(mean - SERVO_LAG_S[0] - 0.5 * age) < 0.1 * age
    assert deviation == pytest.approx(np.hypot(SERVO_LAG_S[1], 0.5 * age), rel=0.05)


@pytest.mark.parametrize(("channel", "number"), [("current", 0), ("torque", 1)])
def test_an_averaged_effort_or_torque_is_once_its_column(channel: str, number: int) -> None:
    change, columns, model = averaged(Joint(torque_noise=0.0, encoder_noise=0.0, period=0.01), channel)
    column = columns[:, len(model.ages) + number]
    assert change @ column / (column @ column) == pytest.approx(1.0, abs=0.05)
    assert np.corrcoef(change, column)[0, 1] > 0.98


def under(evidence: Evidence, scored: Scored, channel: str, late: float) -> Scored:
    """The set with another prior of one age, at the same variance."""
    mean, deviation = evidence.model.ages[channel]
    model = replace(evidence.model)
    changed = {channel: (mean + late, float(np.hypot(deviation, LATE_S)))}
    cast(Any, model).__dict__["ages"] = {**evidence.model.ages, **changed}
    return Evidence(model, evidence.noise, evidence.spread).score(scored.terms, scored.posterior.variance)


def test_late_channels_are_the_mixture_of_fits_with_each_channel_late() -> None:
    evidence = heard(SERVO, "position_command", 3e-3)
    scored = evidence.score(evidence.model.declared)
    scored = evidence.score(scored.terms, scored.posterior.variance)
    signs = {"command": -1.0, "torque": 1.0, "position": 1.0}
    fits = [scored, *(under(evidence, scored, channel, way * LATE_S) for channel, way in signs.items())]
    odds = np.array([0.0, *(LATE + f.posterior.log_evidence - scored.posterior.log_evidence for f in fits[1:])])
    weights = np.exp(odds) / np.exp(odds).sum()
    betas = np.array([f.posterior.beta for f in fits])
    mean = weights @ betas
    covariance = sum(
        w * (f.posterior.covariance + np.outer(b - mean, b - mean))
        for w, f, b in zip(weights, fits, betas, strict=True)
    )
    told = with_uncertain_ages(evidence, scored, scored).posterior
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(told.beta, mean, atol=0.01 * deviation.min(), rtol=1e-4)
    np.testing.assert_allclose(np.sqrt(np.diag(told.covariance)), deviation, rtol=0.01)
    assert deviation[1] > 1.2 * np.sqrt(scored.posterior.covariance[1, 1])  # viscous friction, which a command imitates


def test_beside_a_named_delay_the_ages_for_which_it_stands_have_their_priors(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = heard(SERVO)
    terms = [*evidence.model.declared, Term(Delay(), {"delay": 4e-3})]
    held = evidence.with_shapes(evidence.score(terms))
    told = with_uncertain_ages(evidence, held, held).posterior
    monkeypatch.setattr(JointModel, "held_ages", lambda self, terms: frozenset())
    free = Evidence(evidence.model, evidence.noise, evidence.spread)
    free = free.with_shapes(free.score(terms, held.posterior.variance))
    own, other, before = (np.sqrt(np.diag(p.covariance))[:3] for p in (told, free.posterior, held.posterior))
    np.testing.assert_allclose(own, other, rtol=0.05)  # the shapes' tangent is that of the held fit
    assert own[1] > 2.0 * before[1]


def test_a_shift_by_half_a_sample_smooths_nothing() -> None:
    """A sine with 8 samples a period; straight lines between the samples would lose 8 % of it."""
    at = np.arange(400.0)
    moved = shift(np.sin(2.0 * np.pi * at / 8.0), 0.5)
    np.testing.assert_allclose(moved[20:-20], np.sin(2.0 * np.pi * (at - 0.5) / 8.0)[20:-20], atol=4e-3)


def scored(names: str, variance: float, passed: float) -> Scored:
    terms = tuple(SimpleNamespace(effect=SimpleNamespace(key=name)) for name in names)
    posterior = Posterior(np.zeros(1), np.eye(1), variance, 0.0)
    return Scored(cast(Any, terms), 100.0, posterior, 1, passed=passed, left=variance)


def test_noise_counts_against_quieter_sets_but_for_a_part_that_leaves_less_beside_it() -> None:
    rows = SimpleNamespace(index=np.arange(1000))
    evidence = cast(
        Any,
        SimpleNamespace(
            noise_gain=lambda scored, noise: 1.0,
            noise=SimpleNamespace(share=1.0),
            model=SimpleNamespace(train=SimpleNamespace(rows=rows), context=SimpleNamespace(load="pendulum")),
        ),
    )
    loud = scored("ab", 1.0, 0.5)
    for quiet, variance, less in (("a", 0.4, False), ("a", 0.6, True), ("c", 0.4, True)):
        pair = equally_noisy([(evidence, loud), (evidence, scored(quiet, variance, 0.0))])
        assert pair[0][1].log_odds == 100.0
        expected = 0.5 * 1000 * np.log(1.0 + 0.5 / variance) if less else 0.0
        assert pair[1][1].log_odds == pytest.approx(100.0 - expected)
    pair = equally_noisy([(evidence, scored("ab", 1.0, 1.2)), (evidence, scored("a", 2.0, 0.0))])
    assert pair[1][1].log_odds == pytest.approx(100.0 - 0.5 * 1000 * np.log(1.0 + 1.0 / 2.0))  # no more than is left


@pytest.mark.parametrize("bounds", [(-1.0, 2.0), (5.0, 9.0), (-9.0, -5.0), (-np.inf, 0.0), (0.4, np.inf)])
def test_a_posterior_that_ends_has_the_moments_of_its_density(bounds: tuple[float, float]) -> None:
    """By quadrature."""
    mean, deviation = 0.3, 0.7
    low, high = max(bounds[0], -12.0), min(bounds[1], 12.0)
    moments = [quad(lambda x, k=k: x**k * norm.pdf(x, mean, deviation), low, high, epsabs=0.0)[0] for k in range(3)]
    first = moments[1] / moments[0]
    expected = np.log(moments[0]), first, moments[2] / moments[0] - first**2
    np.testing.assert_allclose(truncated(*bounds, mean, deviation), expected, rtol=1e-6)


def test_no_late_channel_takes_friction_below_zero() -> None:
    """Of a fit whose friction is nearly 0, at the ages that belong to this, as little of the effort is left after."""
    evidence = heard(SERVO, "position_command", 3e-3)
    scored = evidence.score(evidence.model.declared)
    covariance, beta = scored.posterior.covariance, scored.posterior.beta
    near = beta - 0.999 * beta[1] * covariance[:, 1] / covariance[1, 1]
    less = replace(scored, posterior=replace(scored.posterior, beta=near))
    told = with_uncertain_ages(evidence, less, less)
    before, after = (np.std(evidence.residual(evidence.model.train, s, runs=True)) for s in (less, told))
    assert told.b[1] >= 0.0
    assert after == pytest.approx(before, rel=0.1)
