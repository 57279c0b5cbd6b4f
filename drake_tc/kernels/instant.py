"""References at one instant on plain floats, for loops in which an array of one sample costs more than its numbers.

The numbers are those of `drake_tc.control.references` for many samples, to rounding. `drake_tc.kernels.sequence`
compiles the same functions; they take powers by `math.pow`, as a compiled `**` multiplies.
"""

import math

from drake_tc.types import FloatArray

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


def step_at(time: float, begin: float, duration: float) -> Triple:
    """`smooth_step` at one time [s]: s(u) and its first two derivatives in time.

    Args:
        time: [s].
        begin: When it starts to rise [s].
        duration: > 0, how long it does [s].
    """
    u = (time - begin) / duration
    if u <= 0.0:
        return 0.0, 0.0, 0.0
    if u >= 1.0:
        return 1.0, 0.0, 0.0
    if u != u:
        return u, u, u
    left = 1.0 - u
    hump = u * left
    value = math.pow(u, 4.0) * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
    second = 420.0 * hump * hump * (1.0 - 2.0 * u)
    return value, 140.0 * math.pow(hump, 3.0) / duration, second / math.pow(duration, 2.0)


def swinging(size: Triple, frequency: float, phase: float) -> Triple:
    """A sin(phase) and its first two derivatives in time.

    Args:
        size: A and its first two derivatives.
        frequency: w, of the phase [rad/s].
        phase: [rad].
    """
    if not math.isfinite(phase):
        return phase * 0.0, phase * 0.0, phase * 0.0
    w, sine, cosine = frequency, math.sin(phase), math.cos(phase)
    a, rate, growth = size
    return a * sine, rate * sine + a * w * cosine, growth * sine + 2.0 * rate * w * cosine - a * math.pow(w, 2.0) * sine


def unit(values: FloatArray | tuple[float, ...]) -> Quadruple:
    """A quaternion [w x y z] of length one, of one that is not zero."""
    w, x, y, z = map(float, values)
    length = math.hypot(w, x, y, z)
    return w / length, x / length, y / length, z / length


def turned(axis: Triple, angle: float, first: Quadruple) -> Quadruple:
    """[w x y z], w >= 0, of exp(angle axis) R.

    Args:
        axis: Of length one, in the world.
        angle: [rad].
        first: Quaternion of R, of length one.
    """
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    x, y, z = s * axis[0], s * axis[1], s * axis[2]
    w0, x0, y0, z0 = first
    w = c * w0 - x * x0 - y * y0 - z * z0
    sign = -1.0 if w < 0.0 else 1.0
    return (
        sign * w,
        sign * (c * x0 + w0 * x + y * z0 - z * y0),
        sign * (c * y0 + w0 * y + z * x0 - x * z0),
        sign * (c * z0 + w0 * z + x * y0 - y * x0),
    )


def orientation_row(axis: Triple, angle: Triple, first: Quadruple) -> list[float]:
    """[quaternion w x y z; omega; alpha] of a turn about an axis that stays.

    Args:
        axis: Of length one, in the world.
        angle: The angle and its first two derivatives in time [rad, rad/s, rad/s^2].
        first: Quaternion at angle 0, of length one.
    """
    x, y, z = axis
    _, rate, growth = angle
    return [*turned(axis, angle[0], first), rate * x, rate * y, rate * z, growth * x, growth * y, growth * z]
