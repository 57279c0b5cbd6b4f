"""The rigid-body regressor against Drake's inverse dynamics and a double pendulum's closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

from drake_tc.errors import IdentificationError
from drake_tc.identification.regression import independent_columns
from drake_tc.robot.rigid_regressor import LinkTree, link_tree, regressor


def planar_tree(upper_length):
    """Two links that hang along -z and turn about y."""
    return LinkTree(
        joints=("shoulder", "elbow"),
        links=("upper", "lower"),
        parent=(-1, 0),
        R_PF=np.stack([np.eye(3), np.eye(3)]),
        p_PF=np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -upper_length]]),
        axis=np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
        revolute=(True, True),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def inertia(rng):
    mass, com = rng.uniform(0.5, 3.0), rng.uniform(-0.2, 0.2, 3)
    body = np.diag(rng.uniform(0.02, 0.03, 3))
    central = RotationalInertia(*np.diag(body), 0.001, -0.002, 0.0015)
    return SpatialInertia.MakeFromCentralInertia(mass, com, central)


def tree_plant():
    """A branched tree: revolute, prismatic, and a branch; one link carries another welded to it; frames all askew."""
    rng = np.random.default_rng(3)
    plant = MultibodyPlant(0.0)
    bodies = [plant.AddRigidBody(name, inertia(rng)) for name in ("a", "b", "c", "d", "welded")]
    kinds = (RevoluteJoint, PrismaticJoint, RevoluteJoint, RevoluteJoint)
    parents = (plant.world_body(), bodies[0], bodies[4], bodies[0])
    plant.WeldFrames(
        bodies[1].body_frame(), bodies[4].body_frame(), RigidTransform(RollPitchYaw(0.4, 0.1, -0.7), [0.1, 0.2, 0.05])
    )
    for i, (kind, parent) in enumerate(zip(kinds, parents, strict=True)):
        pose = RigidTransform(RollPitchYaw(rng.uniform(-1, 1, 3)), rng.uniform(-0.3, 0.3, 3))
        frame = plant.AddFrame(FixedOffsetFrame(f"f{i}", parent.body_frame(), pose))
        axis = rng.normal(size=3)
        plant.AddJoint(kind(f"j{i}", frame, bodies[i].body_frame(), axis / np.linalg.norm(axis)))
    plant.Finalize()
    return plant, bodies


def parameters_of(plant, context, body, welded=()):
    total = body.CalcSpatialInertiaInBodyFrame(context)
    for other in welded:
        X = plant.CalcRelativeTransform(context, body.body_frame(), other.body_frame())
        moved = other.CalcSpatialInertiaInBodyFrame(context).ReExpress(X.rotation()).Shift(-X.translation())
        total += moved
    m, c = total.get_mass(), total.get_com()
    i = total.CalcRotationalInertia().CopyToFullMatrix3()
    return np.concatenate([[m], m * c, i[0], i[1, 1:], i[2, 2:]])


def test_torques_of_a_branched_tree_are_those_of_drakes_inverse_dynamics():
    plant, bodies = tree_plant()
    tree = link_tree(plant)
    assert tree.parent == (-1, 0, 1, 0)
    context = plant.CreateDefaultContext()
    pi = np.concatenate([parameters_of(plant, context, b, (bodies[4],) if b is bodies[1] else ()) for b in bodies[:4]])
    q, v, vdot = np.random.default_rng(0).normal(size=(3, 20, 4))
    ours = regressor(tree, q, v, vdot) @ pi
    for k in range(20):
        plant.SetPositions(context, q[k])
        plant.SetVelocities(context, v[k])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        theirs = plant.CalcInverseDynamics(context, vdot[k], forces)
        assert_allclose(ours[k], theirs, rtol=1e-10, atol=1e-10)  # rounding of terms of size 100


def test_double_pendulum_is_lagranges_closed_form():
    l1, m1, m2, r1, r2, i1, i2, g = 0.3, 0.56, 0.6, 0.25, 0.18, 0.053, 0.024, 9.81
    pi = np.zeros(20)
    pi[[0, 3, 7]] = m1, -m1 * r1, i1  # inertias about the joints: I_yy
    pi[[10, 13, 17]] = m2, -m2 * r2, i2
    (q1, q2), (v1, v2), (a1, a2) = rng = np.random.default_rng(1).normal(size=(3, 2, 50))
    c, s = np.cos(q2), np.sin(q2)
    h = m2 * l1 * r2
    tau1 = (i1 + i2 + m2 * l1**2 + 2 * h * c) * a1 + (i2 + h * c) * a2 - h * s * v2 * (2 * v1 + v2)
    tau1 += g * ((m1 * r1 + m2 * l1) * np.sin(q1) + m2 * r2 * np.sin(q1 + q2))
    tau2 = (i2 + h * c) * a1 + i2 * a2 + h * s * v1**2 + g * m2 * r2 * np.sin(q1 + q2)
    ours = regressor(planar_tree(l1), *(x.T for x in rng)) @ pi
    assert_allclose(ours, np.stack([tau1, tau2], axis=-1), rtol=1e-11, atol=1e-11)  # rounding


def test_base_parameters_of_the_planar_double_pendulum():
    q, v, a = np.random.default_rng(2).normal(size=(3, 200, 2))
    columns = regressor(planar_tree(0.3), q, v, a)
    kept = independent_columns(columns.reshape(-1, 20))
    # two links: inertia and two first moments each; a mass may stand for an inertia, but there are six
    assert kept.size == 6
    # what was left out is a combination of what was kept
    rest = columns.reshape(-1, 20)
    mapped = rest[:, kept] @ np.linalg.lstsq(rest[:, kept], rest, rcond=None)[0]
    assert_allclose(mapped, rest, atol=1e-10)


def test_refusals():
    with pytest.raises(IdentificationError, match=r"expected q, v, vdot of shape \(T, 2\)"):
        regressor(planar_tree(0.3), np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3)))
    plant = MultibodyPlant(0.0)
    plant.AddRigidBody("free", inertia(np.random.default_rng(0)))
    plant.Finalize()
    with pytest.raises(IdentificationError, match="joints that turn or slide"):
        link_tree(plant)
