"""The reduced problem against the whole linear system, and where the contacts' Jacobian loses rank."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.kernels.tsid.terms import RANK_KEPT, RANK_LOST
from drake_tc.robot.fields import Mount, Pose
from drake_tc.tsid.assembly import causes_of, reduce
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows, identity
from drake_tc.tsid.tasks import ComTask, PostureTask

from .machines import MODELS, arm, machine, random_state, robot_or_skip
from .problems import Setup, model, problem_at, state


def terms_of(it, seed, mask=None, speed=1.0):
    return it.terms(it.create_scratch(), *random_state(it, seed, speed), mask)


def whole(terms, torque, contact_acceleration=0.0):
    """vdot and f by one solve of the KKT matrix; least squares, so the smallest f where it is not unique."""
    nv, k = terms.bias.size, terms.contact_bias.size
    matrix = np.block([[terms.mass_matrix, -terms.contact_jacobian.T], [terms.contact_jacobian, np.zeros((k, k))]])
    push = -terms.bias
    push[terms.actuated] += torque
    solution = np.linalg.lstsq(matrix, np.concatenate([push, contact_acceleration - terms.contact_bias]))[0]
    return solution[:nv], solution[nv:]


@pytest.mark.parametrize("name", ["humanoid", "shuffled humanoid", "floating arm", "talos", "icub"])
@pytest.mark.parametrize("mask", [(True, False), (False, True), (False, False)])
def test_accelerations_and_forces_are_those_of_the_whole_system(tmp_path, name, mask):
    it = machine(name, tmp_path)
    rng = np.random.default_rng(0)
    for seed in range(3):
        terms = terms_of(it, seed, mask)
        torque, asked = rng.normal(size=it.n) * 20, rng.normal(size=terms.contact_bias.size)
        for wanted in (None, asked):
            vdot, force = reduce(terms, [], [], wanted).full(torque)
            other = whole(terms, torque, 0.0 if wanted is None else wanted)
            assert_allclose(vdot, other[0], rtol=1e-8, atol=1e-8 * np.abs(other[0]).max())
            assert_allclose(force, other[1], rtol=1e-8, atol=1e-8 * np.abs(other[1]).max(initial=1.0))


def test_double_support():
    for seed in range(10):
        terms = model().terms(model().create_scratch(), *state(np.random.default_rng(seed), Setup(speed=1.0)))
        torque = np.random.default_rng(seed).normal(size=30) * 30
        reduced = reduce(terms, [], [])
        vdot, force = reduced.full(torque)
        other = whole(terms, torque)
        assert_allclose(vdot, other[0], atol=1e-9 * np.abs(other[0]).max())
        assert_allclose(force, other[1], atol=1e-9 * np.abs(other[1]).max())
        y = reduced.matrix @ torque + reduced.offset
        assert_allclose(y, np.concatenate([vdot, force, torque]), atol=1e-12 * np.abs(y).max())


def test_a_welded_leg_with_its_foot_on_the_ground():
    """Six joints, six rows: the foot holds the leg still whatever the torques."""
    robot = robot_or_skip(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
    sole = Contact("sole", Mount("sole", "r_foot"), half_length=0.1, half_width=0.05)
    it = TsidModel(robot, [sole])
    terms = it.terms(it.create_scratch(), it.start, np.zeros(6))
    torque = np.random.default_rng(0).normal(size=6) * 20
    vdot, force = reduce(terms, [], []).full(torque)
    assert_allclose(vdot, np.zeros(6), atol=1e-9)
    pushed = np.linalg.solve(
        terms.contact_jacobian.T, terms.bias - torque
    )  # this leg's joints are in the plant's order
    assert_allclose(force, pushed, rtol=1e-9)


def test_more_rows_than_joints(tmp_path):
    """An arm of three joints held at nine rows: it stays at rest, and the forces carry it."""
    terms = terms_of(machine("arm", tmp_path), 1, speed=0.0)
    torque = np.array([1.0, -2.0, 3.0])
    vdot, force = reduce(terms, [], []).full(torque)
    assert np.linalg.matrix_rank(terms.contact_jacobian) == 3 < terms.contact_bias.size
    assert_allclose(vdot, np.zeros(3), atol=1e-9)
    push = terms.contact_jacobian.T @ force - terms.bias
    push[terms.actuated] += torque
    assert_allclose(push, np.zeros(3), atol=1e-8)


def test_a_contact_on_the_welded_base_carries_nothing(tmp_path):
    robot = arm(tmp_path)
    sole = Contact("sole", Mount("sole", "base"), half_length=0.1, half_width=0.05)
    it = TsidModel(robot, [sole, Contact("tip", Mount("tip", "hand"), "point")])
    torque = np.array([1.0, -2.0, 3.0])
    vdot, force = reduce(terms_of(it, 1), [], []).full(torque)
    without = reduce(terms_of(it, 1, (False, True)), [], []).full(torque)
    assert_allclose(force[:6], np.zeros(6), atol=1e-12)
    assert_allclose(vdot, without[0], atol=1e-6 * np.abs(without[0]).max())
    assert_allclose(force[6:], without[1], atol=1e-6 * np.abs(without[1]).max())


def twice(apart):
    """The humanoid's right sole given twice, the second `apart` from the first along x [m]."""
    robot = robot_or_skip(MODELS / "hrp2_like" / "hrp2_like.yaml")
    places = (Pose((0.0, 0.0, -0.055)), Pose((apart, 0.0, -0.055)))
    contacts = [
        Contact(name, Mount(name, "r_foot", place), half_length=0.1, half_width=0.05)
        for name, place in zip(("one", "two"), places, strict=True)
    ]
    return TsidModel(robot, contacts)


