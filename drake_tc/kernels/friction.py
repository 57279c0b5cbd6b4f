"""Dry and viscous friction over one step, solved implicitly so that it can hold, and never pushes.

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
"""

import math

PRESLIDING_DISPLACEMENT = 1e-4
"""z_s [rad]: travel from rest to full friction; a fifteenth of a 12-bit encoder's step."""


def turned_over(state: float, moved: float, travel: float) -> float:
    """A hysteretic state in [-1, 1] after a motion of `moved` [rad] that turns it over in `travel` [rad]."""
    sign = math.copysign(1.0, moved)
    return sign - (sign - state) * math.exp(-abs(moved) / travel)


def wound_up(deflection: float, moved: float) -> float:
    """The bristle's deflection z after a motion [rad]: clip(z + moved/z_s, -1, 1)."""
    return min(max(deflection + moved / PRESLIDING_DISPLACEMENT, -1.0), 1.0)


def friction_step(
    z: float, v: float, thrust: float, level: float, damping: float, inertia: float, step: float
) -> tuple[float, float, float]:
    """z', v' and the friction torque over a step, the solution of (bristle).

    Args:
        z: Deflection of the bristle in [-1, 1].
        v: [rad/s].
        thrust: Sum of all other torques on the joint, signed like v [N m].
        level: Of dry friction in full sliding, >= 0 [N m].
        damping: >= 0 [N m s/rad].
        inertia: J that the joint moves [kg m^2]; 0 where it is not known: friction is then taken at v' = v.
        step: h [s].
    """
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
