"""`WarmStart`: what goes in comes out, and what has no room is left out."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.tsid.law import WarmStart
from drake_tc.tsid.robust.convex import FREE, ActiveSet, Start


def there_and_back(start, joints=4):
    layout = WarmStart(joints)
    packed = np.full(layout.size, np.nan)
    layout.pack(start, packed)
    assert np.isfinite(packed).all()
    return layout.unpack(packed)


def held(count):
    rng = np.random.default_rng(count)
    sides = np.where(rng.normal(size=count) > 0.0, 1, -1)
    return ActiveSet(rng.permutation(100)[:count].astype(np.int64), sides, rng.normal(size=count))


@pytest.mark.parametrize("count", [0, 1, 10])
@pytest.mark.parametrize("inner", [None, np.arange(32.0)], ids=["no inner", "inner"])
def test_a_start_comes_back(count, inner):
    start = Start(np.array([1.0, -2.0, 3.5, 0.0]), 77, held(count), 0.25, inner)
    found = there_and_back(start)
    assert_array_equal(found.torque, start.torque)
    assert (found.rows, found.weight) == (77, 0.25)
    for name in ("rows", "sides", "multipliers"):
        assert_array_equal(getattr(found.active_set, name), getattr(start.active_set, name))
    assert found.active_set.rows.dtype == np.int64
    if inner is None:
        assert found.inner is None
    else:
        assert_array_equal(found.inner, inner)


def test_nothing_stays_nothing_and_too_much_is_left_out():
    assert there_and_back(None) is None
    found = there_and_back(Start(np.ones(4), 5, held(11), 0.0, np.zeros(33)))
    assert_array_equal(found.torque, np.ones(4))
    assert found.active_set is FREE
    assert found.inner is None
