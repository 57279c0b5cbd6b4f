"""What an effect resists a joint's motion with, by the kind of its equation (`torque_equations`).

The equations are put into the choice between them: each as a library of its own would more than double the compilation.
"""

from drake_tc.kernels import torque_equations as of
from drake_tc.kernels.compiling import helper, inlined
from drake_tc.types import FloatArray

_constant, _stribeck, _power, _quadratic = map(inlined, (of.constant, of.stribeck, of.power, of.quadratic))
_asymmetry, _load_friction, _load_stribeck = map(inlined, (of.asymmetry, of.load_friction, of.load_stribeck))
_friction_wave, _friction_line = map(inlined, (of.friction_wave, of.friction_line))
_thermal, _hysteresis = map(inlined, (of.thermal, of.hysteresis))
_wave, _spring, _pendulum, _load_share = map(inlined, (of.wave, of.spring, of.pendulum, of.load_share))


@helper
def parts_of(kind: int, s: of.JointState, n: FloatArray) -> tuple[float, float, float]:
    """Level, damping and rest of one effect, with its numbers n."""
    parts: tuple[float, float, float]
    if kind == of.STRIBECK:
        parts = _stribeck(s, n)
    elif kind == of.POWER:
        parts = _power(s, n)
    elif kind == of.QUADRATIC:
        parts = _quadratic(s, n)
    elif kind == of.ASYMMETRY:
        parts = _asymmetry(s, n)
    elif kind == of.LOAD_FRICTION:
        parts = _load_friction(s, n)
    elif kind == of.LOAD_STRIBECK:
        parts = _load_stribeck(s, n)
    elif kind == of.FRICTION_WAVE:
        parts = _friction_wave(s, n)
    elif kind == of.FRICTION_LINE:
        parts = _friction_line(s, n)
    elif kind == of.THERMAL:
        parts = _thermal(s, n)
    elif kind == of.HYSTERESIS:
        parts = _hysteresis(s, n)
    elif kind == of.WAVE:
        parts = _wave(s, n)
    elif kind == of.SPRING:
        parts = _spring(s, n)
    elif kind == of.PENDULUM:
        parts = _pendulum(s, n)
    elif kind == of.LOAD_SHARE:
        parts = _load_share(s, n)
    else:
        parts = _constant(s, n)
    return parts
