"""The implicit friction step: a law for all inputs (energy), a root check, stiction."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.kernels.equations import PRESLIDING_DISPLACEMENT, Push, friction_step

positive = st.floats(1e-3, 40.0)


@given(
    z=st.floats(-1, 1),
    v=st.floats(-20, 20),
    thrust=st.floats(-300, 300),
    level=positive,
    damping=st.floats(0, 50),
    inertia=st.floats(2e-4, 2.0),
    step=st.sampled_from([1e-4, 1e-3, 5e-3]),
)
@settings(max_examples=300, deadline=None)
def test_step_solves_its_equation_and_friction_never_adds_energy(z, v, thrust, level, damping, inertia, step):
    deflection, velocity, torque = friction_step(z, v, Push(thrust, level, damping), inertia, step)
    scale = abs(thrust) + level + damping * (abs(v) + abs(velocity)) + inertia * abs(v) / step
    residual = inertia * (velocity - v) / step - (thrust - torque)
    assert abs(residual) <= 1e-9 * scale  # the implicit equation of motion, to rounding
    moved = step * velocity
    dry = torque - damping * velocity
    assert abs(dry) <= level + 1e-9 * scale  # never above its level
    stored = 0.5 * level * PRESLIDING_DISPLACEMENT * (deflection**2 - z**2)
    assert torque * moved >= stored - 1e-9 * scale * max(abs(moved), 1e-4)  # work done >= energy stored
    if z * velocity >= 0.0 and abs(z) == 1.0 and velocity != 0.0:
        assert torque * velocity >= 0.0  # in full sliding: pure dissipation


def test_sliding_block_stops_after_its_stopping_distance():
    inertia, level, step = 0.35, 7.0, 1e-4
    q, v, z = 0.0, 2.0, 1.0
    for _ in range(20000):
        z, v, _ = friction_step(z, v, Push(0.0, level, 0.0), inertia, step)
        q += step * v
    # J v0^2 / (2 Fc), less half a step's travel; the bristle springs back by no more than itself
    assert_allclose(q, inertia * 4.0 / (2 * level), atol=0.5 * step * 2.0 + 2 * PRESLIDING_DISPLACEMENT)
    assert abs(v) < 1e-6


def test_holds_any_load_below_its_level_without_drift():
    for inertia, level in ((0.35, 30.0), (0.005, 0.03), (0.35, 0.5)):
        q, v, z = 0.0, 0.0, 0.0
        record = []
        for _ in range(4000):
            z, v, _ = friction_step(z, v, Push(0.95 * level, level, 0.0), inertia, 1e-3)
            q += 1e-3 * v
            record.append(q)
        assert np.max(np.abs(record)) <= 1.5 * PRESLIDING_DISPLACEMENT  # a step of 0.95 overshoots once
        assert abs(record[-1] - record[2000]) < 1e-3 * PRESLIDING_DISPLACEMENT
