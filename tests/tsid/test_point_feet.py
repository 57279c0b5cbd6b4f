"""Point feet: their cones stand in the world while shanks tilt, against closed forms of a quadruped of this file."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.robot.fields import Mount, Pose
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.assembly import reduce
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import TorqueLimit, WrenchCones
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.tasks import ComTask, ForceTask, OrientationTask

from .program_matrices import reduced_qp

LEGS = {"FL": (0.2, 0.1), "FR": (0.2, -0.1), "HL": (-0.2, 0.1), "HR": (-0.2, -0.1)}
LENGTH, BEND, FRICTION = 0.2, 0.7, 0.5
"""Thigh and shank are as long, so a foot is below its hip and the shank tilts by as much as the thigh."""

SEGMENT = (
    '<link name="{name}"><inertial><origin xyz="0 0 -0.1"/><mass value="{mass}"/>'
    '<inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>'
    '<axis xyz="{axis}"/><limit lower="-2" upper="2" velocity="20" effort="200"/></joint>'
)


def quadruped(folder):
    parts = [
        '<link name="trunk"><inertial><mass value="8"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>'
    ]
    posture = {}
    for leg, (x, y) in LEGS.items():
        parts += [SEGMENT.format(name=f"{leg}_{part}", mass=mass) for part, mass in (("hip", 0.1), ("thigh", 0.3))]
        parts.append(SEGMENT.format(name=f"{leg}_shank", mass=0.2))
        chain = (("roll", "trunk", "hip", f"{x} {y} 0", "1 0 0"), ("pitch", f"{leg}_hip", "thigh", "0 0 0", "0 1 0"))
        for name, parent, child, place, axis in (*chain, ("knee", f"{leg}_thigh", "shank", f"0 0 {-LENGTH}", "0 1 0")):
            parts.append(
                JOINT.format(name=f"{leg}_{name}", parent=parent, child=f"{leg}_{child}", place=place, axis=axis)
            )
        side = np.sign(x)
        posture |= {f"{leg}_pitch": float(side * BEND), f"{leg}_knee": float(-2 * side * BEND)}
    (folder / "dog.urdf").write_text(f'<robot name="dog">{"".join(parts)}</robot>', encoding="utf-8")
    joints = [f"{leg}_{name}" for leg in LEGS for name in ("roll", "pitch", "knee")]
    document = {"name": "dog", "urdf": "dog.urdf", "base": "trunk", "fixed_base": False, "joints": joints}
    document |= {"posture": posture, "base_pose": {"xyz": [0.0, 0.0, 2 * LENGTH * float(np.cos(BEND))]}}
    (folder / "dog.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    return load_robot(folder / "dog.yaml")


def feet(axes=None, rpy=(0.0, 0.0, 0.0)):
    place = Pose((0.0, 0.0, -LENGTH), rpy)
    return [
        Contact(leg, Mount(leg, f"{leg}_shank", place), "point", friction=FRICTION, axes=axes, minimum_force=0.0)
        for leg in LEGS
    ]


def in_world(terms, f):
    """(c, 3) forces in the world that push as f does: J^T f = J_W^T f_W, J_W that of the foot's place in the world."""
    turned = []
    for contact, rows in zip(terms.contacts.contacts, terms.contacts.rows, strict=True):
        turn = terms.contact_jacobian[rows] @ np.linalg.pinv(terms.frame(contact.name).jacobian[3:])
        assert_allclose(turn.T @ turn, np.eye(3), atol=1e-9)
        turned.append(turn.T @ f[rows])
    return np.array(turned)


def answer(robot, contacts, push=0.0, pyramid="inner"):
    """Terms, torques, the centre of mass's acceleration and the forces in the world, at rest, wanted to go by push."""
    model = TsidModel(robot, contacts)
    terms = model.terms(model.create_scratch(), model.start, np.zeros(model.nv))
    tasks = [ComTask(1.0, 1.0, weight=[1.0, 10.0, 10.0]), OrientationTask(model, "trunk", 1.0, 1.0, weight=10.0)]
    wanted = [task.rest(terms) for task in tasks]
    wanted[0][6] = push
    rows = [task.rows(terms, reference) for task, reference in zip(tasks, wanted, strict=True)]
    rows.append(ForceTask(model, weight=1e-4).rows(terms, np.zeros(12)))
    limits = [TorqueLimit.of(robot).rows(terms), WrenchCones(contacts, pyramid=pyramid).rows(terms)]
    reduced = reduce(terms, rows, limits)
    solution = solver().solve(reduced_qp(reduced))
    assert solution.outcome is Outcome.SOLVED
    vdot, f = reduced.full(solution.x)
    return terms, solution.x, terms.com_jacobian @ vdot + terms.com_bias, in_world(terms, f)