def test_a_contact_given_twice_carries_half_each_time():
    it = twice(0.0)
    q, v = random_state(it, 2)
    torque = np.random.default_rng(0).normal(size=30) * 20
    vdot, force = reduce(it.terms(it.create_scratch(), q, v), [], []).full(torque)
    once = reduce(it.terms(it.create_scratch(), q, v, (True, False)), [], []).full(torque)
    assert_allclose(vdot, once[0], atol=1e-8 * np.abs(once[0]).max())
    assert_allclose(force.reshape(2, 6), np.stack([once[1], once[1]]) / 2, atol=1e-8 * np.abs(once[1]).max())


def test_forces_do_not_jump_where_rank_comes_and_goes(tmp_path):
    """A point beside a sole on the next link comes nearer to the axis between them: its rows enter the sole's span."""
    robot, reach = arm(tmp_path, fixed_base=False), np.geomspace(1e-5, 1e-2, 120)
    axis = np.array([1.0, 0.5, 0.2]) / np.linalg.norm([1.0, 0.5, 0.2])
    found, slipped = [], []
    for away in reach:
        contacts = [
            Contact("sole", Mount("sole", "slider"), half_length=0.1, half_width=0.05),
            Contact("tip", Mount("tip", "hand", Pose(tuple(0.1 * axis + [0.0, 0.0, away]))), "point"),
        ]
        it = TsidModel(robot, contacts)
        terms = it.terms(it.create_scratch(), random_state(it, 3)[0], np.zeros(it.nv))
        causes = causes_of(terms)
        found.append(np.concatenate([causes.vdot_offset, causes.force_offset]))
        slipped.append(np.abs(terms.contact_jacobian @ causes.vdot_offset).max())
    moved = np.abs(np.diff(found, axis=0)).max(axis=1)
    assert moved.max() < 0.15 * np.ptp(found, axis=0).max()
    assert_allclose(np.array(slipped)[reach > 3e-3], 0.0, atol=1e-6)
    assert_allclose(found[0], found[1], rtol=1e-3, atol=1e-3)  # rank is lost: the point's place has no say


