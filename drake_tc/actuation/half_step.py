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

from drake_tc.actuation.model import ActuatorModel, EffectValue, split_parts
from drake_tc.effects.base import TorqueEffect


def simulated_inertia(model: ActuatorModel, step: float) -> float:
    """J + f_v h/2 [kg m^2]: the reflected inertia that a log shows which was simulated with this step.

    Declare it in the rig file of such a log. Of friction, the parts count whose damping is constant.

    Args:
        model: The simulated actuator.
        step: h of plant and actuators [s].

    Example:
        >>> viscous = EffectValue("viscous", {"viscous": 30.0})
        >>> simulated_inertia(ActuatorModel("knee", Drive("current", 0.4), (viscous,)), step=1e-3)
        0.015
    """
    (_, damping, _), _ = split_parts(model)
    return model.inertia + 0.5 * step * damping


def model_to_simulate(model: ActuatorModel, step: float) -> ActuatorModel:
    """The model with J - f_v h/2 [kg m^2] in place of J: simulated with this step, its log shows J.

    J is the sum of all inertias of the model: of the rotor, of a payload and of an unknown load. Each of them is
    multiplied by the same factor.

    Of a constant torque, velocity then decays by (J - f_v h/2)/(J + f_v h/2) in a step, which is the trapezoidal rule
    on J. A step so long that less than half of J would be left gets J/2: it cannot show this friction.

    Args:
        model: The actuator that a log shall show.
        step: h of plant and actuators [s].

    Example:
        >>> values = {"viscous": 32.0}, {"rotor_inertia": 0.31}
        >>> effects = tuple(EffectValue(name, {name: value}) for each in values for name, value in each.items())
        >>> model_to_simulate(ActuatorModel("knee", Drive("current", 0.4), effects), step=5e-4).inertia
        0.302
    """
    excess = min(simulated_inertia(model, step) - model.inertia, 0.5 * model.inertia)
    if excess <= 0.0:
        return model
    factor = 1.0 - excess / model.inertia
    return replace(model, effects=tuple(_with_inertia(value, factor) for value in model.effects))


def _with_inertia(value: EffectValue, factor: float) -> EffectValue:
    """The effect with its inertia multiplied by the factor."""
    name = value.effect.inertia_parameter if isinstance(value.effect, TorqueEffect) else ""
    if not name:
        return value
    return replace(value, parameters={**value.parameters, name: factor * value.parameters[name]})
