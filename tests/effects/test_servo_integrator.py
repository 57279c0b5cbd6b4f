"""Which drives can hide an integral action."""

from drake_tc.effects.base import Context
from drake_tc.effects.library import effect


def test_only_a_position_error_says_nothing_of_an_integral_action() -> None:
    integrator = effect("servo_integrator")
    assert integrator.unavailable(Context("position_servo", "torque", frozenset())) is None
    assert "integral action" in integrator.obstacle(Context("current", "torque", frozenset()))
