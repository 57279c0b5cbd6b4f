"""Designs with known loads: information in closed form, loads that make effects different, limits, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.criteria import Discrimination, Parameters, form_of
from drake_tc.experiments.design.goal import criterion_of, parse_goal
from drake_tc.experiments.design.identity import identity
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.load_design import LoadDesign, design_with_loads
from drake_tc.experiments.design.loads import KnownLoad, carrying, declaring, parse_loads
from drake_tc.experiments.design.motions import JointLimits, motion_basis
from drake_tc.experiments.design.next_log import PlannedRun, rough_log
from drake_tc.experiments.design.run import DesignOptions, JointDesign, design_joint
from drake_tc.experiments.design.search import MotionSearch, slow_passes, splits
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.logs.rig import parse_rig, rig_document
from drake_tc.types import GRAVITY

LIMITS = JointLimits((-0.7, 0.9), 2.0, 9.0, jerk=300.0, torque=60.0, bandwidth_hz=2.0)
QUICK = DesignOptions(duration=10.0, starts=1, iterations=15)
HEAVY = KnownLoad(4.0, 0.5)
STEP = 5e-3


def joint_of(gravity=18.0, load="torque", gain=False, joint_type="revolute", **values) -> DesignJoint:
    numbers = JointNumbers(2e-2, 3.0, 2.0, 1.2, 30.0, 0.6, 2.0, 1.6)
    context = Context(
        drive="current",
        load=load,
        recorded=frozenset(),
        declared={"rotor_inertia": 0.3} | ({"drive_gain": 2e-2} if gain else {}),
        max_speed=2.0,
        position_span=(-0.7, 0.9),
        effort_span=(-0.6, 0.6),
        period=1e-3,
        torque_span=(-30.0, 30.0),
        duration=30.0,
        joint_type=joint_type,
    )
    declared = (Term(effect("viscous")), Term(effect("coulomb")))
    made = DesignJoint("joint", numbers, context, 0.3, 0.9, gravity, 0.0, 0.0, declared, 0.1, 60.0, 2e-3)
    return replace(made, gain_held=gain, **values)


def slow_sine(seconds: float) -> np.ndarray:
    time = np.arange(round(seconds / STEP)) * STEP
    w = 2.0 * np.pi / seconds
    return 0.3 * np.stack([np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time), 0.0 * time])


def sliding_mass():
    """A joint that lifts 1 kg, whose drive gain is known: its columns are the direction d and, for friction, L d."""
    base = joint_of(gravity=0.0, gain=True, joint_type="prismatic", link_inertia=1.0, constant=GRAVITY)
    base = replace(base, declared=(Term(effect("coulomb")),), numbers=replace(base.numbers, viscous=0.0))
    return base, carrying(base, KnownLoad(2.0))


@pytest.mark.parametrize("counts", [(1, 1), (1, 4)])
def test_two_loads_tell_load_dependent_friction_in_closed_form(counts):
    """Two constant loads L_1, L_2 for shares w_1, w_2 of n rows of noise s; the columns are d and L d. Then

    1/var(mu) = F = n w_1 w_2 (L_1 - L_2)^2/s^2
    """
    joints = sliding_mass()
    assert_allclose([j.load(np.zeros(1), np.zeros(1))[0] for j in joints], [GRAVITY, 3.0 * GRAVITY], rtol=1e-12)
    member, motion = effect("load_dependent_friction"), slow_sine(20.0)  # at most 0.03 m/s^2: 0.3 % of g
    runs = [
        PlannedRun(f"load_{k}", joint, np.tile(motion, (1, count)), STEP)
        for k, (joint, count) in enumerate(zip(joints, counts, strict=True))
    ]
    fitted = rough_log(runs)
    odds = EffectOdds(fitted, [member])
    (variant,) = odds.variants[member.key]
    n, noise = fitted.evidence.model.train.rows.index.size, fitted.noise
    one, two = np.array(counts) / sum(counts)
    # the filters of 28 ms round the jump of d at a reversal, where the rows that they reach have no weight
    assert_allclose(odds.information(variant, 1.0), n * one * two * (2.0 * GRAVITY / noise) ** 2, rtol=0.02)
    single = EffectOdds(rough_log(runs[:1]), [member])
    assert single.information(single.variants[member.key][0], 1.0) < 1e-3 * odds.information(variant, 1.0)


def test_the_best_split_for_two_parameters_under_two_loads_is_the_even_one():
    """det M = (n/s^2)^2 w_1 w_2 (L_1 - L_2)^2 is largest at w_1 = w_2."""
    joints, basis = sliding_mass(), motion_basis("fourier", 40.0, STEP, replace(LIMITS, bandwidth_hz=0.5))
    criterion = Parameters(joints[0], (form_of(joints[0], "load_dependent_friction"),))
    search = MotionSearch(joints, basis, LIMITS, criterion, 4)
    (x,) = (np.linalg.lstsq(basis.matrices[0], slow_sine(40.0)[0], rcond=None)[0],)
    even, uneven = (search.worth([x, x], slots).total for slots in ((2, 2), (1, 3)))
    assert_allclose(even - uneven, np.log(4.0 / 3.0), rtol=0.02)
    assert len(set(splits(4, 3))) == len(splits(4, 3)) == 15 and all(sum(each) == 4 for each in splits(4, 3))


def test_an_added_mass_changes_inertia_and_gravity_of_a_joint_that_turns():
    joint = replace(joint_of(), zero=0.2)
    q, a = np.linspace(-0.7, 0.9, 50), np.linspace(-3.0, 3.0, 50)
    more = carrying(joint, HEAVY).load(q, a) - joint.load(q, a)
    assert_allclose(more, 4.0 * 0.25 * a + 4.0 * GRAVITY * 0.5 * np.sin(q - 0.2), atol=1e-9)
    bare = replace(joint_of(gravity=0.1), zero=2.0)  # too little gravity to show where the link hangs
    more = carrying(bare, HEAVY).load(q, 0.0 * a) - bare.load(q, 0.0 * a)
    assert_allclose(more, 4.0 * GRAVITY * 0.5 * np.sin(q), atol=1e-9)
    turned = KnownLoad(4.0, 0.5, -0.4)
    more = carrying(joint, turned).load(q, 0.0 * a) - joint.load(q, 0.0 * a)
    assert_allclose(more, 4.0 * GRAVITY * 0.5 * np.sin(q + 0.4), atol=1e-9)
    assert parse_loads(["0", "4@0.5@-0.4"]) == (KnownLoad(0.0), turned)
    assert carrying(joint, KnownLoad(0.0)) is joint


def test_slow_passes_cover_the_range_at_nearly_constant_speed_in_both_directions():
    joint = joint_of()
    basis = motion_basis("fourier", 10.0, STEP, replace(LIMITS, bandwidth_hz=4.0))
    motion = basis.motion(slow_passes(joint, basis, LIMITS)[0])
    assert np.ptp(motion[0]) > 0.9 * 1.6
    middle = np.abs(motion[0] - 0.1) < 0.5
    assert (np.abs(np.abs(motion[1][middle]) - 0.32) < 0.13).all()
    assert 0.4 < np.mean(motion[1] > 0.0) < 0.6


def test_effects_that_are_one_function_without_loads_are_two_with_them(pair="torque_sensor_gain,servo_gain"):
    """Of a balanced link the torque is J_l qddot: a wrong sensor and a wrong drive scale the same column."""
    joint = joint_of(gravity=0.0, gain=True)
    goal = parse_goal(f"tell:{pair}")
    with pytest.raises(ParamsError, match=r"same function.*known loads do distinguish them.*--load 0 --load MASS@ARM"):
        criterion_of(goal, joint)
    under = (joint, carrying(joint, HEAVY))
    criterion = criterion_of(goal, joint, under=under)
    assert isinstance(criterion, Discrimination) and len(criterion.orders) == 2
    design = design_with_loads(joint, LIMITS, goal, QUICK, (KnownLoad(0.0), HEAVY))
    assert isinstance(design, LoadDesign) and "same function" in design.refusal and design.unloaded is None
    assert np.isinf(design.gain) and design.expected[0].after > 0.99
    assert HEAVY in {run.load for run in design.runs}


def test_effects_that_loads_do_not_tell_apart_stay_refused_and_no_loads_are_named():
    joint, goal = joint_of(), parse_goal("tell:torque_sensor_bias,effort_bias")
    for under in ((), (joint, carrying(joint, HEAVY))):
        with pytest.raises(ParamsError, match="same function") as found:
            criterion_of(goal, joint, under=under)
        assert "--load" not in str(found.value)


def test_a_wrong_gain_that_a_payload_contains_is_ruled_out_under_loads():
    joint = joint_of(gain=True)
    goal = parse_goal("tell:load_dependent_friction,torque_sensor_bias")
    under = (joint, carrying(joint, HEAVY))
    gain, load = effect("servo_gain"), effect("payload")
    assert identity(joint, gain, load) is not None and identity(joint, gain, load, under) is None
    assert isinstance(criterion_of(goal, joint, under=under), Discrimination)


def test_motions_under_loads_keep_every_limit_with_their_load_and_are_worth_it():
    joint = joint_of(gravity=6.0)
    goal, loads = parse_goal("parameters:load_dependent_friction"), (KnownLoad(0.0), HEAVY, KnownLoad(1.0, 0.5))
    design = design_with_loads(joint, LIMITS, goal, QUICK, loads)
    assert isinstance(design, LoadDesign) and design.gain > 1.1
    assert sum(run.seconds for run in design.runs) == pytest.approx(QUICK.duration)
    n = joint.numbers
    alone = design_joint(joint, LIMITS, goal, QUICK)

    def size(expected):  # geometric mean of the intervals
        return np.exp(np.mean([np.log(each.after) for each in expected]))

    # the determinant also counts correlations, which the widths of the intervals do not show
    assert 0.5 < design.gain * size(design.expected) / size(design.without) < 2.0
    assert size(design.without) < 1.05 * size(alone.expected)
    for run in design.runs:
        _, (q, v, a, j) = run.design.motion(500.0)
        weight, inertia = run.load.mass * GRAVITY * run.load.arm, run.load.mass * run.load.arm**2
        friction = n.viscous * v + n.coulomb * np.tanh(v / (0.04 * n.speed))
        torque = (1.2 + inertia) * a + (6.0 + weight) * np.sin(q) + friction
        assert LIMITS.position[0] - 1e-6 <= q.min() and q.max() <= LIMITS.position[1] + 1e-6
        for found, most in ((v, 2.0), (a, 9.0), (j, 300.0), (torque, 60.0)):
            assert np.abs(found).max() <= most * (1.0 + 1e-3)
        assert_allclose([v[0], v[-1], a[0], a[-1]], 0.0, atol=1e-6)


def test_loads_that_do_not_help_are_said_so_and_the_design_is_the_one_without_them():
    joint = replace(joint_of(), context=replace(joint_of().context, drive="voltage"))
    goal, feather = parse_goal("parameters"), KnownLoad(1e-3, 0.1)
    short = replace(QUICK, iterations=3)
    design = design_with_loads(joint, LIMITS, goal, short, (KnownLoad(0.0), feather))
    assert isinstance(design, JointDesign)
    assert design.sentences[0].startswith("Known loads (0.001 kg at 0.1 m) do not help: ")
    assert_allclose(design.x, design_joint(joint, LIMITS, goal, short).x, rtol=0.0)


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["0", "-1@0.3"], "a mass of at least 0 kg, got -1"),
        (["1@-0.3"], "an arm above 0 m, got -0.3"),
        (["1@0"], "an arm above 0 m, got 0"),
        (["heavy"], "expected MASS@ARM in kg and m"),
        (["1@"], "expected MASS@ARM in kg and m"),
        (["1@0.3@0@1"], "expected MASS@ARM in kg and m"),
        (["nan@1"], "expected MASS@ARM in kg and m"),
        (["0"], "at least one load beside 0"),
        (["1@0.3", "1.0@0.30"], "named twice"),
        ([f"{k + 1}@0.3" for k in range(7)], "at most 6 loads, got 7"),
    ],
)
def test_a_load_that_is_none_is_one_line(texts, words):
    with pytest.raises(ParamsError, match=words) as found:
        parse_loads(texts)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("change", "loads", "words"),
    [
        ({}, ["1.5"], r"the arm is missing; expected MASS@ARM in kg and m, such as 1\.5@0\.3"),
        (
            {},
            ["10@0.6"],
            r"holding this load within -0\.7 to 0\.9 rad .* needs 62\.2 N m, and the torque limit is 60 N",
        ),
        ({"load": "unknown"}, ["1@0.3"], "this joint has load: unknown"),
        ({"load": "robot"}, ["1@0.3"], "this joint has load: robot"),
        ({"load": "pendulum"}, ["1@0.3@0.2"], "one zero for all logs, where its pendulum hangs: 0 rad"),
        ({"joint_type": "prismatic"}, ["1@0.3"], "is prismatic; expected MASS in kg without an arm"),
    ],
)
def test_a_load_that_cannot_be_used_is_one_line(change, loads, words):
    with pytest.raises(ParamsError, match=words) as found:
        design_with_loads(joint_of(**change), LIMITS, parse_goal("parameters"), QUICK, parse_loads(loads))
    assert "\n" not in str(found.value)


def test_the_rig_file_knows_the_masses_of_the_new_logs_and_keeps_those_of_the_old_ones():
    rig = parse_rig({"joint": "j", "drive": "current", "load": {"pendulum": {"mass": 2.0, "length": 0.3, "zero": 0.1}}})
    loads = [("trajectory_1*", KnownLoad(0.0)), ("trajectory_2*", KnownLoad(1.0, 0.6))]
    made = declaring(rig, "j", loads)
    entry = rig_document(made)["load"]["pendulum"]
    assert entry["mass"] == {"trajectory_1*": 2.0, "trajectory_2*": 3.0, "*": 2.0}
    assert_allclose(list(entry["length"].values()), [0.3, 0.4, 0.3], rtol=1e-6)
    assert_allclose(list(entry["inertia"].values()), [0.18, 0.54, 0.18], rtol=1e-6)
    assert entry["zero"] == 0.1
    assert parse_rig(rig_document(made)) == made
    again = rig_document(declaring(made, "j", [("third*", KnownLoad(1.0, 0.6))]))["load"]["pendulum"]["mass"]
    assert again == {"third*": 3.0, "trajectory_1*": 2.0, "trajectory_2*": 3.0, "*": 2.0}
    assert declaring(parse_rig({"joint": "j", "drive": "current"}), "j", loads) is None
