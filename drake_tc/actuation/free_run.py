"""A free run without a diagram: the actuator's own program on a pendulum or a rotor, as fast as a fit needs it.

    v[n+1] = v[n] + h (tau_actuator - m g l sin(q[n] - z) - tau_load)/J,    q[n+1] = q[n] + h v[n+1]

`tau_actuator` comes from the law that the Drake diagram runs too (`drake_tc.actuation.joint_step`); the step is the
plant's, symplectic Euler, on the inertia of `model_to_simulate`, so that the run has the model's inertia at any step.

The half step between a sampled simulation and the continuous joint that its log is read as.

A plant that steps by symplectic Euler, with friction at the end of the step, obeys with its step h

    J (v[n+1] - v[n])/h + f_v v[n+1] + ... = tau[n],      q[n+1] = q[n] + h v[n+1].

The second difference of the positions around q[n] is (v[n+1] - v[n])/h, their central difference (v[n] + v[n+1])/2. In
these,

    (J + f_v h/2) qddot + f_v qdot + ... = tau[n]:

the log looks like that of a joint with a larger inertia. This holds for commands that change at every step; one that is
held for several steps makes the acceleration a saw tooth, of which a log at the command's own ticks sees the peaks.
"""

import math
from dataclasses import replace

import numpy as np

from drake_tc.actuation.joint_effects import JointEffects, tables
from drake_tc.actuation.joint_step import UNCONNECTED, JointInputs, JointStep
from drake_tc.actuation.model import ActuatorModel, EffectValue, split_parts
from drake_tc.actuation.recorded_run import Link, PlantSide, Recording, plant_side
from drake_tc.effects.base import TorqueEffect
from drake_tc.kernels.calls import Kernel
from drake_tc.kernels.joint_layout import OUTPUTS
from drake_tc.kernels.torque_equations import REFERENCE_CELSIUS
from drake_tc.types import FloatArray


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


_POSITIONS = Kernel("actuator", "positions")

RESOLUTION = 0.3
"""Largest product of the step and a servo's angular frequency."""
MOST_SUBSTEPS = 60
FARTHEST = 10.0
"""A run that leaves the recorded span by this factor has diverged."""


def simulate(model: ActuatorModel, recording: Recording, step: float) -> FloatArray:
    """Position (T,) [rad] as the rig's encoder would have shown it; NaN from where the run has diverged.

    Args:
        model: The actuator, as the plant has it (`recorded_run.in_plant`).
        recording: The run.
        step: Largest step of the simulation [s]; a stiff servo gets a smaller one.

    Raises:
        ParamsError: nothing that has inertia, no load, or arrays that do not fit.
    """
    side = plant_side(model, recording)
    link = recording.pendulum or Link(1e-6 * side.model.inertia)
    inertia = link.inertia + side.model.inertia
    requested = recording.period / step
    if model.drive.kind == "position_servo":
        requested = max(requested, recording.period / math.sqrt(model.drive.gain * inertia) / RESOLUTION)
    substeps = min(max(1, math.ceil(requested - 1e-6)), MOST_SUBSTEPS)
    with np.errstate(all="ignore"):
        return side.shown(_positions(side, recording, link, substeps))


def _positions(side: PlantSide, recording: Recording, link: Link, substeps: int) -> FloatArray:
    """Position (T,) [rad] of the plant's joint, NaN from where it has diverged."""
    h = recording.period / substeps
    model = model_to_simulate(side.model, h)
    total = link.inertia if model.transmission_effects else link.inertia + model.inertia
    joint, out = JointEffects(model, h, total), np.full(recording.time.size, np.nan)
    low, high = recording.position_span
    known, limit = recording.pendulum is None, FARTHEST * max(high - low, 1e-3)
    weight = (link.gravity_moment, link.zero, float(known))
    plant = np.array([h, substeps, total, *weight, side.start, recording.initial_velocity, 0.5 * (low + high), limit])
    samples, supply = _inputs(recording, side.load, substeps)
    if not joint.compiled:
        _interpreted(joint, samples, supply, plant, out)
        return out
    memory = joint.initial(recording.initial_velocity)
    start = (side.start, recording.initial_velocity)
    joint.start(memory, float(samples[0, 0]), start, float(samples[0, 1]) if known else math.nan, UNCONNECTED)
    _POSITIONS(samples, tables([joint]), plant, np.array(memory), out)
    return out


def _interpreted(
    joint: JointEffects, samples: FloatArray, supply: FloatArray, plant: FloatArray, out: FloatArray
) -> None:
    """The same recursion step by step, for a joint that has an effect without compiled equation."""
    h, substeps, total, moment, zero, known, q, v, centre, limit = plant.tolist()
    law = JointStep([joint])
    after, kept = np.empty(law.width), law.initial([v])
    asked, state, load = np.empty(1), np.empty(2), np.full(1, np.nan)
    for k, (command, outside, slope, warmth) in enumerate(samples.tolist()):
        out[k], asked[0] = q, command
        inputs = JointInputs(asked, state, load, (np.array([warmth]), supply[k : k + 1]))
        for n in range(int(substeps)):
            loaded = outside + n * slope
            state[:] = q, v
            if known:
                load[0] = loaded
            try:
                law.step(after, kept, inputs, 0.0)
                v += h * (float(after[0]) - moment * math.sin(q - zero) - loaded) / total
            except (ArithmeticError, ValueError):  # a number ran away inside the step
                return
            kept[:-1] = after[OUTPUTS:-1]
            q += h * v
        if not abs(q - centre) <= limit:
            return


def _inputs(recording: Recording, load: FloatArray, substeps: int) -> tuple[FloatArray, FloatArray]:
    """(T, 4) command, load, its change in a substep and temperature, held and linear between; (T,) supply voltage."""
    size = recording.time.size
    slope = np.append(np.diff(load), 0.0) / substeps
    warm = np.full(size, REFERENCE_CELSIUS) if recording.temperature is None else recording.temperature
    supply = np.full(size, np.nan) if recording.supply_voltage is None else recording.supply_voltage
    return np.column_stack((recording.command, load, slope, warm)), np.asarray(supply, dtype=np.float64)
