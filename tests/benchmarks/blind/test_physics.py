"""The simulator against closed forms, another integrator, and itself with half the step."""

from typing import get_args

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from drake_tc.joint_simulator.measurement import clean_log
from drake_tc.joint_simulator.physics import Record, simulate
from drake_tc.joint_simulator.reference import make_motion
from drake_tc.joint_simulator.spec import BlindError, DivergedError, Drive

from .make import rig
from .truth import unmodelled_torque

LINEAR = rig(coulomb=0.0, gravity=0.0, duration=2.5)
PENDULUM = rig(coulomb=0.0, drive="voltage", duration=2.5)


@pytest.fixture(scope="module")
def fine() -> list[Record]:
    """The two rigs without Coulomb friction, at a step of 25 us."""
    return simulate([LINEAR, PENDULUM], ["sine", "multisine"], 2.5e-5)


def test_linear_servo_agrees_with_linear_system(fine: list[Record]) -> None:
    """Without Coulomb friction and gravity: (J + J_l) q'' + B q' + q/K = q_d/K."""
    spec, record = LINEAR, fine[0]
    motion = make_motion(spec, "sine")
    inertia = spec.joint.rotor_inertia + spec.joint.link_inertia
    system = ([1.0 / spec.joint.gain], [inertia, spec.joint.damping, 1.0 / spec.joint.gain])
    time = np.arange(motion.position.size) * 1e-3
    expected = lsim(system, motion.position, time)[1][:-1]
    # atol: first order in the step, 0.1 rad * 25 us * 80 rad/s
    np.testing.assert_allclose(record.channels["position"], expected, atol=5e-5)


def test_pendulum_agrees_with_another_integrator(fine: list[Record]) -> None:
    spec, record = PENDULUM, fine[1]
    motion = make_motion(spec, "multisine")
    time = np.arange(motion.position.size) * 1e-3
    joint = spec.joint
    inertia = joint.rotor_inertia + joint.link_inertia
    kp = inertia * joint.bandwidth**2
    kd = max(1.6 * inertia * joint.bandwidth - joint.damping, 0.0)

    def slope(t: float, x: np.ndarray) -> list[float]:
        q_d, v_d, hand = (np.interp(t, time, y) for y in (motion.position, motion.velocity, motion.load))
        torque = kp * (q_d - x[0]) + kd * (v_d - x[1]) - joint.damping * x[1] - joint.gravity * np.sin(x[0]) - hand
        return [x[1], torque / inertia]

    found = solve_ivp(slope, (0.0, 2.4), [0.0, 0.0], t_eval=time[:2400], rtol=1e-7, atol=1e-9, max_step=5e-3)
    # atol: first order in the step of 25 us at a few rad/s
    np.testing.assert_allclose(record.channels["position"][:2400], found.y[0], atol=1e-4)


def test_halving_the_step_converges() -> None:
    causes: list[dict] = [
        {},
        {"stribeck": {"excess": 2.0, "speed": 0.2, "exponent": 2.0}},
        {"presliding_hysteresis": {"share": 0.8, "length": 0.02}},
        {"elasticity": {"compliance": 3e-5}},
    ]
    specs = [rig(each, duration=1.5) for each in causes]
    steps = (simulate(specs, ["multisine"] * len(specs), h) for h in (2e-4, 1e-4, 5e-5))
    q1, q2, q4 = (np.stack([record.channels["position"] for record in records]) for records in steps)
    coarse, fine = (np.sqrt(np.mean(error**2, axis=1)) for error in (q1 - q2, q2 - q4))
    np.testing.assert_array_less(fine, 0.65 * coarse)  # first order: one half
    np.testing.assert_array_less(coarse, 1e-4)


def test_null_rig_satisfies_the_declared_balance() -> None:
    for record in simulate([rig(drive=drive) for drive in get_args(Drive)], ["multisine"] * len(get_args(Drive))):
        np.testing.assert_allclose(unmodelled_torque(record, clean_log(record)), 0.0, atol=1e-8)


def test_a_gap_lets_the_link_move_freely_and_a_spring_twists_by_torque_over_stiffness() -> None:
    gears = [rig({"backlash": {"half_gap": 2e-3}}), rig({"elasticity": {"compliance": 5e-5}})]
    record, spring = simulate(gears, ["multisine", "static"])
    twist = record.channels["motor_position"] - record.channels["position"]
    torque = record.channels["torque"]
    inside = np.abs(twist) < 2e-3
    assert inside.sum() > 10
    np.testing.assert_allclose(torque[inside], 0.0, atol=0.0)
    assert np.max(np.abs(twist)) < 2e-3 + np.max(np.abs(torque)) / 4e5 + 1e-4
    assert np.all(torque * twist >= 0.0)  # it pushes, never pulls
    twist = spring.channels["motor_position"] - spring.channels["position"]
    slope = np.polyfit(spring.channels["torque"], twist, 1)[0]
    np.testing.assert_allclose(slope, 5e-5, rtol=0.02)  # the damper's share is what is left
    # Newton's law for the link, whose acceleration is the slope of its recorded velocity
    joint, load = gears[1].joint, make_motion(gears[1], "static").load[:-1]
    load = load + joint.gravity * np.sin(spring.channels["position"])
    left = joint.link_inertia * np.gradient(spring.channels["velocity"], 1e-3) - spring.channels["torque"] + load
    assert np.std(left) < 0.05 * np.std(load)


def test_runaway_and_bad_step_are_refused() -> None:
    spec = rig({"current_lag": {"time": 0.015}}, gain=2e-5, servo_damping=0.0, viscous=1.0, coulomb=0.1)
    with pytest.raises(DivergedError, match="rig"):
        simulate([spec], ["sine"])
    with pytest.raises(BlindError, match="divisor"):
        simulate([rig()], ["sine"], 3e-4)
    with pytest.raises(BlindError, match="no cause 'gremlins'"):
        simulate([rig({"gremlins": {"count": 3.0}})], ["sine"])