def share_kept(terms, relative):
    """Two rows of J whose scaled J M^-1 J^T has the eigenvalues 1 + c and 1 - c, with (1 - c) / (1 + c) = relative.

    A disagreement of the rows is answered by a force 1 / (1 - c); what is left of it is returned.
    """
    gap = 2.0 * relative / (1.0 + relative)  # 1 - c
    jacobian = np.zeros((2, terms.bias.size))
    jacobian[:, 0], jacobian[1, 1] = [1.0, 1.0 - gap], np.sqrt(gap * (2.0 - gap))
    made = replace(
        terms,
        mass_matrix=np.eye(terms.bias.size),
        bias=np.zeros(terms.bias.size),
        contact_jacobian=jacobian,
        contact_bias=np.array([-1.0, 1.0]),
    )
    force = causes_of(made).force_offset
    assert_allclose(force[0], -force[1], rtol=1e-3, atol=1e-3)
    return force[0] * gap


def test_rank_is_decided_between_the_two_tolerances(tmp_path):
    terms = terms_of(machine("floating arm", tmp_path), 1)
    kept = np.array([share_kept(terms, relative) for relative in np.geomspace(1e-12, 1.0, 600)[:-1]])
    places = np.geomspace(1e-12, 1.0, 600)[:-1]
    assert_allclose(kept[places < RANK_LOST], 0.0, atol=1e-3)
    assert_allclose(kept[places > RANK_KEPT], 1.0, atol=1e-3)
    assert_allclose(share_kept(terms, np.sqrt(RANK_LOST * RANK_KEPT)), 0.5, atol=1e-3)
    assert np.abs(np.diff(kept)).max() < 0.02


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_of_a_contact_do_not_matter(scale):
    """Rows of J in other units give the same accelerations and the same forces in those units, rank lost or not."""
    units = np.geomspace(1.0, scale, 12)
    for it in (twice(0.0), twice(0.1), model()):
        terms = terms_of(it, 5)
        torque = np.random.default_rng(0).normal(size=30) * 20
        vdot, force = reduce(terms, [], []).full(torque)
        other = replace(
            terms, contact_jacobian=units[:, None] * terms.contact_jacobian, contact_bias=units * terms.contact_bias
        )
        changed = reduce(other, [], []).full(torque)
        assert_allclose(changed[0], vdot, atol=1e-6 * np.abs(vdot).max())
        assert_allclose(changed[1] * units, force, atol=1e-6 * np.abs(force).max())


def random_rows(rng, terms):
    """Rows of all parts and of some, of two groups."""
    nv, k, n = terms.bias.size, terms.contact_bias.size, terms.actuated.size
    parts = [
        Parts(vdot=rng.normal(size=(4, nv)), force=rng.normal(size=(4, k)), torque=rng.normal(size=(4, n))),
        Parts(force=rng.normal(size=(3, k)), torque=rng.normal(size=(3, n))),
        Parts(vdot=rng.normal(size=(2, nv))),
        Parts(torque=np.array(identity(n))),
        Parts(vdot=rng.normal(size=(5, nv)), torque=rng.normal(size=(5, n))),
    ]
    sizes = [4, 3, 2, n, 5]
    tasks = [
        TaskRows(f"task {i}", part, rng.normal(size=size), rng.uniform(0.1, 2, size))
        for i, (part, size) in enumerate(zip(parts, sizes, strict=True))
    ]
    limits = [
        LimitRows(
            f"limit {i}", group, part, -rng.uniform(1, 2, size), rng.uniform(1, 2, size),
            tuple(f"{i}.{j}" for j in range(size)),
        )
        for i, (part, size, group) in enumerate(zip(parts, sizes, ("a", "b", "a", "torque", "b"), strict=True))
    ]  # fmt: skip
    return tasks, limits


def value(parts, vdot, force, torque):
    pairs = ((parts.vdot, vdot), (parts.force, force), (parts.torque, torque))
    return sum(matrix @ x for matrix, x in pairs if matrix is not None)


