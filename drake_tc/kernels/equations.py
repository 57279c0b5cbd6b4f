"""Equations on plain functions, each once: on arrays for a log, on numbers at one instant, and compiled.

Functions without a decorator, which call no other: `drake_tc.effects` uses them as they stand, and modules of kernels
compile them (`compiling.helper`). Effort y and width, limit in the drive's effort [rad | A | V | N m]; direction d in
[-1, 1]; memories are sequences of numbers of which an effect has those from `at` on.

`friction_step`: dry and viscous friction over one step, solved implicitly so that it can hold, and never pushes.

Dry friction is a bristle, an elastic-perfectly-plastic (Prandtl) element: it is wound up by the motion and slides at
full deflection,

    z' = clip(z + (q' - q)/z_s, -1, 1),      friction = level clip(z' + t_b zdot, -1, 1) + damping v',     (bristle)

with z_s = `PRESLIDING_DISPLACEMENT`, zdot = (z' - z)/h before z' is clipped. The clip is the exact integral of the
element over any step without reversal. t_b = 2 sqrt(z_s J/level) damps the joint on its bristle critically: it comes
to rest without ringing. The outer clip keeps dry friction at or below its level.
Both parts are taken at the *end* of the step, q' = q + h v', as a plant that steps by symplectic Euler has it:

    v' = v + (h/J) (thrust - friction).

The equation is monotone, so it has one solution, in closed form. As level z' (q' - q) >= level z_s (z'^2 - z^2)/2
for every step, friction gives back no more than its bristle has stored: level z_s/2, 0.05 mJ for each N m.

Source: Dahl (1968) and the elasto-plastic reading of Dupont et al. (2002); the deflection of the bristle is what
`Signals.direction` is in simulation.

`step_at` and those after it are references at one instant, for loops in which an array of one sample costs more than
its numbers. Their numbers are those of `drake_tc.control.references` for many samples, to rounding; they take powers by
`math.pow`, as a compiled `**` multiplies.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.types import FloatArray

_LEAST = 1e-200
"""Stands for a width of 0: below any width, and far from underflow."""


def soft_sign(value: Any, width: Any) -> Any:
    """clip(value/width, -1, 1); the sign for width 0."""
    return np.sign(value) * np.minimum(np.abs(value) / np.maximum(width, _LEAST), 1.0)


def dead_zone(effort: Any, width: Any) -> Any:
    """sign(y) max(|y| - w, 0)."""
    return np.sign(effort) * np.maximum(np.abs(effort) - width, 0.0)


def dead_zone_inverse(effort: Any, width: Any, smoothing: Any) -> Any:
    """Y + w clip(y/delta, -1, 1); y + w sign(y) for delta 0."""
    return effort + width * (np.sign(effort) * np.minimum(np.abs(effort) / np.maximum(smoothing, _LEAST), 1.0))


def switched(value: Any, effort: Any, direction: Any, switch: Any) -> Any:
    """What passes the other effects and s d y of the raw effort."""
    return value + switch * direction * effort


def switch_inverse(effort: Any, direction: Any, switch: Any) -> Any:
    """y/(1 + s d); y itself where the drive is dead."""
    gain = 1.0 + switch * direction
    dead = np.abs(gain) <= 1e-6
    return effort / (gain * (1.0 - dead) + dead)


def saturated(effort: Any, limit: Any) -> Any:
    """clip(y, -L, L)."""
    return np.minimum(np.maximum(effort, -limit), limit)


def delayed(value: float, whole: int, part: float, memory: Any, at: int) -> float:
    """The value `whole` + `part` samples ago; memory is the place of the newest in a ring of `whole` + 2, and that."""
    length = whole + 2
    newest = (int(memory[at]) + 1) % length
    memory[at] = float(newest)
    memory[at + 1 + newest] = value
    late = memory[at + 1 + (newest - whole) % length]
    return (1.0 - part) * late + part * memory[at + 1 + (newest - whole - 1) % length]  # type: ignore[no-any-return]


def lagged(value: float, numbers: Any, memory: Any, at: int) -> float:
    """y*[n] = p y*[n-1] + b0 y[n] + b1 y[n-1]; numbers are p, b0 and b1, memory is [y*, y]."""
    passed = numbers[0] * memory[at] + numbers[1] * value + numbers[2] * memory[at + 1]
    memory[at], memory[at + 1] = passed, value
    return passed  # type: ignore[no-any-return]


def integrated(value: float, effort: float, numbers: Any, memory: Any, at: int) -> float:
    """Value + K_i int y dt by trapezoids; numbers are K_i and half of the period, memory is [integral, last effort]."""
    integral = memory[at] + numbers[1] * (effort + memory[at + 1])
    memory[at], memory[at + 1] = integral, effort
    return value + numbers[0] * integral  # type: ignore[no-any-return]


def gear_torque(twist: float, rate: float, half_gap: float, compliance: float, contact_time: float) -> float:
    """What a gear passes [N m] when the motor leads by `twist` [rad] and gains on the link by `rate` [rad/s].

    Args:
        twist: theta - q [rad].
        rate: Its derivative [rad/s].
        half_gap: b/2 [rad].
        compliance: c [rad/(N m)].
        contact_time: t_d [s].
    """
    pressed = twist - min(max(twist, -half_gap), half_gap)
    if half_gap > 0.0 and pressed == 0.0:
        return 0.0
    tau = (pressed + contact_time * rate) / compliance
    return 0.0 if half_gap > 0.0 and tau * pressed < 0.0 else tau


def needed_torque(tau: float, velocity: float, direction: float, parts: Any) -> float:
    """Drive torque for a link torque at constant speed [N m]: tau + level d + damping v + rest; parts (3,)."""
    needed: float = tau + parts[0] * direction + parts[1] * velocity + parts[2]
    return needed


PRESLIDING_DISPLACEMENT = 1e-4
"""z_s [rad]: travel from rest to full friction; a fifteenth of a 12-bit encoder's step."""


