"""Roll, pitch and the gyro's bias: from rest, from contacts that stand, from soft soles."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from drake_tc.estimation.base_estimator import CopEstimator
from drake_tc.estimation.base_kinematics import CONTACT_MEMORY, initial_state, packed
from drake_tc.estimation.base_log import run_log, track_error
from drake_tc.kernels.base.attitude import corrected_up, filter_times, tilt_correction, turned_up
from drake_tc.kernels.base.contacts import Slip, shown_vertical, slipping
from drake_tc.kernels.base.sample import Given, Posture, options_of
from drake_tc.kernels.base.state import RESTED, memory_of

from .constructed import REAL, Motion, construct, spec, walker

PERIOD = 5e-3


def test_the_gains_of_a_growing_memory_are_the_line_through_all_errors():
    """Angle and rate of white errors by the recursion, against the least squares line at the end."""
    dt, rng = 1e-2, np.random.default_rng(3)
    t = dt * np.arange(1, 2001)
    seen = 0.5 + 0.3 * t + 0.05 * rng.normal(size=t.size)
    angle, rate = seen[0], 0.0
    for n, measured in enumerate(seen[1:], 2):
        time, bias_time = filter_times(n * dt, np.inf, np.inf)
        push = min(1.0, dt / time) * (measured - (angle + dt * rate))
        angle, rate = angle + dt * rate + push, rate + push / bias_time
    slope, start = np.polyfit(t, seen, 1)
    assert_allclose(angle, start + slope * t[-1], atol=2e-3)
    assert_allclose(rate, slope, atol=5e-4)
    assert filter_times(100.0, 0.5, 5.0) == (0.5, 5.0)


def swayed(contacts, amplitude=1.0, frequency=0.4):
    """(16 s of) error of a filter of 3 s on a body that stays level and accelerates to and fro along x [rad]."""
    dt = 2e-3
    t = dt * np.arange(8000)
    w = 2.0 * np.pi * frequency
    speed = amplitude / w * np.sin(w * t)
    up, found = np.array([0.0, 0.0, 1.0]), []
    for before, now in pairwise(speed.tolist()):
        accel = np.array([(now - before) / dt, 0.0, 9.81])
        carried_on = np.array([before, 0.0, 0.0]) + dt * (accel - 9.81 * up)
        known = np.array([now, 0.0, 0.0])
        up = turned_up(up, np.zeros(3), dt)
        push = tilt_correction(known - carried_on, dt, 3.0) if contacts else dt / 3.0 * (accel / 9.81 - up)
        up = corrected_up(up, push)
        found.append(up[0])
    return np.abs(found).max()


def test_what_the_base_accelerates_is_no_tilt_where_contacts_tell_it():
    assert swayed(contacts=True) < 1e-9
    assert swayed(contacts=False) > 5e-3


def test_a_vertical_that_is_wrong_comes_back_within_its_time():
    dt, time, wrong = 1e-3, 1.0, 2e-3
    up = corrected_up(np.array([wrong, 0.0, 1.0]), np.zeros(3))
    for _ in range(1000):  # at rest: the accelerometer reads the truth, and the contacts say no velocity
        velocity_innovation = -dt * 9.81 * (np.array([0.0, 0.0, 1.0]) - up)
        up = corrected_up(up, tilt_correction(velocity_innovation, dt, time))
    assert_allclose(up[0], wrong * np.exp(-1.0), rtol=0.01)


def test_soft_soles_show_the_vertical():
    """A sole of springs under a load off its middle, tilted as the closed form has it, on a base that is tilted too."""
    K, load, c = 1e5, 150.0, np.array([[0.02, -0.01], [-0.015, 0.012]])
    contacts = tuple(replace(item, sole_stiffness=K) for item in spec(PERIOD).contacts)
    r2 = np.array([0.1**2 * 6.0 / 12.0, 0.05**2 * 4.0 / 6.0])
    base = Rotation.from_euler("xyz", [0.03, -0.05, 0.7]).as_matrix()
    feet = []
    for x in c:
        deep = load * x / (K * r2)  # the sole is deeper towards the load: its normal leans
        normal = np.array([-deep[0], -deep[1], 1.0])
        turn, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [normal / np.linalg.norm(normal)])
        feet.append(base.T @ turn.as_matrix())
    state = initial_state(np.zeros(1), 2, np.zeros(3), 0.0)
    columns = dict.fromkeys(CONTACT_MEMORY, 0.0) | {"on": 1.0, "load": load, "shape": 1.3}
    state = state._replace(contacts=np.array([list(columns.values())] * 2), pressure=c)
    posture = Posture(np.array([*feet, np.eye(3)]), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)))
    memory = memory_of(packed(state), 1, 2)
    for soft, expected in ((contacts, base[2]), (spec(PERIOD).contacts, np.zeros(3))):
        estimator = CopEstimator(walker(), replace(spec(PERIOD), contacts=soft))
        given = Given(estimator.soles, estimator.tables, memory, options_of(estimator.options))
        assert_allclose(shown_vertical(given, posture), expected, atol=5e-4)


def test_slow_rocking_is_no_rest_and_rest_is():
    """Joints quiet, gyro under `still_rate`: where the load wanders over the soles, no bias is learnt."""
    made = construct(Motion(duration=1.2, period=PERIOD, rest=9.0), REAL, seed=1)
    log, bias = made.log, np.array(REAL.gyro_bias)
    quiet = np.zeros_like(log.tilt) * np.nan
    rate = 0.02  # of the rocking [rad/s]; on soles of 1e5 N/m it moves 150 N by 67 mm/s
    wander = 0.067 * log.time
    wrench = log.wrench.copy()
    wrench[:, :, 4] -= wander[:, None] * wrench[:, :, 2]
    rocking = replace(log, gyro=log.gyro + np.array([0.0, rate, 0.0]), wrench=wrench, tilt=quiet, qd=0.0 * log.qd)
    resting = replace(log, tilt=quiet, qd=0.0 * log.qd)
    learnt = {}
    for name, each in (("rocking", rocking), ("resting", resting)):
        estimator = CopEstimator(walker(), spec(PERIOD, still_rate=0.05))
        state = estimator.initial_state(made.truth.position[0], 0.0)
        for i in range(len(each.time)):
            state = estimator.step(state, each.sample(i))
        learnt[name] = state
    assert_allclose(learnt["resting"].bias, bias, atol=1e-3)
    assert learnt["resting"].scalars[RESTED] > 150
    assert learnt["rocking"].scalars[RESTED] < 25
    assert abs(learnt["rocking"].bias[1] - bias[1]) < 0.25 * rate


@pytest.mark.parametrize("share", [0.02, 0.2])
def test_a_foot_in_the_air_does_not_outvote_the_one_that_stands(share):
    """The heavy contact seems the faster one; it is left out only if what is left bears something."""
    options = options_of(CopEstimator(walker(), spec(2e-3)).options)
    slip, on, load = Slip(np.zeros((2, 3)), np.zeros(2)), np.ones(2, dtype=bool), np.array([300.0, 300.0 * share])
    against = np.array([[0.3, 0.0, 0.0], [0.1, 0.0, 0.0]])
    for _ in range(50):
        slip = slipping((on, ~on, load), against, slip, options)
    assert (slip.dropped[0] > 0.0) == (share > 0.1)


def test_a_quick_start_learns_the_bias_about_the_vertical_while_it_moves():
    made = construct(Motion(duration=1.6, period=PERIOD, rest=0.05, tilt=0.0, pivot=0.0), REAL, seed=2)
    errors = {}
    for quick in (False, True):
        tuned = spec(PERIOD, quick_start=quick, still_rate=1e-6)
        track = run_log(CopEstimator(walker(), tuned), made.log, made.truth.position[0], 0.0)
        errors[quick] = track_error(track, made.truth).angle[2]
    assert errors[True] < 0.7 * errors[False]
