"""Friction only ever takes energy out, whatever the joint does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_tc.joint_simulator.physics import Batch
from drake_tc.joint_simulator.reference import Motion
from drake_tc.joint_simulator.terms_joint import step_bristle
from drake_tc.types import FloatArray

from .make import rig

FRICTION = {
    "none": {},
    "stribeck": {"stribeck": {"excess": 3.0, "speed": 0.1, "exponent": 2.0}},
    "load": {"load_dependent_friction": {"mu": 0.2}},
    "asymmetric": {"asymmetric_friction": {"delta": 0.4, "share": 1.0}},
    "presliding": {"presliding_hysteresis": {"share": 0.9, "length": 0.02}},
    "position": {"position_dependent_friction": {"alpha": 0.5, "cycles": 6.0, "phase": 0.3}},
    "thermal": {"thermal_friction": {"rate": 0.05, "coulomb_share": 1.0, "viscous_share": 1.0}},
    "quadratic": {"quadratic_viscous": {"b2": 3.0}},
    "load times speed": {"load_times_speed": {"slope": 0.2}},
    "jump": {"friction_jump": {"share": 0.8, "start": -2.5}},
}


@given(s=st.floats(-1.0, 1.0), v=st.floats(-50.0, 50.0), length=st.floats(1e-6, 1.0), dt=st.floats(1e-6, 1e-2))
@settings(max_examples=200, deadline=None)
def test_bristle_stays_between_minus_one_and_one(s: float, v: float, length: float, dt: float) -> None:
    after = step_bristle(np.array([s]), np.array([v]), np.array([length]), dt)
    assert abs(after[0]) <= 1.0 + 1e-12


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_bristle_takes_at_least_what_it_stores(seed: int) -> None:
    """Work g s v dt into the bristle is never below the change of the stored energy g length s^2/2."""
    rng = np.random.default_rng(seed)
    dt, length, s, work = 1e-4, 1e-3, np.zeros(1), 0.0
    for v in np.cumsum(rng.normal(0.0, 0.05, 2000)):
        s = step_bristle(s, np.array([v]), np.array([length]), dt)
        work += float(s[0]) * v * dt
    assert work >= 0.5 * length * float(s[0]) ** 2 - 1e-12


def test_bristle_follows_dahl_closed_form() -> None:
    """At constant speed s(x) = 1 - exp(-x/length)."""
    dt, length, v, s = 1e-6, 1e-3, 0.5, np.zeros(1)
    for _ in range(4000):
        s = step_bristle(s, np.array([v]), np.array([length]), dt)
    # rtol: first order in dt v/length = 5e-4
    np.testing.assert_allclose(s[0], 1.0 - np.exp(-4000 * dt * v / length), rtol=1e-3)


@pytest.fixture(scope="module")
def swung() -> FloatArray:
    """What is recorded of a pendulum with each friction that is let go, its drive dead: (channels, T, frictions)."""
    still = {"bandwidth": 0.0, "servo_damping": 0.0, "viscous": 0.3, "coulomb": 0.5}
    specs = [rig(causes, "current", duration=1.2, **still) for causes in FRICTION.values()]
    rest = np.zeros(1201)
    batch = Batch(specs, ["sine"] * len(specs), [Motion(rest, rest, rest)] * len(specs), 1e-4)
    batch.state.q = np.full(len(specs), 1.2)
    batch.link_q = batch.state.q
    return batch.integrate(10, 1)


@pytest.mark.parametrize(("index", "name"), enumerate(FRICTION))
def test_swinging_joint_never_gains_energy(swung: FloatArray, index: int, name: str) -> None:
    """The mechanical energy with the bristles' never exceeds any earlier value."""
    joint = rig().joint
    q, v, s = swung[0, :, index], swung[1, :, index], swung[7, :, index]
    inertia = joint.rotor_inertia + joint.link_inertia
    energy = 0.5 * inertia * v**2 + joint.gravity * (1.0 - np.cos(q)) + 0.5 * 0.5 * joint.breakaway * s**2
    # What a slow bristle may give back is at most C length/2; the integrator's own ripple is of order dt.
    slack = 0.5 * 0.5 * 0.02 if name == "presliding" else 0.0
    assert np.max(energy - np.minimum.accumulate(energy)) <= slack + 2e-4 * energy[0]
    assert energy[-1] < 0.9 * energy[0]
