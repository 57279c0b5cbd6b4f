"""Step responses of drive effects and gears against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.effects.base import Context, JointNumbers, plain_signals
from drake_tc.effects.library import effect

PERIOD = 1e-3


def respond(key: str, parameters: dict[str, float], values: np.ndarray, start: float = 0.0) -> np.ndarray:
    kernel = effect(key).kernel(parameters, PERIOD)
    memory = kernel.start(start, start)
    return np.array([kernel.step(float(x), float(x), 1.0, memory, 0) for x in values])


def test_deadzone_swallows_its_half_width_and_shifts_the_rest():
    values = np.array([-3.0, -0.5, -0.2, 0.0, 0.2, 0.5, 3.0])
    assert_allclose(respond("deadzone", {"deadzone": 0.5}, values), [-2.5, 0, 0, 0, 0, 0, 2.5], atol=1e-15)


def test_saturation_clips():
    assert_allclose(respond("saturation", {"limit": 2.0}, np.array([-5.0, -1.0, 1.0, 5.0])), [-2, -1, 1, 2], atol=0)


def test_delay_of_whole_and_broken_samples_on_a_ramp():
    ramp = np.arange(1, 41) * 0.1
    for delay in (0.0, 1e-3, 3e-3, 4.4e-3, 7.25e-3):
        late = respond("delay.loop", {"delay": delay}, ramp)
        time = np.arange(1, 41) - delay / PERIOD
        assert_allclose(late, 0.1 * np.maximum(time, 0.0), atol=1e-12)  # linear interpolation is exact on a ramp


def test_lag_follows_a_ramp_as_the_first_order_system_does():
    lag = 7e-3
    time = np.arange(1, 60) * PERIOD
    lagged = respond("current_lag", {"lag": lag}, 5.0 * time)
    exact = 5.0 * (time - lag * (1.0 - np.exp(-time / lag)))  # T y' + y = 5 t, y(0) = 0
    assert_allclose(lagged, exact, rtol=1e-9)  # a ramp is linear between samples: exact


def test_integrator_of_a_constant_is_a_ramp():
    steps = respond("servo_integrator", {"integral_rate": 4.0}, np.full(50, 2.0), start=2.0)
    assert_allclose(steps, 2.0 + 4.0 * 2.0 * np.arange(50) * PERIOD, rtol=1e-12)


def test_backlash_passes_nothing_in_its_gap_and_twist_inverts_it():
    gear = effect("backlash")
    parameters = {"backlash": 0.02}
    assert_allclose(gear.transmitted(np.array([-0.0099, 0.0, 0.0099]), parameters), 0.0, atol=0)
    torque = np.array([-3.0, 5.0])
    assert_allclose(gear.transmitted(gear.twist(torque, parameters), parameters), torque, rtol=1e-9)


def test_elasticity_is_a_spring():
    spring = effect("elasticity")
    assert_allclose(spring.transmitted(np.array([-0.1, 0.2]), {"compliance": 1e-3}), [-100.0, 200.0], rtol=1e-12)
    assert_allclose(spring.twist(np.array([50.0]), {"compliance": 1e-3}), [0.05], rtol=1e-12)


def test_size_1_of_friction_that_warms_takes_the_same_share_off_both_frictions():
    """At 1 K above the reference: 1 N m of 3 N m of Coulomb friction, and a third of the viscous friction."""
    numbers = JointNumbers(0.1, viscous=6.0, coulomb=3.0, inertia=0.3, torque=20.0, effort=2.0, speed=2.0, span=1.0)
    v = np.array([-2.0, -0.1, 0.3, 1.5])
    signals = plain_signals(4, {"velocity": v, "direction": np.sign(v), "temperature": np.full(4, 26.0)})
    warm = effect("thermal_friction")
    (unit,) = warm.unit_coefficients(numbers)
    added = warm.columns(signals, {"thermal_rate": 1e-6}) @ unit
    assert_allclose(added, -(3.0 * np.sign(v) + 6.0 * v) / 3.0, rtol=1e-5)  # the rate bends the line by 5e-7


@pytest.mark.parametrize(
    ("key", "size"),
    [
        ("stribeck", 0.4 * 5.0),  # of the Coulomb friction, as a peak at rest
        ("presliding_hysteresis", 0.4 * 5.0),
        ("torque_ripple", 0.2 * 5.0),
        ("effort_bias", 0.2 * 5.0),
        ("cable_spring", 0.1 * 20.0 / 1.5),  # a tenth of the largest torque over the whole travel
        ("quadratic_viscous", 0.2 * 6.0 / 2.0),  # a fifth of the viscous friction at the largest speed
        ("deadzone", 0.05 * 2.0),
        ("saturation", 0.8 * 2.0),
        ("load_dependent_friction", 0.1),
    ],
)
def test_the_size_that_matters_is_a_share_of_what_the_joint_has(key, size):
    numbers = JointNumbers(0.1, viscous=6.0, coulomb=5.0, inertia=0.3, torque=20.0, effort=2.0, speed=2.0, span=1.5)
    context = Context(drive="current", load="torque", recorded=frozenset())
    assert_allclose(effect(key).typical_size(numbers, context), size, rtol=1e-12)
