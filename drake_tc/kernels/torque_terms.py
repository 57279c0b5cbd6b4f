"""What an effect resists a joint's motion with, by the kind of its equation (`torque_equations`).

The equations are put into the choice between them: each as a library of its own would more than double the compilation.
"""

from drake_tc.kernels import torque_equations as of
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linking import inlined
from drake_tc.types import FloatArray

_constant, _stribeck, _power, _quadratic = map(inlined, (of.constant, of.stribeck, of.power, of.quadratic))
_asymmetry, _load_friction, _load_stribeck = map(inlined, (of.asymmetry, of.load_friction, of.load_stribeck))
_friction_wave, _friction_line = map(inlined, (of.friction_wave, of.friction_line))
_thermal, _hysteresis = map(inlined, (of.thermal, of.hysteresis))
_wave, _spring, _pendulum, _load_share = map(inlined, (of.wave, of.spring, of.pendulum, of.load_share))


@helper
def parts_of(
    kind: int, n: FloatArray, q: float, v: float, direction: float, tau: float, celsius: float, z: float
) -> tuple[float, float, float]:
    """Level, damping and rest of one effect; arguments as in `torque_equations`."""
    parts: tuple[float, float, float]
    if kind == of.STRIBECK:
        parts = _stribeck(q, v, direction, tau, celsius, z, n)
    elif kind == of.POWER:
        parts = _power(q, v, direction, tau, celsius, z, n)
    elif kind == of.QUADRATIC:
        parts = _quadratic(q, v, direction, tau, celsius, z, n)
    elif kind == of.ASYMMETRY:
        parts = _asymmetry(q, v, direction, tau, celsius, z, n)
    elif kind == of.LOAD_FRICTION:
        parts = _load_friction(q, v, direction, tau, celsius, z, n)
    elif kind == of.LOAD_STRIBECK:
        parts = _load_stribeck(q, v, direction, tau, celsius, z, n)
    elif kind == of.FRICTION_WAVE:
        parts = _friction_wave(q, v, direction, tau, celsius, z, n)
    elif kind == of.FRICTION_LINE:
        parts = _friction_line(q, v, direction, tau, celsius, z, n)
    elif kind == of.THERMAL:
        parts = _thermal(q, v, direction, tau, celsius, z, n)
    elif kind == of.HYSTERESIS:
        parts = _hysteresis(q, v, direction, tau, celsius, z, n)
    elif kind == of.WAVE:
        parts = _wave(q, v, direction, tau, celsius, z, n)
    elif kind == of.SPRING:
        parts = _spring(q, v, direction, tau, celsius, z, n)
    elif kind == of.PENDULUM:
        parts = _pendulum(q, v, direction, tau, celsius, z, n)
    elif kind == of.LOAD_SHARE:
        parts = _load_share(q, v, direction, tau, celsius, z, n)
    else:
        parts = _constant(q, v, direction, tau, celsius, z, n)
    return parts
