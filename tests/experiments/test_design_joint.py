"""Designed motions keep their limits, beat the random ones, and refuse what cannot be reached."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Discrimination, Parameters
from drake_tc.experiments.design.expected import worth_of
from drake_tc.experiments.design.forms import Projection, form_of, identity
from drake_tc.experiments.design.goal import criterion_of, parse_goal
from drake_tc.experiments.design.joint import DesignJoint, MotionColumns
from drake_tc.experiments.design.lead import default_motion, lead_in, quintic
from drake_tc.experiments.design.motions import JointLimits, motion_basis, scaled
from drake_tc.experiments.design.next_log import PlannedRun, next_log
from drake_tc.experiments.design.request import DesignRequest, designed
from drake_tc.experiments.design.run import DesignOptions, design_joint, joint_within
from drake_tc.experiments.design.search import random_start
from drake_tc.experiments.sizes import size_of, sizes_found
from drake_tc.filtering.common_kernel import CommonKernel

LIMITS = JointLimits((-0.7, 0.9), 2.0, 9.0, jerk=300.0, torque=120.0, bandwidth_hz=2.0)
QUICK = DesignOptions(duration=10.0, starts=1, iterations=6)


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
    return DesignJoint("joint", numbers, context, 0.3, 0.9, 18.0, 0.1, 0.0, declared, 0.1, 60.0, 2e-3, 0.02, 0.02)


def form(joint, key):
    return form_of(joint, key, size_of(effect(key), joint.numbers, joint.context))


@pytest.mark.parametrize("kind", ["fourier", "bspline"])
def test_the_derivatives_of_a_basis_are_those_of_its_position(kind):
    basis = scaled(motion_basis(kind, 5.0, 2e-4, 2.0), LIMITS)
    motion = basis.motion(np.random.default_rng(0).normal(size=basis.size))
    closed = np.concatenate([motion, motion[:, :1]], axis=1)
    for order in range(3):
        slope = np.diff(closed[order]) / basis.step
        middle = 0.5 * (closed[order + 1, 1:] + closed[order + 1, :-1])
        # the trapezoidal rule errs by step^2/12 times the third derivative: 1.3e-5 of it at 10 Hz
        assert_allclose(slope, middle, atol=2e-5 * np.abs(motion[order + 1]).max())


def test_the_effort_of_a_motion_is_that_of_the_torque_balance(joint):
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    q, v, a, _ = motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(1)))
    signals = joint.signals(motion, 5e-3)
    n = joint.numbers
    torque = 0.9 * a + 18.0 * np.sin(q - 0.1) + 0.3 * a + n.viscous * v + n.coulomb * signals.direction
    assert_allclose(signals.effort, n.gain * torque, rtol=1e-12, atol=1e-15)
    assert_allclose(signals.command - signals.position, signals.effort, atol=1e-14)
    assert np.abs(torque).max() <= LIMITS.torque


def test_the_declared_columns_give_the_load_back(joint):
    """[y*, -phi] beta = tau + J qddot for beta of the joint itself, after the filters."""
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(2)))
    columns = MotionColumns(joint, motion, 5e-3)
    n = joint.numbers
    design = columns.design(joint.declared) @ np.array([1.0 / n.gain, n.viscous, n.coulomb])
    target = joint.load(motion[0], motion[2]) + 0.3 * motion[2]
    gain = CommonKernel(joint.kernel_width, 5e-3).gain(np.fft.rfftfreq(target.size, 5e-3)) ** 2
    assert_allclose(design, np.fft.irfft(np.fft.rfft(target) * gain, target.size), atol=1e-9 * np.abs(target).max())


def test_information_is_that_of_the_jacobian_by_finite_differences(joint):
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(3)))
    columns = MotionColumns(joint, motion, 5e-3)
    criterion = Parameters(joint, (), 10.0)
    beta = np.array([1.0 / joint.numbers.gain, 30.0, 5.0])

    def predicted(at):
        return columns.design(joint.declared) @ at

    steps = criterion.units
    jacobian = np.stack([predicted(beta + s * e) - predicted(beta) for s, e in zip(steps, np.eye(3), strict=True)], -1)
    expected = jacobian.T @ (columns.weight[:, None] * jacobian) * 60.0 * 10.0 / (len(jacobian) * 0.1**2)
    assert_allclose(criterion.information(columns), expected, rtol=1e-9)


def test_the_distance_of_two_models_is_the_least_over_all_parameters(joint):
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    motion = basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(4)))
    columns = MotionColumns(joint, motion, 5e-3)
    truth, other = form(joint, "load_dependent_friction"), form(joint, "quadratic_viscous")
    found = Discrimination(joint, ((truth, other),), 10.0).distances(columns, Projection(columns))[
        truth.effect.key, other.effect.key
    ]
    root = np.sqrt(columns.weight)[:, None]
    spans = np.hstack([columns.design(joint.declared), columns.of(Term(other.effect))])
    target = root[:, 0] * truth.change(columns, {})[:, 0]
    beta = np.linalg.lstsq(root * spans, target, rcond=None)[0]
    rest = target - (root * spans) @ beta
    assert_allclose(found, [rest @ rest * 60.0 * 10.0 / (rest.size * 0.1**2)], rtol=1e-6)


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
    assert design.optimum.value >= design.optimum.start_value
    time, motion = design.motion(500.0)
    assert time[0] == 0.0 and time[-1] >= 10.0
    assert_allclose(motion[1:3, [0, -1]], 0.0, atol=1e-6)  # at rest at both ends
    slack = 1.0 + 1e-6
    assert LIMITS.position[0] - 1e-6 <= motion[0].min() and motion[0].max() <= LIMITS.position[1] + 1e-6
    assert np.abs(motion[1]).max() <= LIMITS.velocity * slack
    assert np.abs(motion[2]).max() <= LIMITS.acceleration * slack
    assert np.abs(motion[3]).max() <= LIMITS.jerk * slack
    assert np.abs(np.diff(motion[0])).max() <= LIMITS.velocity / 500.0 * slack
    torque = joint.signals(design.basis.motion(design.optimum.x), design.basis.step).effort / joint.numbers.gain
    assert np.abs(torque).max() <= LIMITS.torque


def test_the_same_seed_gives_the_same_motion(joint):
    first, second = (design_joint(joint, LIMITS, parse_goal("parameters"), QUICK).optimum.x for _ in range(2))
    assert_allclose(first, second, rtol=0.0, atol=0.0)


def test_a_designed_motion_separates_better_than_a_growing_sinusoid(joint):
    design = design_joint(joint, LIMITS, parse_goal("tell:load_dependent_friction,quadratic_viscous"), QUICK)
    distances = design.expected[1:]
    assert min(each.after for each in distances) > min(each.default for each in distances), distances


def test_two_effects_that_are_one_function_are_refused_with_the_identity(joint):
    with pytest.raises(ParamsError, match=r"same function.*column of bias equals .*offset.*random states") as found:
        criterion_of(parse_goal("tell:torque_sensor_bias,encoder_offset"), joint, 30.0)
    assert "\n" not in str(found.value)


def test_an_effect_that_contains_another_is_told_from_it_in_one_order(joint):
    criterion = criterion_of(parse_goal("tell:torque_sensor_bias,asymmetric_friction"), joint, 30.0)
    assert isinstance(criterion, Discrimination)
    assert [pair[0].effect.id for pair in criterion.orders] == ["asymmetric_friction"]
    assert identity(joint, form(joint, "torque_sensor_bias"), form(joint, "asymmetric_friction")) is not None


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
        criterion_of(parse_goal("tell:thermal_friction,stribeck"), joint, 30.0)


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


def test_a_delay_and_a_lag_of_a_periodic_motion_are_those_of_a_fine_clock(joint):
    """At 0.1 ms the interpolation of the effect itself errs by (w h)^2/8 = 2e-7 at 2 Hz; at 5 ms it is off by 5e-4."""
    free = replace(joint, numbers=replace(joint.numbers, coulomb=0.0))
    motions = [motion_basis("fourier", 5.0, step, 2.0) for step in (5e-3, 1e-4)]
    x = np.random.default_rng(7).normal(size=motions[0].size) * 0.1
    coarse, fine = (MotionColumns(free, basis.motion(x), basis.step) for basis in motions)
    for key, name in (("delay.command", "delay"), ("current_lag", "lag")):
        terms = [Term(effect(key), {name: size}) for size in (2e-3, 5e-3)]
        plain = np.stack([fine.effort([term]) - fine.effort(()) for term in terms], axis=-1)[::50]
        assert_allclose(coarse.changes(terms), plain, atol=2e-4 * np.abs(plain).max())


def test_the_distance_of_a_delay_from_a_lag_is_the_least_over_a_fine_grid_of_lags(joint):
    context = replace(joint.context, drive="voltage")
    voltage = replace(joint, context=context)
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    columns = MotionColumns(voltage, basis.motion(random_start(voltage, basis, LIMITS, np.random.default_rng(8))), 5e-3)
    truth, other = form(voltage, "delay.loop"), form(voltage, "current_lag")
    found = Discrimination(voltage, ((truth, other),), 10.0).distances(columns, Projection(columns))[
        "delay.loop", "current_lag"
    ]
    root = np.sqrt(columns.weight)
    declared = root[:, None] * columns.design(joint.declared)
    target = root * truth.change(columns, {})[:, 0]
    lags = [Term(other.effect, {"lag": lag}) for lag in np.linspace(2e-3, 4e-3, 101)]
    apart = target[:, None] - root[:, None] * columns.changes(lags) / joint.numbers.gain
    left = left_by(declared, apart)
    least = float(np.min(np.sum(left**2, axis=0))) * 60.0 * 10.0 / (target.size * 0.1**2)
    assert_allclose(found, [least], rtol=0.15)  # the lags between two sizes of the grid lie on a chord


def test_a_rival_keeps_the_bounds_of_its_parameters(joint):
    """A payload pulls downwards: it does not imitate a spring that pushes, however well the columns fit."""
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    columns = MotionColumns(joint, basis.motion(random_start(joint, basis, LIMITS, np.random.default_rng(9))), 5e-3)
    spring, payload = form(joint, "cable_spring"), form(joint, "payload")
    declared = Projection(columns)
    pulls = declared.of(spring.change(columns, {})[:, :1])  # at rest at 0
    down, up = payload.left(declared, columns, np.hstack([pulls, -pulls]))
    free = left_by(declared.of(columns.of(Term(payload.effect))), pulls)
    assert down >= float(np.sum(free**2)) * (1.0 - 1e-9) and up > down


def test_of_two_effects_the_one_with_fewer_parameters_need_not_be_told_from_the_other(joint):
    """A diagnosis takes the smaller of two models that fit alike: a wrong gain that a payload imitates is named."""
    held = replace(joint, context=replace(joint.context, declared=joint.context.declared | {"drive_gain": 2e-4}))
    criterion = criterion_of(parse_goal("tell:servo_gain,payload"), held, 30.0)
    assert isinstance(criterion, Discrimination)
    assert [(a.effect.id, b.effect.id) for a, b in criterion.orders] == [("payload", "servo_gain")]
    both = criterion_of(parse_goal("tell:cable_spring,payload"), joint, 30.0)
    assert isinstance(both, Discrimination) and len(both.orders) == 2


def test_a_motion_that_hides_both_effects_tells_nothing(joint):
    """However far the two are from each other in a motion, each of them must be found in it."""
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    x = random_start(joint, basis, LIMITS, np.random.default_rng(11))
    columns = MotionColumns(joint, basis.motion(x), 5e-3)
    truth, other = form(joint, "load_dependent_friction"), form(joint, "quadratic_viscous")
    fitted = next_log([PlannedRun("run", joint, np.tile(basis.motion(x), (1, 2)), 5e-3)])
    for size, expected in ((1e-3, 0.0), (1.0, 1.0)):
        forms = [replace(each, strength=size * each.strength) for each in (truth, other)]
        found = Discrimination(joint, ((forms[0], forms[1]), (forms[1], forms[0])), 10.0)
        declared = Projection(columns)
        seen, apart = found.visibilities(columns, declared), found.distances(columns, declared)
        assert all(np.min(seen[a]) >= np.min(each) for (a, _), each in apart.items())
        assert_allclose(worth_of(found, fitted).values[0][2], expected, atol=0.05)


def test_a_declared_drive_gain_is_no_free_parameter_of_a_design(joint):
    """A wrong drive gain is then an effect that can be told from others, and one that declared columns do not hide."""
    held = replace(joint, context=replace(joint.context, declared=joint.context.declared | {"drive_gain": 2e-4}))
    basis = scaled(motion_basis("fourier", 5.0, 5e-3, 2.0), LIMITS)
    columns = MotionColumns(held, basis.motion(random_start(held, basis, LIMITS, np.random.default_rng(10))), 5e-3)
    gain, ripple = form(held, "servo_gain"), form(held, "cable_spring")
    assert gain.either_sign
    distances = Discrimination(held, ((gain, ripple), (ripple, gain)), 10.0).distances(columns, Projection(columns))
    root = np.sqrt(columns.weight)[:, None]
    free = columns.design(held.declared)[:, 1:]
    target = gain.strength * columns.effort(())[:, None] / held.numbers.gain
    left = left_by(root * np.hstack([free, columns.of(Term(ripple.effect))]), root * target)
    expected = float(np.sum(left**2)) * 60.0 * 10.0 / (len(left) * 0.1**2)
    assert_allclose(distances["servo_gain", "cable_spring"], [expected] * 2, rtol=1e-6)
    assert identity(held, gain, ripple) is None
    with pytest.raises(ParamsError, match="no drive gain is declared"):
        criterion_of(parse_goal("tell:servo_gain,cable_spring"), joint, 30.0)


def test_the_next_run_spans_its_limits(joint):
    """Shapes that only the wider motion shows take part: a Stribeck speed beyond that of the logs."""
    wide = JointLimits((-1.5, 1.5), 6.0, 30.0, bandwidth_hz=2.0)
    context = joint_within(joint, wide).context
    assert context.position_span == (-1.5, 1.5) and context.max_speed == 6.0
    design = design_joint(joint, wide, parse_goal("tell:load_dependent_friction,stribeck"), QUICK)
    assert design.joint.context.max_speed == 6.0


def test_sizes_of_a_report_are_those_of_the_parameter_that_tells_the_size():
    found = {"delay": {"delay": 4e-3}, "torque_sensor_gain": {"gain_error": -0.2}, "elasticity": {"compliance": None}}
    assert sizes_found(found) == {"delay": 4e-3, "torque_sensor_gain": 0.2}


def test_a_lag_whose_size_is_not_known_is_as_long_as_the_delay_that_it_imitates(joint):
    goal = replace(parse_goal("tell:delay,current_lag"), strengths={"delay": 7e-3})
    criterion = criterion_of(goal, replace(joint, context=replace(joint.context, drive="voltage")), 30.0)
    assert isinstance(criterion, Discrimination)
    assert [each.strength for each in criterion.orders[0]] == [7e-3, 7e-3]


def test_a_drive_gain_that_the_fits_hold_is_no_parameter_of_the_design(joint):
    """With an unknown load the effort is a sum of the declared columns, so that with its column M is singular."""
    declared = (Term(effect("viscous")), Term(effect("coulomb")), Term(effect("unknown_load")))
    held = replace(joint, declared=declared, gain_held=True, rotor_inertia=0.0)
    step = 2e-3
    time = np.arange(5000) * step
    q = 0.6 * np.sin(2.0 * np.pi * 0.3 * time) + 0.2 * np.sin(2.0 * np.pi * 0.7 * time)
    v, a = np.gradient(q, step), np.gradient(np.gradient(q, step), step)
    columns = MotionColumns(held, np.stack([q, v, a, np.zeros_like(q)]), step)
    criterion = Parameters(held, (), 10.0)
    information = criterion.information(columns)
    assert "1/drive gain" not in criterion.names
    assert len(criterion.names) == len(criterion.unit_names) == criterion.units.size == information.shape[0]
    assert np.linalg.cond(information) < 1e8
    free = Parameters(replace(held, gain_held=False), (), 10.0)
    assert np.linalg.cond(free.information(columns)) > 1e12


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
