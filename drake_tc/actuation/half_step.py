"""The half step between a sampled simulation and the continuous joint that its log is read as.

A plant that steps by symplectic Euler, with friction at the end of the step, obeys with its step h

    J (v[n+1] - v[n])/h + f_v v[n+1] + ... = tau[n],      q[n+1] = q[n] + h v[n+1].

The second difference of the positions around q[n] is (v[n+1] - v[n])/h, their central difference (v[n] + v[n+1])/2. In
these,

    (J + f_v h/2) qddot + f_v qdot + ... = tau[n]:

the log looks like that of a joint with a larger inertia. This holds for commands that change at every step; one that is
held for several steps makes the acceleration a saw tooth, of which a log at the command's own ticks sees the peaks.
"""

from dataclasses import replace

from drake_tc.actuation.constant_parts import split_parts
from drake_tc.actuation.model import ActuatorModel, EffectValue

_ROTOR = "rotor_inertia"


def simulated_inertia(model: ActuatorModel, step: float) -> float:
    """J + f_v h/2 [kg m^2]: the reflected inertia that a log shows which was simulated with this step.

    Declare it in the rig file of such a log. Of friction, the parts count whose damping is constant.

    Args:
        model: The simulated actuator.
        step: h of plant and actuators [s].
    """
    (_, damping, _), _ = split_parts(model)
    return model.inertia + 0.5 * step * damping


def for_step(model: ActuatorModel, step: float) -> ActuatorModel:
    """The model to simulate with this step, so that the log shows the given model: J - f_v h/2, but not below 0.

    A model without rotor inertia stays as it is, as one with a soft or loose gear, whose motor is integrated otherwise.

    Args:
        model: What the log is to show.
        step: h of plant and actuators [s].
    """
    added = simulated_inertia(model, step) - model.inertia
    if model.transmission_effects or not added:
        return model

    def lowered(value: EffectValue) -> EffectValue:
        if value.key != _ROTOR:
            return value
        return EffectValue(_ROTOR, {_ROTOR: max(0.0, value.parameters[_ROTOR] - added)})

    return replace(model, effects=tuple(lowered(value) for value in model.effects))
