"""Contact cones against forces that real soles can give, and against round cones."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.limits import WrenchCones, cone_rows

from .problems import SOLES, Setup, model, state

SOLE = Contact(
    "sole", Mount("sole", "foot"), extents=(-0.1, 0.14, -0.05, 0.07), friction=0.4, moment_friction=0.05,
    minimum_force=5.0, maximum_force=900.0,
)  # fmt: skip
TIP = Contact("tip", Mount("tip", "hand"), "point", friction=0.6)


def miss(contact, f, pyramid="inner") -> dict[str, float]:
    """By how much each row is missed; negative inside."""
    matrix, lower, upper, labels = cone_rows(contact, pyramid)
    value = matrix @ f
    return dict(zip(labels, np.maximum(lower - value, value - upper), strict=True))


def at_corner(corner, force) -> np.ndarray:
    """The wrench about C of a force at a corner of the sole."""
    return np.concatenate([force, np.cross(corner, force)])


def test_forces_at_the_corners_of_the_sole_inside_their_cones_are_allowed_together():
    rng = np.random.default_rng(0)
    for _ in range(300):
        wrench = np.zeros(6)
        for corner in SOLE.corners:
            fz = rng.uniform(2.0, 200.0)
            angle, share = rng.uniform(0, 2 * np.pi), rng.uniform(0, 1)
            side = share * SOLE.friction * fz
            wrench += at_corner(corner, np.array([side * np.cos(angle), side * np.sin(angle), fz]))
        wrench[5] = np.clip(wrench[5], -0.05 * wrench[2], 0.05 * wrench[2])  # the twist is a limit of its own
        assert max(miss(SOLE, wrench, "outer").values()) <= 1e-9


@pytest.mark.parametrize(
    ("corner", "active"), [(0, "+x +y"), (1, "-x +y"), (2, "-x -y"), (3, "+x -y")], ids=lambda value: str(value)
)
def test_all_weight_on_one_corner_is_the_limit_of_tilting(corner, active):
    found = miss(SOLE, at_corner(SOLE.corners[corner], np.array([0.0, 0.0, 100.0])))
    assert_allclose([found[f"sole pressure {side}"] for side in active.split()], 0.0, atol=1e-12)
    beyond = miss(SOLE, at_corner(1.01 * SOLE.corners[corner], np.array([0.0, 0.0, 100.0])))
    tilted = {label for label, missed in beyond.items() if missed > 1e-9}
    assert tilted == {f"sole pressure {side}" for side in active.split()}


@pytest.mark.parametrize("contact", [SOLE, TIP])
def test_inner_and_outer_pyramid_and_the_round_cone(contact):
    rng = np.random.default_rng(1)
    corners = 0
    for angle in rng.uniform(0, 2 * np.pi, 200):
        f = np.zeros(contact.size)
        f[:3] = contact.friction * 50.0 * np.cos(angle), contact.friction * 50.0 * np.sin(angle), 50.0
        assert max(miss(contact, f, "outer").values()) <= 1e-9  # the round cone's edge is in the outer one
        f[:2] *= 1.0 + 1e-6
        assert max(miss(contact, f, "inner").values()) > 0.0  # and not in the inner one beyond it
    for x in (-1.0, 1.0):
        for y in (-1.0, 1.0):
            f = np.zeros(contact.size)
            f[:3] = contact.friction * np.sqrt(0.5) * 50.0 * np.array([x, y, 0.0]) + [0.0, 0.0, 50.0]
            slipping = miss(contact, f, "inner")
            corners += sum(abs(missed) < 1e-9 for label, missed in slipping.items() if "friction" in label)
    assert corners == 8  # its four edges are on the round cone


def test_normal_force_and_twist():
    def of(fz, tz):
        return miss(SOLE, np.array([0.0, 0.0, fz, 0.0, 0.0, tz]))

    assert_allclose(of(4.0, 0.0)["sole normal force"], 1.0)
    assert_allclose(of(905.0, 0.0)["sole normal force"], 5.0)
    assert_allclose(of(100.0, 6.0)["sole twist +z"], 1.0)
    assert_allclose(of(100.0, -6.0)["sole twist -z"], 1.0)
    assert max(of(100.0, 4.9).values()) < 0.0


def test_rows_follow_the_contacts_that_are_active():
    contacts = (*SOLES, TIP)
    cones, it = WrenchCones(contacts), model()
    q, v = state(np.random.default_rng(0), Setup())
    scratch = it.create_scratch()
    both = cones.rows(it.terms(scratch, q, v))
    assert both.matrix.force.shape == (22, 12)
    assert both.group == "force" and both.matrix.vdot is None and both.matrix.torque is None
    left = cones.rows(it.terms(scratch, q, v, (False, True)))
    assert left.matrix.force.shape == (11, 6)
    assert all(label.startswith("left_sole") for label in left.labels)
    assert_allclose(both.matrix.force[11:, 6:], left.matrix.force, rtol=0)
    assert not both.matrix.force[11:, :6].any() and not both.matrix.force[:11, 6:].any()
    assert cones.rows(it.terms(scratch, q, v, (False, True))) is left
    none = cones.rows(it.terms(scratch, q, v, (False, False)))
    assert none.matrix.force.shape == (0, 0) and none.labels == ()
    assert len(set(both.labels)) == 22


def test_refusal():
    with pytest.raises(ParamsError, match="pyramid: expected one of inner, outer, got 'round'"):
        WrenchCones(SOLES, pyramid="round")
