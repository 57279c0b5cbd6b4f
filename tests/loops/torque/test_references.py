"""References: through the knots, derivatives against finite differences, at rest outside, forces ramped in."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.loops.torque.references import posture, references, table_source
from drake_tc.registry import diagram_entry
from drake_tc.robot.robot import load_robot


def built(diagram, name, text=None):
    scenario = diagram_entry(diagram).scenario(name, text=text)
    robot = load_robot(scenario.path(scenario.robot))
    return scenario, robot, references(scenario, robot)


@pytest.mark.parametrize("name", ["stairs_swing", "identify_motion"])
def test_velocity_and_acceleration_are_the_derivatives(name):
    _, robot, desired = built("hrp2_leg", name)
    n, dt = len(robot.joints), desired.time[1]
    q, v, a = np.split(desired.motion, 3, axis=1)
    assert q.shape == (desired.time.size, n)
    middle = slice(1, -1)
    # central differences: error dt^2/6 of the third (1e4 rad/s^3 at most) and fourth (1e6) derivative
    assert_allclose((q[2:] - q[:-2]) / (2 * dt), v[middle], atol=2e-3)
    assert_allclose((q[2:] - 2 * q[1:-1] + q[:-2]) / dt**2, a[middle], atol=0.5)
    assert np.abs(a).max() > 1.0


def test_through_the_knots_and_at_rest_outside():
    scenario, robot, desired = built("hrp2_leg", "stairs_swing")
    n = len(robot.joints)
    for joint, positions in scenario.motion.knots.items():
        i = robot.joints.index(joint)
        rows = np.rint(np.array(scenario.motion.times) / scenario.dt).astype(int)
        assert_allclose(desired.motion[rows, i], positions, atol=1e-9)
        assert_allclose(desired.motion[: rows[0], i], positions[0], atol=1e-12)
        assert_allclose(desired.motion[rows[-1] :, i], positions[-1], atol=1e-12)
    outside = (desired.time < 0.8 - 1e-9) | (desired.time > 2.0 + 1e-9)
    assert_allclose(desired.motion[outside, n:], 0.0, atol=1e-12)
    assert (
        np.abs(np.diff(desired.motion[:, n:], axis=0)).max() < 0.5
    )  # no step in velocity or acceleration (a tick: 1 ms)


def test_posture_is_the_robots_unless_the_motion_says_otherwise():
    scenario, robot, desired = built("hrp2_leg", "hanging", "{motion: {posture: {r_knee: 1.25}}}")
    rest = posture(scenario.motion, robot)
    assert rest[robot.joints.index("r_knee")] == 1.25
    assert rest[robot.joints.index("r_hip_pitch")] == -0.45
    assert rest[robot.joints.index("r_hip_yaw")] == robot.posture[0]
    assert_allclose(desired.motion[:, : rest.size], np.tile(rest, (desired.time.size, 1)))
    assert robot.posture[robot.joints.index("r_knee")] == 0.8727  # not changed in place


def test_force_is_zero_then_ramped_then_offset_and_sine():
    scenario, _, desired = built("hrp2_leg_contact", "force_sine")
    spec = scenario.force["right_ankle"]
    late = desired.time >= spec.begin + spec.ramp
    sine = np.sin(2 * np.pi * spec.frequency_hz * (desired.time[late] - spec.begin))
    assert_allclose(desired.force[late, 2], 100.0 + 50.0 * sine, atol=1e-9)
    assert_allclose(desired.force[desired.time <= spec.begin], 0.0, atol=1e-12)
    assert_allclose(np.delete(desired.force, 2, axis=1), 0.0)
    assert np.abs(np.diff(desired.force[:, 2])).max() < 1.0  # the ramp has no step


def test_a_table_is_held_around_its_ticks():
    time = np.arange(5) * 1e-3
    values = np.arange(10.0).reshape(5, 2) ** 2
    source = table_source(time, values)
    context = source.CreateDefaultContext()
    for k in range(4):  # the last row ends the table
        for shift in (-4e-4, 0.0, 4e-4):
            context.SetTime(max(time[k] + shift, 0.0))
            assert_allclose(source.get_output_port().Eval(context), values[k])