def turned_over(state: float, moved: float, travel: float) -> float:
    """A hysteretic state in [-1, 1] after a motion of `moved` [rad] that turns it over in `travel` [rad]."""
    sign = math.copysign(1.0, moved)
    return sign - (sign - state) * math.exp(-abs(moved) / travel)


def wound_up(deflection: float, moved: float) -> float:
    """The bristle's deflection z after a motion [rad]: clip(z + moved/z_s, -1, 1)."""
    return min(max(deflection + moved / PRESLIDING_DISPLACEMENT, -1.0), 1.0)


class Push(NamedTuple):
    """What acts on a mass over a step.

    Attributes:
        thrust: Sum of all torques but friction, signed like v [N m].
        level: Of dry friction in full sliding, >= 0 [N m].
        damping: Of viscous friction, >= 0 [N m s/rad].
    """

    thrust: float
    level: float
    damping: float


def friction_step(z: float, v: float, push: Push, inertia: float, step: float) -> tuple[float, float, float]:
    """z', v' and the friction torque over a step, the solution of (bristle).

    Args:
        z: Deflection of the bristle in [-1, 1].
        v: [rad/s].
        push: What acts on the joint.
        inertia: J that the joint moves [kg m^2]; 0 where it is not known: friction is then taken at v' = v.
        step: h [s].
    """
    thrust, level, damping = push.thrust, push.level, push.damping
    rate = step / PRESLIDING_DISPLACEMENT
    if inertia <= 0.0:
        wound = z + step * v / PRESLIDING_DISPLACEMENT
        wound = min(max(wound, -1.0), 1.0)
        return wound, v, level * wound + damping * v
    gain = step / inertia
    drag = 1.0 + gain * damping
    free = v + gain * thrust
    stiff = rate / drag
    if level > 0.0:
        stiff *= 1.0 + 2.0 * math.sqrt(PRESLIDING_DISPLACEMENT * inertia) / step / math.sqrt(level)
    share = (z + stiff * free) / (1.0 + stiff * gain * level)
    share = min(max(share, -1.0), 1.0)
    dry = level * share
    end = (free - gain * dry) / drag
    return min(max(z + rate * end, -1.0), 1.0), end, dry + damping * end


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
