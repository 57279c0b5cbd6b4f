"""References in closed form: derivatives by differences, ends at rest three times over, orientations that arrive."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from scipy.spatial.transform import Rotation
from scipy.spatial.transform import Slerp as ScipySlerp

from drake_tc.control.reference_source import ReferenceSource
from drake_tc.control.references import PointToPoint, Slerp, Swing, smooth_step
from drake_tc.control.trajectories import Chain, PosePath
from drake_tc.errors import ParamsError

H = 1e-4
TIMES = np.linspace(0.0, 3.0, 301)
START, GOAL = (0.9, 0.1, -0.3, 0.2), (-0.2, 0.7, 0.5, 0.4)
MOVE = PointToPoint((0.0, 1.0, -2.0), (0.3, 0.8, -2.0), 0.5, 1.5)
TURN = Slerp(START, GOAL, 0.5, 1.5)
SWING = Swing(START, (1.0, 2.0, -2.0), 0.6, 1.3, 0.4, 1.1)


def slope(function, t):
    """Five-point differences, exact to the fourth order."""
    return (function(t - 2 * H) - 8 * function(t - H) + 8 * function(t + H) - function(t + 2 * H)) / (12 * H)


def rotation(quaternions):
    return Rotation.from_quat(np.asarray(quaternions)[..., [1, 2, 3, 0]])


@pytest.mark.parametrize("order", [0, 1, 2])
def test_each_derivative_is_that_of_the_one_before(order):
    """Everywhere, the ends and beyond them too: so all four are continuous, the third as a limit."""
    paths = (MOVE.at, lambda t: TURN.at(t)[1], lambda t: SWING.at(t)[1])
    for path in paths:
        found = slope(lambda t, path=path: path(t)[order], TIMES)
        assert_allclose(found, path(TIMES)[order + 1], atol=5e-3 * np.abs(path(TIMES)[order + 1]).max())


def test_it_rests_at_both_ends_three_times_over():
    ends = MOVE.at(np.array([0.0, 0.5, 2.0, 9.0]))
    assert_allclose(ends.position, [MOVE.start, MOVE.start, MOVE.goal, MOVE.goal], atol=1e-15)
    for order in ends[1:]:
        assert_allclose(order, 0.0, atol=1e-12)
    near = MOVE.at(np.array([0.5 + 1e-6, 2.0 - 1e-6])).jerk
    assert np.abs(near).max() < 1e-3  # it starts from 0 and ends there; its largest is of order 10
    middle = MOVE.at(np.array([1.25]))
    assert_allclose(middle.position[0], 0.5 * np.add(MOVE.start, MOVE.goal), atol=1e-15)


def test_no_step_leaves_the_way_between_the_ends():
    value, rate = smooth_step(TIMES, 0.5, 1.5)[:2]
    assert (np.diff(value) >= 0.0).all()
    assert (rate >= 0.0).all()
    assert_allclose(rate.max(), 140.0 / 64.0 / 1.5, rtol=1e-3)  # at the middle: 140/4^3


@pytest.mark.parametrize("path", [TURN, SWING])
def test_angular_velocity_and_acceleration_are_those_of_the_rotation(path):
    """Of the matrices alone: omega = log(R(t + h) R(t - h)^T)/2h, alpha its differences."""

    def omega(t):
        ahead, behind = (Rotation.from_matrix(path.at(t + s)[0]) for s in (H, -H))
        return (ahead * behind.inv()).as_rotvec() / (2 * H)

    _, motion = path.at(TIMES)
    assert_allclose(omega(TIMES), motion.velocity, atol=1e-4)
    assert_allclose((omega(TIMES + H) - omega(TIMES - H)) / (2 * H), motion.acceleration, atol=2e-3)
    assert np.abs(motion.velocity).max() > 1.0


def test_slerp_goes_the_shorter_way_at_one_speed_law():
    """As SciPy's, at the parameter s; its ends are the given ones, whatever their lengths and signs."""
    ends = rotation([START, GOAL])
    share = smooth_step(TIMES, 0.5, 1.5)[0]
    expected = ScipySlerp([0.0, 1.0], ends)(np.clip(share, 0.0, 1.0))
    found = Rotation.from_matrix(TURN.at(TIMES)[0])
    assert (found * expected.inv()).magnitude().max() < 1e-9
    other = Slerp(tuple(3.0 * x for x in START), tuple(-x for x in GOAL), 0.5, 1.5)
    assert_allclose(other.at(TIMES)[0], TURN.at(TIMES)[0], atol=1e-12)


def test_a_swing_goes_to_and_fro_about_its_axis():
    """At the quarters of a period once risen: R = exp(+-A n) R_0."""
    quarters = SWING.begin + (np.array([10.0, 10.25, 10.5, 10.75])) / SWING.frequency_hz
    axis = np.array(SWING.axis) / 3.0
    found = Rotation.from_matrix(SWING.at(quarters)[0]) * rotation(START).inv()
    assert_allclose(found.as_rotvec(), np.outer([0.0, 0.6, 0.0, -0.6], axis), atol=1e-9)
    assert_allclose(SWING.at(np.array([0.0, SWING.begin]))[1].acceleration, 0.0, atol=1e-15)


