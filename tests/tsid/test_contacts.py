"""Contacts: their numbers are checked, and a mask puts those that are active one after the other."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact, select

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
        ({}, "expected a sole of positive size"),
        ({"half_length": 0.1}, "expected a sole of positive size"),
        ({"half_length": -0.1, "half_width": 0.1}, "expected a sole of positive size"),
        ({"half_length": math.nan, "half_width": 0.1}, "expected a sole of positive size"),
        ({"extents": (0.1, -0.1, -0.1, 0.1)}, "expected a sole of positive size"),
        ({"extents": (0.1, 0.2, -0.1, 0.1)}, "expected the frame's origin on the sole"),
        ({"extents": (-0.1, 0.2, -0.1, 0.1), "half_width": 0.1}, "half_length and half_width or extents, got both"),
        ({"kind": "line"}, "expected a kind of surface, point, got 'line'"),
        ({"kind": "point", "axes": "up"}, "axes: expected link or world for a point, got 'up'"),
        ({"axes": "world", "half_length": 0.1, "half_width": 0.1}, "axes: expected link for a surface, got 'world'"),
        ({"kind": "point", "friction": -0.1}, "friction: expected a finite number >= 0, got -0.1"),
        ({"kind": "point", "friction": math.nan}, "friction: expected a finite number >= 0"),
        ({"kind": "point", "moment_friction": -1.0}, "moment_friction: expected a finite number >= 0"),
        ({"kind": "point", "minimum_force": -1.0}, "minimum_force: expected a finite number >= 0"),
        ({"kind": "point", "maximum_force": 0.5}, "maximum_force: expected more than minimum_force 1, got 0.5"),
        ({"kind": "point", "maximum_force": math.nan}, "maximum_force: expected more than minimum_force 1, got nan"),
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
    with pytest.raises(ParamsError, match=r"active: expected one value a contact \(3\), got 2"):
        select(contacts, (True, True))