def test_each_foot_of_a_quadruped_at_rest_carries_a_quarter_of_it_straight_up(tmp_path):
    robot = quadruped(tmp_path)
    terms, _, acceleration, forces = answer(robot, feet())
    tilt = np.arccos([terms.pose(leg)[0][2, 2] for leg in LEGS])
    assert_allclose(tilt, BEND, atol=1e-9)
    assert np.arctan(FRICTION) < BEND  # straight up is outside of every cone that turns with its shank
    quarter = 0.25 * terms.mass * 9.81
    assert_allclose(forces, np.tile([0.0, 0.0, quarter], (4, 1)), atol=1e-4 * quarter)
    assert_allclose(acceleration, 0.0, atol=1e-4)
    _, _, _, turned = answer(robot, feet("link"))
    assert np.abs(turned[:, 0]).min() > 0.2 * quarter  # the feet press against each other, for nothing


@pytest.mark.parametrize(("pyramid", "share"), [("inner", np.sqrt(0.5)), ("outer", 1.0)])
def test_friction_alone_says_how_fast_it_can_start(tmp_path, pyramid, share):
    """sum fx <= m sum fz and sum fz = mass (g + zdd): so much the centre of mass gets, whatever the shanks do."""
    terms, _, acceleration, forces = answer(quadruped(tmp_path), feet(), push=30.0, pyramid=pyramid)
    assert_allclose(acceleration[0], FRICTION * share * (9.81 + acceleration[2]), rtol=1e-6)
    assert abs(acceleration[2]) < 0.2
    assert_allclose(forces[:, 0], FRICTION * share * forces[:, 2], rtol=1e-6)
    assert_allclose(forces.sum(axis=0), terms.mass * (acceleration + np.array([0.0, 0.0, 9.81])), atol=1e-8)


def test_how_the_frame_of_a_point_foot_is_turned_does_not_matter(tmp_path):
    robot = quadruped(tmp_path)
    _, torque, _, forces = answer(robot, feet(), push=30.0)
    for rpy in ((0.0, 0.8, 0.0), (2.0, -0.5, 1.0)):
        _, same, _, again = answer(robot, feet(rpy=rpy), push=30.0)
        assert_allclose(same, torque, atol=1e-4)  # of 4 N m; forces alone, weighted 1e-4, choose their share
        assert_allclose(again, forces, atol=1e-3)
    _, other, _, _ = answer(robot, feet("link", (0.0, 0.8, 0.0)), push=30.0)
    assert np.abs(other - torque).max() > 1.0


def test_rows_are_the_cone_of_the_force_in_the_world(tmp_path):
    """At any attitude, against the pyramid written out; feet with their link's axes beside the others."""
    robot, rng = quadruped(tmp_path), np.random.default_rng(0)
    contacts = [replace(foot, minimum_force=2.0, maximum_force=90.0) for foot in feet()]
    contacts[2] = replace(contacts[2], axes="link")
    model, cones = TsidModel(robot, contacts), WrenchCones(contacts)
    missed = 0
    for _ in range(50):
        q = model.start.copy()
        q[:4] = rng.normal(size=4)
        q[:4] /= np.linalg.norm(q[:4])
        q[model.positions] += rng.uniform(-0.5, 0.5, model.n)
        active = tuple(bool(some) for some in rng.random(4) < 0.7)
        terms = model.terms(model.create_scratch(), q, rng.normal(size=model.nv), active)
        rows, f = cones.rows(terms), 60.0 * rng.normal(size=3 * sum(active))
        value = rows.matrix.force @ f
        room = np.minimum(rows.upper - value, value - rows.lower).reshape(-1, 5)
        for one, own, contact in zip(room, in_world(terms, f), terms.contacts.contacts, strict=True):
            x, y, z = terms.pose(contact.name)[0].T @ own if contact.axes == "link" else own
            m = FRICTION * np.sqrt(0.5)
            assert_allclose(one, [m * z - x, m * z + x, m * z - y, m * z + y, min(z - 2.0, 90.0 - z)], atol=1e-10)
            missed += one.min() < 0.0
        assert len(rows.labels) == 5 * sum(active)
    assert missed > 20