def test_rows_are_those_that_tasks_follow():
    now = 1.1
    motion, (matrix, turn) = MOVE.at(np.array([now])), TURN.at(np.array([now]))
    assert_allclose(MOVE.row(now), np.concatenate([motion.position, motion.velocity, motion.acceleration], axis=None))
    row = TURN.row(now)
    assert_allclose(rotation(row[:4]).as_matrix(), matrix[0], atol=1e-12)
    assert_allclose(row[4:], np.concatenate([turn.velocity[0], turn.acceleration[0]]))
    pose = PosePath(TURN, MOVE).row(now)
    places = (0, 4, 7, 10, 13, 16, 19)
    parts = [pose[a:b] for a, b in pairwise(places)]
    whole = (row[:4], MOVE.row(now)[:3], row[4:7], MOVE.row(now)[3:6], row[7:], MOVE.row(now)[6:])
    for part, expected in zip(parts, whole, strict=True):
        assert_allclose(part, expected, atol=0)


def test_a_chain_goes_on_from_where_the_last_piece_rests():
    back = Slerp(GOAL, START, 2.5, 0.5)
    chain = Chain((TURN, back))
    for now in (0.0, 0.6, 1.9, 2.4):
        assert_allclose(chain.row(now), TURN.row(now), atol=0)
    for now in (2.5, 2.7, 4.0):
        assert_allclose(chain.row(now), back.row(now), atol=0)
    assert_allclose(chain.row(2.5 - 1e-9), chain.row(2.5), atol=1e-6)


def test_pieces_meet_up_to_rounding_and_the_sign_of_a_quaternion():
    """No jump where they do, in position, velocity and acceleration."""
    turned_back = Slerp(tuple(-2.0 * part for part in GOAL), START, 2.0, 0.5)
    away = PointToPoint((0.3 + 1e-12, 0.8, -2.0), (1.0, 1.0, 1.0), 2.0, 0.5)
    for one, other in ((TURN, turned_back), (MOVE, away)):
        chain = Chain((one, other))
        assert_allclose(chain.row(2.0 + 1e-7), chain.row(2.0 - 1e-7), atol=1e-6)


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_a_quaternion_of_any_length_gives_the_same_numbers(size):
    """Its squares are 0 or infinite."""
    long = (tuple(size * part for part in START), tuple(size * part for part in GOAL))
    axis = tuple(size * part for part in SWING.axis)
    for path, plain in ((Slerp(*long, 0.5, 1.5), TURN), (Swing(long[0], axis, 0.6, 1.3, 0.4, 1.1), SWING)):
        for now in (0.0, 0.9, 3.0):
            assert_allclose(path.row(now), plain.row(now), atol=1e-12)
        assert_allclose(path.at(TIMES)[0], plain.at(TIMES)[0], atol=1e-12)


@pytest.mark.parametrize("path", [MOVE, TURN, SWING, PosePath(SWING, MOVE)])
def test_as_a_source_it_follows_time_alone(path):
    source = ReferenceSource(path)
    simulator = Simulator(source)
    context = simulator.get_mutable_context()
    assert source.get_output_port().size() == path.size
    for now in (0.0, 0.7, 1.9):
        context.SetTime(now)
        assert_allclose(source.GetOutputPort("reference").Eval(context), path.row(now), atol=0)
    assert context.num_total_states() == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PointToPoint((0.0,), (1.0, 2.0), 0.0, 1.0), "expected start and goal of one length, got 1 and 2"),
        (lambda: PointToPoint((), (), 0.0, 1.0), "expected start and goal of one length"),
        (lambda: PointToPoint((0.0,), (np.nan,), 0.0, 1.0), "point to point: expected finite numbers"),
        (lambda: PointToPoint((0.0,), (1.0,), 0.0, 0.0), r"expected a positive duration \[s\], got 0.0"),
        (lambda: Slerp((0.0,) * 4, GOAL, 0.0, 1.0), "slerp: expected a quaternion .* that is not zero"),
        (lambda: Slerp(START[:3], GOAL, 0.0, 1.0), "slerp: expected a quaternion"),
        (lambda: Slerp(START, GOAL, np.inf, 1.0), "slerp: expected finite numbers"),
        (lambda: Swing(START, (0.0, 0.0, 0.0), 0.1, 1.0), "swing: expected an axis with a direction"),
        (lambda: Swing(START, (0.0, 0.0, 1.0), 0.1, -1.0), "swing: expected a positive frequency_hz"),
        (lambda: Chain(()), "chain: expected pieces of one size"),
        (lambda: Chain((TURN, MOVE)), r"chain: expected pieces of one size, got \[10, 9\]"),
        (
            lambda: Chain((MOVE, PointToPoint((5.0, 0.8, -2.0), (6.0, 0.8, -2.0), 2.0, 1.0))),
            "ends at .*, the next begins",
        ),
        (
            lambda: Chain((TURN, Slerp(START, GOAL, 2.0, 1.0))),
            "chain: expected each piece where the one before has ended",
        ),
        (lambda: PointToPoint((0.0,), (1.0,), 0.0, 1e-300), r"expected a duration of at least 1e-06 s, got 1e-300"),
        (lambda: Slerp((1.5e308, 1.5e308, 0.0, 0.0), GOAL, 0.0, 1.0), "slerp: expected a quaternion"),
        (lambda: Swing(START, (1.5e308, 1.5e308, 0.0), 0.1, 1.0), "swing: expected an axis with a direction"),
        (lambda: Chain((TURN, TURN)), "chain: expected each piece after the one before; 0.5 s is before 2 s"),
        (lambda: PosePath(TURN, PointToPoint((0.0,), (1.0,), 0.0, 1.0)), "pose: expected a place of three numbers"),
    ],
)
def test_what_is_refused(make, message):
    with pytest.raises(ParamsError, match=message):
        make()
