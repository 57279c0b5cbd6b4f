"""Contacts: their numbers are checked, and a mask puts those that are active one after the other."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from drake_tc.errors import ParamsError
from drake_tc.robot.mounts import Mount
from drake_tc.robot.plant import make_plant
from drake_tc.tsid.contacts import Contact, select
from drake_tc.tsid.holding import anchors, holding_acceleration
from drake_tc.tsid.reduction import reduce

from .machines import machine, random_state

AT = Mount("c", "foot")


def test_a_sole_by_its_halves_or_by_its_edges():
    assert Contact("c", AT, half_length=0.1, half_width=0.05).sole == (-0.1, 0.1, -0.05, 0.05)
    off = Contact("c", AT, extents=(-0.05, 0.15, -0.02, 0.06))
    assert off.sole == (-0.05, 0.15, -0.02, 0.06)
    corners = off.corners
    assert_allclose([corners[:, 0].min(), corners[:, 0].max()], [-0.05, 0.15])
    following = np.roll(corners, -1, axis=0)
    area = 0.5 * np.sum(corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1])
    assert_allclose(area, 0.2 * 0.08)  # positive: counter-clockwise
    assert_array_equal(Contact("c", AT, "point").corners, np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "wanted a sole of positive size"),
        ({"half_length": 0.1}, "wanted a sole of positive size"),
        ({"half_length": -0.1, "half_width": 0.1}, "wanted a sole of positive size"),
        ({"half_length": math.nan, "half_width": 0.1}, "wanted a sole of positive size"),
        ({"extents": (0.1, -0.1, -0.1, 0.1)}, "wanted a sole of positive size"),
        ({"extents": (0.1, 0.2, -0.1, 0.1)}, "wanted the frame's origin on the sole"),
        ({"extents": (-0.1, 0.2, -0.1, 0.1), "half_width": 0.1}, "half_length and half_width or extents; got both"),
        ({"kind": "line"}, "wanted a kind of surface, point; got 'line'"),
        ({"kind": "point", "axes": "up"}, "axes: wanted link or world for a point; got 'up'"),
        ({"axes": "world", "half_length": 0.1, "half_width": 0.1}, "axes: wanted link for a surface; got 'world'"),
        ({"kind": "point", "friction": -0.1}, "friction: wanted a finite number >= 0; got -0.1"),
        ({"kind": "point", "friction": math.nan}, "friction: wanted a finite number >= 0"),
        ({"kind": "point", "moment_friction": -1.0}, "moment_friction: wanted a finite number >= 0"),
        ({"kind": "point", "minimum_force": -1.0}, "minimum_force: wanted a finite number >= 0"),
        ({"kind": "point", "maximum_force": 0.5}, "maximum_force: wanted more than minimum_force 1; got 0.5"),
        ({"kind": "point", "maximum_force": math.nan}, "maximum_force: wanted more than minimum_force 1; got nan"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(ParamsError, match=f"^contact 'c': .*{message}"):
        Contact("c", AT, **changes)


def test_masks():
    contacts = [Contact("a", AT, "point"), Contact("b", AT, half_length=1, half_width=1), Contact("c", AT, "point")]
    everything = select(contacts)
    assert everything.size == 12
    assert everything.rows == (slice(0, 3), slice(3, 9), slice(9, 12))
    some = select(contacts, (False, True, True))
    assert some.index == (1, 2)
    assert some.rows == (slice(0, 6), slice(6, 9))
    assert_array_equal(some.entries, [3, 4, 5, 6, 7, 8, 9, 10, 11])
    assert select(contacts, (False,) * 3).size == 0
    assert select([], ()).size == 0
    with pytest.raises(ParamsError, match=r"active: wanted one value a contact \(3\); got 2"):
        select(contacts, (True, True))


def test_holding_takes_drift_and_slip_out(tmp_path):
    """The drift is measured as the contact would see it: the pose that undoes it, by another library."""
    model = machine("floating arm", tmp_path)
    q, v = random_state(model, 1)
    places = anchors(model.terms(model.create_scratch(), q, v))
    moved = q.copy()
    moved[4:7] += [0.01, -0.02, 0.03]
    moved[model.positions[0]] += 0.4
    terms = model.terms(model.create_scratch(), moved, v)
    found = holding_acceleration(terms, places, 100.0, 20.0)
    for contact, rows, (turn_0, place_0) in zip(terms.contacts.contacts, terms.contacts.rows, places, strict=True):
        turn, place = terms.pose(contact.name)
        needed = Rotation.from_matrix(turn.T @ turn_0).as_rotvec()
        axes = np.eye(3) if contact.upright else turn
        error = np.concatenate([axes.T @ (place_0 - place), needed])[: contact.size]
        expected = 100.0 * error - 20.0 * terms.contact_velocity[rows]
        assert_allclose(found[rows], expected, atol=1e-11)
    still = holding_acceleration(model.terms(model.create_scratch(), q, 0 * v), places, 100.0, 20.0)
    assert_allclose(still, np.zeros(9), atol=1e-12)
    assert_allclose(holding_acceleration(terms, None, 100.0, 20.0), -20.0 * terms.contact_velocity, atol=0)


def test_a_contact_that_drifted_and_slips_comes_back(tmp_path):
    """In a simulation, kp = 100 and kd = 20 (critically damped, 0.1 s): the pose of the start again, the slip gone."""
    model = machine("floating arm", tmp_path)
    scratch, mask, dt = model.create_scratch(), (True, False), 1e-3
    q, _ = random_state(model, 1)
    places = anchors(model.terms(scratch, q, np.zeros(model.nv), mask))
    plant = make_plant(model.robot, 0.0)
    context = plant.CreateDefaultContext()
    turn = Rotation.from_rotvec([0.1, -0.2, 0.15]) * Rotation.from_quat(q[[1, 2, 3, 0]])
    q[:4], v = turn.as_quat()[[3, 0, 1, 2]], 0.3 * np.random.default_rng(0).normal(size=model.nv)
    q[4:7] += [0.02, -0.01, 0.03]
    for step in range(1500):
        terms = model.terms(scratch, q, v, mask)
        rotation, position = terms.pose("sole")
        drift = np.linalg.norm(Rotation.from_matrix(rotation.T @ places[0][0]).as_rotvec())
        drift += np.linalg.norm(position - places[0][1])
        if step == 0:
            assert drift > 0.1
        joints = -5.0 * terms.v[model.actuated]
        vdot, _ = reduce(terms, [], [], holding_acceleration(terms, places, 100.0, 20.0)).full(joints)
        v = v + dt * vdot
        plant.SetPositions(context, q)
        q = q + dt * plant.MapVelocityToQDot(context, v)
        q[:4] /= np.linalg.norm(q[:4])
    assert drift < 1e-3  # of 0.3 at first; the rest is of first order in dt
    assert np.abs(terms.contact_velocity).max() < 5e-3
