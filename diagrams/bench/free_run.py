"""Free run: the Drake diagram of a joint driven by a recorded command alone, next to what was recorded.

The load is the recorded torque (rig with a torque column: the plant is the rotor) or the pendulum's own gravity and
inertia (the plant carries them). No recorded motion enters after the first sample.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from drake_tc.diagrams.bench.diagram import Bench, Link, Rates, Table, build_bench, start_bench

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.effects.base import TransmissionEffect, plain_signals
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

CHUNK = 0.25
"""A run is checked for divergence this often [s]."""
FINEST, COARSEST = 4e-4, 1e-3
"""The steps that are worth their time [s]: a faster log is thinned, a slower one gets substeps."""
RESOLUTION = 0.3
"""Largest product of the step and a servo's angular frequency."""
RUNAWAY = 10.0
"""A run that leaves the recorded span by this factor has diverged."""


@dataclass(frozen=True)
class Recording:
    """What a free run is given; (T,) arrays on one uniform clock.

    Attributes:
        time: [s].
        command: q_d [rad], i [A] or V [V].
        initial_position, initial_velocity: As recorded at the first sample [rad, rad/s].
        position_span: (lowest, highest) recorded position [rad]; beyond 10 times it the run has diverged.
        load_torque: Recorded link-side torque [N m]; None when the load is `pendulum`. With a pendulum: torque on the
            link from outside is -load_torque.
        pendulum: Inertia and gravity moment of the link; None when the load is recorded.
        temperature: [deg C]; None: 25.
        supply_voltage: Of the drive [V]; None: its nominal one.
    """

    time: FloatArray
    command: FloatArray
    initial_position: float
    initial_velocity: float
    position_span: tuple[float, float]
    load_torque: FloatArray | None = None
    pendulum: Link | None = None
    temperature: FloatArray | None = None
    supply_voltage: FloatArray | None = None


def _with_inertia(model: ActuatorModel, rotor_inertia: float | None) -> ActuatorModel:
    if rotor_inertia is None or any(value.effect.id == "rotor_inertia" for value in model.effects):
        return model
    declared = EffectValue("rotor_inertia", {"rotor_inertia": rotor_inertia})
    return replace(model, effects=(declared, *model.effects))


def free_run(
    model: ActuatorModel, recording: Recording, *, rotor_inertia: float | None = None, substeps: int | None = None
) -> FloatArray:
    """Position (T,) [rad], as the rig's encoder would have shown it; NaN from where the run has diverged.

    Args:
        model: The actuator; its sensor effects are taken off the recorded load and put on the simulated position.
        recording: The run.
        rotor_inertia: Declared J [kg m^2], for a model that does not list it.
        substeps: Steps of plant and actuator in one sample; None chooses them by the rate of the log and the stiffness
            of the servo, and simulates only every k-th sample of a log faster than `FINEST` (linear between them).

    Raises:
        ParamsError: nothing that has inertia, neither or both loads, or arrays that do not fit.
    """
    model = _with_inertia(model, rotor_inertia)
    size = recording.time.size
    _check(model, recording, substeps)
    period = float(recording.time[-1] - recording.time[0]) / (size - 1)
    if substeps is None:
        stride = max(1, int(FINEST / period + 1e-9))
        if stride > 1 and size > stride:
            thin = _thinned(recording, stride)
            rough = free_run(model, thin)
            return np.asarray(np.interp(recording.time, thin.time, rough))
        substeps = _substeps(model, recording, period)
    time = np.asarray(np.arange(size) * period, dtype=np.float64)
    load = np.zeros(size) if recording.load_torque is None else recording.load_torque
    known = {"time": time, "position": np.full(size, recording.initial_position), "load_torque": load}
    true = replace(plain_signals(size, known), period=period)
    for effect, parameters in reversed(model.sensor_effects):
        true = effect.restore(true, parameters)
    bench, lead = _bench(model, recording, time, true.load_torque, period / substeps)
    start = float(true.position[0] + lead[0])
    low, high = recording.position_span
    limit = RUNAWAY * max(high - low, 1e-3)
    position = _run(bench, (start, recording.initial_velocity), (0.5 * (low + high), limit), time) - lead
    shown = replace(true, position=position)
    for effect, parameters in model.sensor_effects:
        shown = effect.corrupt(shown, parameters)
    return np.asarray(shown.position)


