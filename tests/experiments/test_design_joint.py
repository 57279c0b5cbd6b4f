"""Designed motions keep their limits, beat the random ones, and refuse what cannot be reached."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Discrimination, Parameters, form_of
from drake_tc.experiments.design.goal import criterion_of, parse_goal
from drake_tc.experiments.design.identity import identity
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.lead import default_motion, lead_in, quintic
from drake_tc.experiments.design.motions import JointLimits, motion_basis
from drake_tc.experiments.design.next_log import PlannedRun, rough_log
from drake_tc.experiments.design.request import DesignRequest, designed
from drake_tc.experiments.design.run import DesignOptions, design_joint
from drake_tc.experiments.design.search import random_start
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.experiments.sizes import sizes_found
from drake_tc.logs.rig import parse_rig

LIMITS = JointLimits((-0.7, 0.9), 2.0, 9.0, jerk=300.0, torque=120.0, bandwidth_hz=2.0)
QUICK = DesignOptions(duration=10.0, starts=1, iterations=40)


def left_by(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What least squares with these columns leaves."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


@pytest.fixture(scope="module")
def joint() -> DesignJoint:
    numbers = JointNumbers(2e-4, 30.0, 5.0, 1.2, 100.0, 0.02, 2.0, 1.6)
    context = Context(
        drive="position_servo",
        load="torque",
        recorded=frozenset(),
        declared={"rotor_inertia": 0.3},
        max_speed=2.0,
        position_span=(-0.7, 0.9),
        effort_span=(-0.02, 0.02),
        period=1e-3,
        torque_span=(-30.0, 30.0),
        duration=30.0,
    )
    declared = (Term(effect("viscous")), Term(effect("coulomb")))
    return DesignJoint("joint", numbers, context, 0.3, 0.9, 18.0, 0.1, 0.0, declared, 0.1, 60.0, 2e-3)


def form(joint, key):
    return form_of(joint, key)


@pytest.mark.parametrize("kind", ["fourier", "bspline"])
def test_the_derivatives_of_a_basis_are_those_of_its_position(kind):
    basis = motion_basis(kind, 5.0, 2e-4, replace(LIMITS, bandwidth_hz=2.0))
    motion = basis.motion(np.random.default_rng(0).normal(size=basis.size))
    closed = np.concatenate([motion, motion[:, :1]], axis=1)
    for order in range(3):
        slope = np.diff(closed[order]) / basis.step
        middle = 0.5 * (closed[order + 1, 1:] + closed[order + 1, :-1])
        # the trapezoidal rule errs by step^2/12 times the third derivative: 1.3e-5 of it at 10 Hz
        assert_allclose(slope, middle, atol=2e-5 * np.abs(motion[order + 1]).max())


def test_the_effort_of_a_motion_is_that_of_the_torque_balance(joint):
    basis = motion_basis("fourier", 5.0, 5e-3, replace(LIMITS, bandwidth_hz=2.0))
    q, v, a, _ = motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(1)))
    signals = joint.signals(motion, 5e-3)
    n = joint.numbers
    torque = 0.9 * a + 18.0 * np.sin(q - 0.1) + 0.3 * a + n.viscous * v + n.coulomb * signals.direction
    assert_allclose(signals.effort, n.gain * torque, rtol=1e-12, atol=1e-15)
    assert_allclose(signals.command - signals.position, signals.effort, atol=1e-14)
    assert np.abs(torque).max() <= LIMITS.torque


def logged(joint, seed):
    """The mean log of a random motion of 10 s."""
    basis = motion_basis("fourier", 5.0, 5e-3, replace(LIMITS, bandwidth_hz=2.0))
    motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(seed)))
    return rough_log([PlannedRun("run", joint, motion, basis.step)], 2)


@pytest.mark.parametrize(
    ("key", "other"), [("load_dependent_friction", "quadratic_viscous"), ("cable_spring", "payload")]
)
def test_the_distance_of_two_models_is_the_least_over_all_parameters_within_their_bounds(joint, key, other):
    """Priors are rows of a least-squares problem; a payload that pulls downwards imitates no spring that pushes."""
    fitted, truth, rival = logged(joint, 4), form(joint, key), form(joint, other)
    odds = EffectOdds(fitted, [truth.effect, rival.effect], {each.effect.key: each.shapes for each in (truth, rival)})
    evidence, train = fitted.evidence, fitted.evidence.model.train
    columns, prior = evidence.design(train, [*joint.declared, Term(rival.effect, rival.shapes[0])])
    weight = math.sqrt(evidence.noise.share / fitted.best.posterior.variance)
    rows = np.vstack([weight * columns, np.diag(1.0 / prior.deviation)])
    low = np.where(prior.positive, 0.0, -np.inf)
    size = 1 + sum(len(t.effect.coefficients) for t in joint.declared)
    low[:size] = -np.inf  # what is declared is far from its bounds
    for variant in odds.variants[key]:
        own = evidence.term_columns(train, variant.term) @ (truth.strength * variant.unit)
        target = np.concatenate([weight * own, np.zeros(columns.shape[1])])
        least = 2.0 * lsq_linear(rows, target, (low, np.inf), tol=1e-12).cost
        assert_allclose(odds.apart(variant, rival.effect, truth.strength)[1], least, rtol=1e-4)


@pytest.mark.parametrize(
    "goal",
    [
        "parameters",
        "tell:load_dependent_friction,quadratic_viscous",
        pytest.param("all", marks=pytest.mark.slow),
    ],
)
def test_a_designed_motion_keeps_every_limit_and_is_no_worse_than_any_random_one(joint, goal):
    design = design_joint(joint, LIMITS, parse_goal(goal), QUICK)
    assert design.plan.value >= design.plan.start_value
    if goal.startswith("tell"):
        distances = design.expected[1:]
        assert min(each.after for each in distances) > min(each.default for each in distances), distances
    time, motion = design.motion(500.0)
    assert time[0] == 0.0 and time[-1] >= 10.0
    assert_allclose(motion[1:3, [0, -1]], 0.0, atol=1e-6)  # at rest at both ends
    slack = 1.0 + 1e-6
    assert LIMITS.position[0] - 1e-6 <= motion[0].min() and motion[0].max() <= LIMITS.position[1] + 1e-6
    assert np.abs(motion[1]).max() <= LIMITS.velocity * slack
    assert np.abs(motion[2]).max() <= LIMITS.acceleration * slack
    assert np.abs(motion[3]).max() <= LIMITS.jerk * slack
    assert np.abs(np.diff(motion[0])).max() <= LIMITS.velocity / 500.0 * slack
    torque = joint.signals(design.basis.motion(design.x), design.basis.step).effort / joint.numbers.gain
    assert np.abs(torque).max() <= LIMITS.torque


@pytest.fixture(scope="module")
def arm_joint(joint) -> DesignJoint:
    """A joint of an arm, whose rotor inertia is fitted and whose gain is held, with more slow noise than white."""
    context = replace(joint.context, drive="current", load="robot", declared={}, period=1e-2, effort_span=(-4.0, 4.0))
    numbers = replace(joint.numbers, gain=0.15, viscous=8.0, coulomb=6.0, torque=26.0, effort=4.0, rotor=0.8)
    declared = (*joint.declared, Term(effect("rotor_inertia")))
    rest = {"rotor_inertia": 0.0, "noise": 0.5, "independent_per_second": 30.0, "gain_held": True}
    servo = {"joint": "joint", "drive": "current", "load": "torque", "declared": {"rotor_inertia": None}}
    rest |= {"rig": parse_rig({**servo, "drive_gain": 0.15})}
    return replace(
        joint, numbers=numbers, context=context, declared=declared, left=NoiseModel(10.0, 3.0), floor=0.15, **rest
    )


FAST = {("parameters:stribeck", "arm_joint", 40), ("tell:delay,current_lag", "joint", 0)}
GOALS = ("parameters", "parameters:stribeck", "tell:load_dependent_friction,quadratic_viscous")


@pytest.mark.parametrize(
    ("goal", "name", "iterations"),
    [
        pytest.param(*each, marks=[] if each in FAST else pytest.mark.slow)
        for each in product((*GOALS, "tell:delay,current_lag", "all"), ("joint", "arm_joint"), (0, 40))
    ],
)
def test_a_design_states_nothing_worse_than_its_comparison(request, name, goal, iterations):
    """By the stated figures alone: intervals, the probability, and the sizes at which effects are found."""
    limits = replace(LIMITS, velocity=1.5, acceleration=4.0)
    options = replace(QUICK, iterations=iterations)
    design = design_joint(request.getfixturevalue(name), limits, parse_goal(goal), options)
    after, default = (np.array([getattr(each, which) for each in design.expected]) for which in ("after", "default"))
    if goal.startswith("tell"):
        assert after[0] >= default[0]
    elif goal == "all":
        forms = criterion_of(design.goal, design.joint).forms
        strengths = np.array([each.strength for each in forms])
        power = np.array([-2.0 if each.size.falling else 2.0 for each in forms])
        lost = [np.mean(np.log1p(np.clip((sizes / strengths) ** power, 1e-12, 1e12))) for sizes in (after, default)]
        assert lost[0] <= lost[1] + 1e-9
    else:
        assert np.mean(np.log(after / default)) <= 0.0


def test_the_same_seed_gives_the_same_motion(joint):
    options = replace(QUICK, iterations=5)
    first, second = (design_joint(joint, LIMITS, parse_goal("parameters"), options).x for _ in range(2))
    assert_allclose(first, second, rtol=0.0, atol=0.0)


def test_two_effects_that_are_one_function_are_refused_with_the_identity(joint):
    with pytest.raises(ParamsError, match=r"same function.*column of bias equals .*offset.*random states") as found:
        criterion_of(parse_goal("tell:torque_sensor_bias,encoder_offset"), joint)
    assert "\n" not in str(found.value)


def test_an_effect_whose_shape_the_log_gives_has_columns_at_that_shape(joint):
    """A payload hangs where the pendulum does: it is no spring, and the same function as itself."""
    hanging = replace(joint, context=replace(joint.context, load="pendulum", link_inertia=0.9, hang_angle=0.1))
    payload = effect("payload.pendulum")
    assert identity(hanging, payload, effect("cable_spring")) is None
    assert identity(hanging, payload, payload) is not None


def test_an_effect_that_contains_another_is_told_from_it_in_one_order(joint):
    criterion = criterion_of(parse_goal("tell:torque_sensor_bias,asymmetric_friction"), joint)
    assert isinstance(criterion, Discrimination)
    assert [pair[0].effect.id for pair in criterion.orders] == ["asymmetric_friction"]
    assert identity(joint, effect("torque_sensor_bias"), effect("asymmetric_friction")) is not None


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("faster", "expected parameters, tell:A,B or all"),
        ("tell:stribeck", "two different effects"),
        ("tell:stribeck,nonsense", "no effect"),
        ("all:stribeck", "expected parameters"),
    ],
)
def test_a_goal_that_is_none_is_one_line(goal, words):
    with pytest.raises(ParamsError, match=words):
        parse_goal(goal)


def test_an_effect_that_the_logs_cannot_show_is_refused(joint):
    with pytest.raises(ParamsError, match="temperature not recorded"):
        criterion_of(parse_goal("tell:thermal_friction,stribeck"), joint)


def test_a_velocity_limit_below_what_the_encoder_resolves_is_refused(joint):
    with pytest.raises(ParamsError, match=r"velocity limit of 0\.001 rad/s is too small") as found:
        design_joint(joint, replace(LIMITS, velocity=1e-3), parse_goal("parameters"), QUICK)
    assert "\n" not in str(found.value)


def test_limits_that_contradict_each_other_are_refused(joint):
    with pytest.raises(ParamsError, match="contradict each other"):
        design_joint(joint, JointLimits((-0.7, 0.9), 2.0, 9.0, torque=10.0), parse_goal("parameters"), QUICK)
    with pytest.raises(ParamsError, match="LOW < HIGH"):
        JointLimits((0.5, -0.5), 2.0, 9.0)
    with pytest.raises(ParamsError, match="velocity"):
        JointLimits((-0.5, 0.5), -2.0, 9.0)


def test_a_lead_in_joins_rest_and_motion_within_the_limits():
    state = np.array([0.3, 0.4, -2.0])
    rest, length = lead_in(state, LIMITS, "joint")
    motion = quintic(np.array([rest, 0.0, 0.0]), state, length, np.linspace(0.0, length, 1001))
    assert_allclose(motion[:3, -1], state, atol=1e-9)
    assert_allclose(motion[1:3, 0], 0.0, atol=1e-12)
    assert np.abs(motion[2]).max() <= LIMITS.acceleration
    assert math.isfinite(rest)


def test_the_default_motion_fills_the_limits(joint):
    motion = default_motion(joint, LIMITS, 30.0, 5e-3)
    assert np.abs(motion[1]).max() <= LIMITS.velocity and np.abs(motion[2]).max() <= LIMITS.acceleration
    assert motion[0].max() > 0.6 * LIMITS.position[1]


def test_the_distance_of_a_delay_from_a_lag_is_the_least_over_a_fine_grid_of_lags(joint):
    voltage = replace(joint, context=replace(joint.context, drive="voltage"))
    fitted, truth, other = logged(voltage, 8), form(voltage, "delay.loop"), form(voltage, "current_lag")
    odds = EffectOdds(fitted, [truth.effect, other.effect])
    (variant,), evidence = odds.variants["delay.loop"], fitted.evidence
    split = evidence.model.train
    size = float(variant.sizes[np.argmin(np.abs(np.log(variant.sizes / truth.strength)))])
    acts = split.target([]) - split.target([Term(truth.effect, {"delay": size})])
    lags = [Term(other.effect, {"lag": lag}) for lag in np.linspace(0.3, 1.5, 101) * size]
    apart = np.stack([acts - split.target([]) + split.target([lag]) for lag in lags], axis=1)
    columns, prior = evidence.design(split, joint.declared)
    weight = math.sqrt(evidence.noise.share / fitted.best.posterior.variance)
    rows = np.vstack([weight * columns, np.diag(1.0 / prior.deviation)])
    white = split.rows.whitened(apart, evidence.noise)[0]
    left = left_by(rows, np.vstack([weight * white, np.zeros((columns.shape[1], len(lags)))]))
    least = float(np.min(np.sum(left**2, axis=0)))
    # between two sizes of its grid, the change by a lag is taken to be on a straight line
    assert_allclose(odds.apart(variant, other.effect, size)[1], least, rtol=0.15)


def test_of_two_effects_the_one_with_fewer_parameters_need_not_be_told_from_the_other(joint):
    """A diagnosis takes the smaller of two models that fit alike: a wrong gain that a payload imitates is named."""
    held = replace(joint, context=replace(joint.context, declared=joint.context.declared | {"drive_gain": 2e-4}))
    criterion = criterion_of(parse_goal("tell:servo_gain,payload"), held)
    assert isinstance(criterion, Discrimination)
    assert [(a.effect.id, b.effect.id) for a, b in criterion.orders] == [("payload", "servo_gain")]
    both = criterion_of(parse_goal("tell:cable_spring,payload"), joint)
    assert isinstance(both, Discrimination) and len(both.orders) == 2


def test_a_motion_that_hides_both_effects_tells_nothing(joint):
    """However far the two are from each other in a motion, each of them must be found in it."""
    fitted = logged(joint, 11)
    truth, other = form(joint, "load_dependent_friction"), form(joint, "quadratic_viscous")
    for size, expected in ((1e-3, 0.0), (1.0, 1.0)):
        forms = [replace(each, strength=size * each.strength) for each in (truth, other)]
        worth = Discrimination(((forms[0], forms[1]), (forms[1], forms[0]))).worth(fitted)
        probability, *distances = (value for *_, value in worth.values)
        assert_allclose(probability, expected, atol=0.05)
        assert all(apart <= seen * (1.0 + 1e-9) for apart, seen in zip(distances[:2], distances[2:], strict=True))


def test_a_declared_drive_gain_is_no_free_parameter_of_a_design(joint):
    """A wrong drive gain is then an effect that can be told from others, and one that declared columns do not hide."""
    held = replace(joint, context=replace(joint.context, declared=joint.context.declared | {"drive_gain": 2e-4}))
    assert identity(held, effect("servo_gain"), effect("cable_spring")) is None
    goal = parse_goal("tell:servo_gain,cable_spring")
    distances = criterion_of(goal, held).worth(logged(held, 10)).values[1:]
    assert all(value > 1.0 for *_, value in distances)
    with pytest.raises(ParamsError, match="no drive gain is declared"):
        criterion_of(goal, joint)


def test_the_next_run_spans_its_limits(joint):
    """Shapes that only the wider motion shows take part: a Stribeck speed beyond that of the logs."""
    wide = JointLimits((-1.5, 1.5), 6.0, 30.0, bandwidth_hz=2.0)
    design = design_joint(
        joint, wide, parse_goal("tell:load_dependent_friction,stribeck"), replace(QUICK, starts=1, iterations=0)
    )
    context = design.joint.context
    assert context.position_span == (-1.5, 1.5) and context.max_speed == 6.0


def test_sizes_of_a_report_are_those_of_the_parameter_that_tells_the_size():
    found = {"delay": {"delay": 4e-3}, "torque_sensor_gain": {"gain_error": -0.2}, "elasticity": {"compliance": None}}
    assert sizes_found(found) == {"delay": 4e-3, "torque_sensor_gain": 0.2}


def test_a_lag_whose_size_is_not_known_is_as_long_as_the_delay_that_it_imitates(joint):
    goal = replace(parse_goal("tell:delay,current_lag"), strengths={"delay": 7e-3})
    criterion = criterion_of(goal, replace(joint, context=replace(joint.context, drive="voltage")))
    assert isinstance(criterion, Discrimination)
    assert [each.strength for each in criterion.orders[0]] == [7e-3, 7e-3]


def test_a_drive_gain_that_the_fits_hold_is_no_parameter_of_the_design(joint):
    names = [[name for name, *_ in Parameters(replace(joint, gain_held=held)).worth(None).values] for held in (0, 1)]
    assert names[0] == ["1/drive gain, half 95 % interval", *names[1]]


@pytest.mark.parametrize("smallest", [False, True])
def test_d_and_e_optimality_are_those_of_the_covariance(joint, smallest):
    """Of [1/K, F_v, F_c] in units of a tenth of their values, by the delta method."""
    fitted = logged(joint, 3)
    n, b = joint.numbers, fitted.best.b
    covariance = fitted.best.posterior.covariance[:3, :3]
    turn = np.column_stack([-np.array([1.0, n.viscous, n.coulomb]) / b[0], np.eye(3)[:, 1:] / b[0]])
    turn[0, 0] /= b[0]
    turn /= 0.1 * np.array([[1.0 / n.gain], [n.viscous], [n.coulomb]])
    eigen = np.linalg.eigvalsh(turn @ covariance @ turn.T)
    expected = -np.log(eigen.max()) if smallest else -np.sum(np.log(eigen))
    assert_allclose(Parameters(joint, (), smallest).worth(fitted).total, expected, atol=0.05)


def test_a_torque_limit_is_refused_where_nothing_fixes_the_scale_of_the_torques(tmp_path):
    (tmp_path / "rig.yaml").write_text("joint: s\ndrive: position_servo\nload: unknown\n", encoding="utf-8")
    time = np.arange(400) * 0.01
    q = 0.5 * np.sin(2.0 * np.pi * 0.5 * time)
    rows = np.column_stack([time, q, q + 0.01 * np.cos(2.0 * np.pi * 0.5 * time)])
    header = "time,s/position,s/position_command"
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=header, comments="")
    limits = {"torque": 1.0}
    request = DesignRequest(tmp_path / "rig.yaml", (tmp_path / "run.csv",), None, "parameters", None, (), limits)
    with pytest.raises(ParamsError, match=r"--torque: joint s: .*scale.*declare drive_gain"):
        designed(request, DesignOptions())
