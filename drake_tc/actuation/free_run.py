"""A free run without a diagram: the actuator's own program on a pendulum or a rotor, as fast as a fit needs it.

    v[n+1] = v[n] + h (tau_actuator - m g l sin(q[n] - z) - tau_load)/J,    q[n+1] = q[n] + h v[n+1]

`tau_actuator` comes from `JointProgram`, which the Drake diagram runs too; the step is the plant's, symplectic Euler,
on the inertia of `model_to_simulate`, so that the run has the model's inertia at any step.
"""

import math

import numpy as np

from drake_tc.actuation.half_step import model_to_simulate
from drake_tc.actuation.joint_program import JointInput, JointProgram
from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import Link, PlantSide, Recording, plant_side
from drake_tc.types import FloatArray

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
    program = JointProgram(model, h, total)
    q, v, out = side.start, recording.initial_velocity, np.full(recording.time.size, np.nan)
    memory = program.initial(v)
    low, high = recording.position_span
    centre, limit = 0.5 * (low + high), FARTHEST * max(high - low, 1e-3)
    moment, zero, known = link.gravity_moment, link.zero, recording.pendulum is None
    for k, (command, load, slope, celsius, supply) in enumerate(_inputs(recording, side.load, substeps)):
        out[k] = q
        for n in range(substeps):
            outside = load + n * slope
            tau = outside if known else None
            try:
                now = JointInput(command, q, v, tau, celsius, supply)
                torque = program.step(memory, now, at_tick=True).actuation
                v += h * (torque - moment * math.sin(q - zero) - outside) / total
            except (ArithmeticError, ValueError):  # a number ran away inside the step
                return out
            q += h * v
        if not abs(q - centre) <= limit:
            break
    return out


def _inputs(recording: Recording, load: FloatArray, substeps: int) -> zip:  # type: ignore[type-arg]
    """(command, load, its change in a substep, temperature, supply) of each sample: held, the load linear between."""
    size = recording.time.size
    slope = np.append(np.diff(load), 0.0) / substeps
    warm = np.full(size, 25.0) if recording.temperature is None else recording.temperature
    supply = np.full(size, np.nan) if recording.supply_voltage is None else recording.supply_voltage
    return zip(*(x.tolist() for x in (recording.command, load, slope, warm, supply)), strict=True)
