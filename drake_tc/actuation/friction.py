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
from collections.abc import Callable
from typing import TypeAlias

PRESLIDING_DISPLACEMENT = 1e-4
"""z_s [rad]: travel from rest to full friction; a fifteenth of a 12-bit encoder's step."""


FrictionLaw: TypeAlias = Callable[[float, float, float, float, float], tuple[float, float, float]]
"""(deflection, velocity, thrust, level, damping) to (deflection, velocity, friction torque), as `friction_law` says."""


def friction_law(inertia: float, step: float) -> FrictionLaw:
    """A function that solves (bristle) for one joint and one step.

    Its arguments are the deflection z in [-1, 1]; the velocity v [rad/s]; the thrust, which is the sum of all other
    torques on the joint, the load among them, signed like v [N m]; the level of dry friction in full sliding >= 0
    [N m]; and the damping >= 0 [N m s/rad]. It returns z', v' [rad/s] and the friction torque over the step [N m].

    Args:
        inertia: J that the joint moves [kg m^2]; 0 when it is not known: the friction is then taken at v' = v.
        step: h [s].
    """
    if inertia <= 0.0:

        def carried(z: float, v: float, thrust: float, level: float, damping: float) -> tuple[float, float, float]:
            wound = z + step * v / PRESLIDING_DISPLACEMENT
            wound = -1.0 if wound < -1.0 else (1.0 if wound > 1.0 else wound)
            return wound, v, level * wound + damping * v

        return carried
    gain = step / inertia
    rate = step / PRESLIDING_DISPLACEMENT
    settling = 2.0 * math.sqrt(PRESLIDING_DISPLACEMENT * inertia) / step
    sqrt = math.sqrt

    def solved(z: float, v: float, thrust: float, level: float, damping: float) -> tuple[float, float, float]:
        drag = 1.0 + gain * damping
        free = v + gain * thrust
        stiff = rate / drag
        if level > 0.0:
            stiff *= 1.0 + settling / sqrt(level)
        share = (z + stiff * free) / (1.0 + stiff * gain * level)
        share = -1.0 if share < -1.0 else (1.0 if share > 1.0 else share)
        dry = level * share
        end = (free - gain * dry) / drag
        wound = z + rate * end
        wound = -1.0 if wound < -1.0 else (1.0 if wound > 1.0 else wound)
        return wound, end, dry + damping * end

    return solved
