"""One instant of a reference on plain floats is that of the arrays for many, whose rotations tests/control check."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.control.references import PointToPoint, Slerp, Swing, smooth_step
from drake_tc.control.rotation import quaternion_of, rotation_matrix
from drake_tc.kernels.calls import sequences
from drake_tc.kernels.compiling import interpreted
from drake_tc.kernels.equations import step_at, turned, unit
from drake_tc.kernels.sequence import swing

MOVE = PointToPoint((0.1, -0.2, 0.9), (0.3, 0.1, 0.7), 0.4, 0.9)
TURN = Slerp((0.9, 0.1, -0.3, 0.2), (-0.2, 0.7, 0.1, 0.5), 0.4, 0.9)
WIDE = Slerp((0.1, 0.9, -0.3, 0.2), (0.2, -0.7, 0.4, -0.9), 0.4, 0.9)
STILL = Slerp((0.5, 0.1, 0.2, 0.3), (0.5, 0.1, 0.2, 0.3), 0.0, 1.0)
SWING = Swing((0.3, -0.9, 0.2, 0.1), (1.0, -2.0, 2.0), 2.4, 1.3, 0.4, 0.8)
TIMES = np.concatenate([np.linspace(-0.2, 3.0, 331), [0.4, 1.2, 1.3]])


def test_the_smooth_step_of_one_time_is_that_of_many():
    found = np.array([step_at(now, 0.4, 0.9) for now in TIMES]).T
    assert_allclose(found, smooth_step(TIMES, 0.4, 0.9)[:3], rtol=1e-13, atol=1e-13)
    assert np.isnan(step_at(np.nan, 0.4, 0.9)).all()


def test_a_row_of_places_is_that_of_many_times():
    motion = MOVE.at(TIMES)
    rows = np.array([MOVE.row(now) for now in TIMES])
    assert_allclose(rows, np.hstack([motion.position, motion.velocity, motion.acceleration]), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("path", [TURN, WIDE, STILL, SWING], ids=["turn", "wide", "still", "swing"])
def test_a_row_of_orientations_is_that_of_many_times(path):
    """Rotations as matrices, of the quaternion's part; rates as they are."""
    matrices, motion = path.at(TIMES)
    rows = np.array([path.row(now) for now in TIMES])
    assert_allclose([rotation_matrix(row[:4]) for row in rows], matrices, atol=2e-15)
    assert_allclose(rows[:, 4:], np.hstack([motion.velocity, motion.acceleration]), rtol=1e-12, atol=1e-13)
    assert_allclose(np.linalg.norm(rows[:, :4], axis=1), 1.0, atol=1e-15)
    assert (rows[:, 0] >= 0.0).all()


def test_a_turned_quaternion_is_that_of_the_turned_matrix():
    first, axis = unit((0.3, -0.9, 0.2, 0.1)), (0.6, 0.0, -0.8)
    for angle in np.linspace(-7.0, 7.0, 57):
        turn = np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * np.array(axis))])
        matrix = rotation_matrix(turn) @ rotation_matrix(np.array(first))
        assert_allclose(turned(axis, angle, first), quaternion_of(matrix), atol=1e-14)


def test_a_compiled_swing_is_its_row_bit_by_bit_and_ends_where_it_is_told():
    out, asked, until = np.zeros(10), [], np.array([2.0])
    (call,) = sequences([SWING.call(until, out, asked.append)] * (1 if interpreted() else 2))
    for now in TIMES[TIMES <= 2.0]:
        if not interpreted():
            call(now)
            assert_array_equal(out, SWING.row(now))
        swing(now, *SWING.call(until, out, asked.append).arguments[::2])
        assert_array_equal(out, SWING.row(now))
    assert not asked
    call(2.1)
    assert set(asked) == {2.1}