def test_cost_and_polytope_say_what_the_rows_say():
    rng = np.random.default_rng(1)
    terms = terms_of(model(), 1)
    tasks, limits = random_rows(rng, terms)
    reduced = reduce(terms, tasks, limits)
    polytope = reduced.polytope
    assert polytope.bounds == 30
    assert polytope.groups == {"torque": slice(0, 30), "a": slice(30, 36), "b": slice(36, 44)}
    for _ in range(5):
        torque = rng.normal(size=30) * 10
        vdot, force = reduced.full(torque)
        cost = sum(
            np.sum((rows.weight * (value(rows.matrix, vdot, force, torque) - rows.target)) ** 2) for rows in tasks
        )
        assert_allclose(reduced.cost(torque), cost, rtol=1e-10)
        room = dict(zip(polytope.labels, polytope.upper - polytope.matrix @ torque, strict=True))
        below = dict(zip(polytope.labels, polytope.matrix @ torque - polytope.lower, strict=True))
        for rows in limits:
            values = value(rows.matrix, vdot, force, torque)
            assert_allclose([room[label] for label in rows.labels], rows.upper - values, rtol=1e-9, atol=1e-8)
            assert_allclose([below[label] for label in rows.labels], values - rows.lower, rtol=1e-9, atol=1e-8)


def test_the_order_of_tasks_and_limits_does_not_matter():
    rng = np.random.default_rng(2)
    terms = terms_of(model(), 1)
    tasks, limits = random_rows(rng, terms)
    one, two = reduce(terms, tasks, limits), reduce(terms, tasks[::-1], limits[::-1])
    size = np.abs(one.cost.matrix.T @ one.cost.matrix).max()
    assert_allclose(one.cost.matrix.T @ one.cost.matrix, two.cost.matrix.T @ two.cost.matrix, atol=1e-12 * size)
    order = [two.polytope.labels.index(label) for label in one.polytope.labels]
    assert_allclose(two.polytope.matrix[order], one.polytope.matrix, rtol=1e-12, atol=1e-12)
    assert_allclose(two.polytope.upper[order], one.polytope.upper, rtol=1e-12, atol=1e-9)
    assert two.polytope.bounds == one.polytope.bounds == 30


def test_the_order_of_joints_does_not_matter(tmp_path):
    """The same machine with its joints listed in another order: the same accelerations from the same torques."""
    straight, other = machine("humanoid", tmp_path), machine("shuffled humanoid", tmp_path)
    order = np.array([straight.robot.joints.index(joint) for joint in other.robot.joints])
    inertia = dict.fromkeys(straight.robot.joints, 0.01)
    straight, other = (TsidModel(it.robot, it.contacts, rotor_inertia=inertia) for it in (straight, other))
    q, v = random_state(straight, 7)
    torque = np.random.default_rng(0).normal(size=30) * 10
    solutions = []
    for it, given in ((straight, torque), (other, torque[order])):
        terms = it.terms(it.create_scratch(), q, v)
        tasks = [ComTask(10, 3).rows(terms, np.zeros(9)), PostureTask(it, 4, 2).rows(terms, np.zeros(90))]
        reduced = reduce(terms, tasks, [])
        solutions.append((*reduced.full(given), np.array([reduced.cost(given)])))
    for one, two in zip(*solutions, strict=True):
        assert_allclose(two, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


def test_without_contacts_it_falls(tmp_path):
    it = TsidModel(arm(tmp_path, fixed_base=False))
    terms = terms_of(it, 1)
    reduced = reduce(terms, [], [])
    vdot, force = reduced.full(np.array([5.0, -3.0, 2.0]))
    assert force.shape == (0,)
    fall = (terms.momentum_matrix @ vdot + terms.momentum_bias) / terms.mass
    assert_allclose(fall, [0, 0, 0, 0, 0, -9.81], atol=1e-9)
    assert reduced.cost.matrix.shape == reduced.polytope.matrix.shape == (0, 3)


def test_a_state_that_is_not_a_number_gives_nan_and_no_error():
    q, v = state(np.random.default_rng(0), Setup())
    for place in (0, 9):
        bad = v.copy()
        bad[place] = np.nan
        reduced = problem_at(q, bad, np.zeros(3)).reduced
        assert np.isnan(reduced.cost.matrix).any()
        assert reduced.polytope.matrix.shape == (82, 30)
        assert not np.isfinite(np.concatenate(reduced.full(np.zeros(30)))).all()
