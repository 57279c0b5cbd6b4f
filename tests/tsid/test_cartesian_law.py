"""Cartesian laws: errors follow their gains as a linear system does; accelerations by differences of rotations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from .cartesian_law import (
    Turning,
    carried_to_world,
    relative_turn,
    rotation_acceleration,
    rotation_law,
    translation_acceleration,
)

K, D = np.array([80.0, 120.0, 50.0]), np.array([6.0, 14.0, 9.0])


def spun(t):
    """A reference that tumbles: three elementary turns of its own phase and speed; of one time or many."""
    angles = [3.0 * t + 0.4 * np.sin(5.0 * t), 1.2 * np.sin(4.0 * t), 0.8 * t**2 - t]
    return Rotation.from_euler("zyx", np.stack(angles, axis=-1))


def rates(turn, t, h=1e-4):
    """omega and alpha of turn(t) in the world, by five-point differences."""

    def omega(s):
        near = [(turn(s + k * h) * turn(s).inv()).as_rotvec() for k in (-2, -1, 1, 2)]
        return (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * h)

    values = [omega(t + k * h) for k in (-2, -1, 1, 2)]
    return omega(t), (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)


def wanted(t):
    """The reference at one time."""
    omega, alpha = rates(spun, t)
    return Turning(spun(t).as_matrix(), omega, alpha)


@pytest.mark.parametrize("t", [0.0, 0.3, 0.9])
def test_accelerations_seen_from_a_turning_frame_are_carried_to_the_world(t):
    """R_WE = R_WD R_DE, both given: alpha_E by differences, against w and wdot by differences of R_DE alone."""

    def seen(s):
        return Rotation.from_rotvec([0.7 * np.sin(2 * s), 0.5 - s, 0.9 * s**2 + 0.2 * s])

    reference = wanted(t)
    omega, alpha = rates(lambda s: spun(s) * seen(s), t)
    w, wdot = rates(seen, t)
    turn = relative_turn(reference, (spun(t) * seen(t)).as_matrix(), omega)
    assert_allclose(turn.angles, seen(t).as_rotvec(), atol=1e-9)
    assert_allclose(turn.velocity, w, atol=1e-6)
    assert_allclose(carried_to_world(reference, w, wdot), alpha, rtol=1e-5, atol=1e-4)
    assert np.linalg.norm(np.cross(reference.velocity, reference.rotation @ w)) > 1.0  # the term is no small one


STEP, STEPS = 1e-3, 400


@pytest.fixture(scope="module")
def references():
    """At every half step."""
    times = 0.5 * STEP * np.arange(2 * STEPS + 1)
    return [Turning(*rows) for rows in zip(spun(times).as_matrix(), *rates(spun, times), strict=True)]


def followed(references, law, angles, rate):
    """Theta over time of a body whose omegadot is `law`, from theta and w at 0; classical Runge-Kutta."""
    start, h, found = references[0], STEP, []
    turn, omega = Rotation.from_matrix(start.rotation) * Rotation.from_rotvec(angles), start.velocity
    omega = omega + start.rotation @ rate
    for k in range(0, 2 * STEPS, 2):
        now, half, after = references[k : k + 3]
        found.append(relative_turn(now, turn.as_matrix(), omega).angles)
        one = law(now, turn.as_matrix(), omega)
        second = omega + h / 2 * one
        two = law(half, (Rotation.from_rotvec(h / 2 * omega) * turn).as_matrix(), second)
        third = omega + h / 2 * two
        three = law(half, (Rotation.from_rotvec(h / 2 * second) * turn).as_matrix(), third)
        last = omega + h * three
        four = law(after, (Rotation.from_rotvec(h * third) * turn).as_matrix(), last)
        turn = Rotation.from_rotvec(h / 6 * (omega + 2 * second + 2 * third + last)) * turn
        omega = omega + h / 6 * (one + 2 * two + 2 * three + four)
    return np.array(found)


def linear(stiffness, damping, angle, rate):
    """The same of thetadd = -K theta - D thetad along one axis, by the matrix exponential."""
    step = expm(STEP * np.array([[0.0, 1.0], [-stiffness, -damping]]))
    state, found = np.array([angle, rate]), []
    for _ in range(STEPS):
        found.append(state[0])
        state = step @ state
    return np.array(found)


def test_a_small_error_follows_its_gains_however_the_reference_turns(references):
    angles, rate = np.array([1e-3, -2e-3, 1.5e-3]), np.array([0.01, 0.02, -0.03])

    def law(reference, rotation, omega):
        return rotation_acceleration(reference, rotation, omega, K, D)

    def without_coriolis(reference, rotation, omega):
        turn = relative_turn(reference, rotation, omega)
        return reference.acceleration + reference.rotation @ rotation_law(turn, K, D)

    expected = np.transpose([linear(*axis) for axis in zip(K, D, angles, rate, strict=True)])
    found = followed(references, law, angles, rate)
    assert_allclose(found, expected, atol=1e-5)
    assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()
    assert np.abs(followed(references, without_coriolis, angles, rate) - expected).max() > 3e-4  # the term's worth


def test_along_one_axis_it_is_linear_at_any_size(references):
    """Error and rate along one axis, K and D scalars: 2.5 rad at the start."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0

    def law(reference, rotation, omega):
        return rotation_acceleration(reference, rotation, omega, 60.0, 9.0)

    found = followed(references, law, 2.5 * axis, -1.0 * axis)
    assert_allclose(found, np.outer(linear(60.0, 9.0, 2.5, -1.0), axis), atol=1e-3)


def test_a_frame_on_its_reference_turns_as_the_reference_does():
    reference = wanted(0.5)
    found = rotation_acceleration(reference, reference.rotation, reference.velocity, K, D)
    assert_allclose(found, reference.acceleration, atol=1e-9)


def test_translation_error_follows_its_gains():
    """e of the closed loop after 0.5 s, integrated finely, against the matrix exponential."""

    def reference(t):
        return np.concatenate([[np.sin(3 * t), t**2, 1.0], [3 * np.cos(3 * t), 2 * t, 0.0], [-9 * np.sin(3 * t), 2, 0]])

    e, ed, h = np.array([0.3, -0.2, 0.1]), np.array([1.0, 0.5, -2.0]), 1e-4
    x, v = reference(0.0)[:3] - e, reference(0.0)[3:6] - ed
    for step in range(5000):
        middle = v + h / 2 * translation_acceleration(reference(step * h), x, v, K, D)
        v = v + h * translation_acceleration(reference((step + 0.5) * h), x + h / 2 * v, middle, K, D)
        x = x + h * middle
    expected = [
        (expm(0.5 * np.array([[0.0, 1.0], [-k, -d]])) @ start)[0]
        for k, d, start in zip(K, D, np.stack([e, ed], axis=1), strict=True)
    ]
    assert_allclose(reference(0.5)[:3] - x, expected, atol=1e-5)


def test_translation_of_many_points_at_once():
    rng = np.random.default_rng(2)
    reference, x, v = rng.normal(size=(7, 9)), rng.normal(size=(7, 3)), rng.normal(size=(7, 3))
    one_by_one = [translation_acceleration(*row, K, D) for row in zip(reference, x, v, strict=True)]
    assert_allclose(translation_acceleration(reference, x, v, K, D), one_by_one, rtol=1e-15)