def _thinned(recording: Recording, stride: int) -> Recording:
    """Every `stride`-th sample."""
    arrays: dict[str, Any] = {
        name: None if (values := getattr(recording, name)) is None else values[::stride]
        for name in ("time", "command", "load_torque", "temperature", "supply_voltage")
    }
    return replace(recording, **arrays)


def _substeps(model: ActuatorModel, recording: Recording, period: float) -> int:
    """Enough for `COARSEST`, and for a position servo's own oscillation."""
    wanted = period / COARSEST
    if model.drive.kind == "position_servo":
        inertia = model.inertia + (recording.pendulum.inertia if recording.pendulum else 0.0)
        wanted = max(wanted, period / np.sqrt(model.drive.gain * inertia) / RESOLUTION)
    return int(np.clip(np.ceil(wanted - 1e-6), 1, 60))


def _check(model: ActuatorModel, recording: Recording, substeps: int | None) -> None:
    size = recording.time.size
    if size < 2 or (substeps is not None and substeps < 1):
        raise ParamsError(f"free run: wanted at least 2 samples and 1 substep; got {size} and {substeps}")
    for name in ("command", "load_torque", "temperature", "supply_voltage"):
        values = getattr(recording, name)
        if values is not None and values.shape != (size,):
            raise ParamsError(f"free run: wanted {name} of shape ({size},); got {values.shape}")
    if recording.load_torque is None and recording.pendulum is None:
        raise ParamsError("free run: wanted a load: load_torque or pendulum; got neither")
    if recording.pendulum is None and model.inertia <= 0.0:
        raise ParamsError(f"free run: joint {model.joint!r} has no inertia; wanted rotor_inertia > 0 or a pendulum")


def _bench(
    model: ActuatorModel, recording: Recording, time: FloatArray, load: FloatArray, step: float
) -> tuple[Bench, FloatArray]:
    """The diagram, and the lead (T,) [rad] of its joint over the position that was recorded.

    Where the load is recorded, it is what the gear passes: the plant is then the motor's side, and the link follows
    it by the gear's twist under that load.
    """
    rates = Rates(step, float(time[1] - time[0]))
    command = recording.command
    around = {"temperature": recording.temperature, "supply_voltage": recording.supply_voltage}
    if recording.pendulum is not None:
        applied = None if recording.load_torque is None else -load
        table = Table(time, command, applied=applied, **around)
        return build_bench(model, recording.pendulum, table, rates, None), np.zeros_like(time)
    lead = np.zeros_like(time)
    for effect, parameters in model.transmission_effects:
        lead += effect.twist(load, parameters)
    stiff = tuple(value for value in model.effects if not isinstance(value.effect, TransmissionEffect))
    table = Table(time, command, applied=-load, load_torque=load, **around)
    rotor = Link(inertia=1e-6 * model.inertia)
    return build_bench(replace(model, effects=stiff), rotor, table, rates, None), lead


def _run(bench: Bench, start: tuple[float, float], bounds: tuple[float, float], time: FloatArray) -> FloatArray:
    """Simulated position at `time`, NaN from the first sample out of centre +/- limit on."""
    simulator = start_bench(bench, *start)
    context = simulator.get_context()
    centre, limit = bounds
    position = np.full(time.size, np.nan)
    end = 0.0
    while end < time[-1]:
        end = min(end + CHUNK, float(time[-1]))
        try:
            simulator.AdvanceTo(end)
        except (RuntimeError, ArithmeticError, ValueError):  # numbers that ran away inside the chunk: seen below
            break
        angle = bench.plant.GetPositions(bench.plant.GetMyContextFromRoot(context))[0]
        if not abs(angle - centre) <= limit:
            break
    log = np.asarray(bench.state_log.FindLog(context).data()[0])[: time.size]
    position[: log.size] = log
    lost = np.flatnonzero(~(np.abs(log - centre) <= limit))
    if lost.size:
        position[lost[0] :] = np.nan
    return position
