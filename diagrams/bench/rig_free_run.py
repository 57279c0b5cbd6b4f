"""Free run of a recorded run: from a rig's canonical columns to the Drake diagram and back."""

import math
from dataclasses import replace

import numpy as np
from drake_tc.diagrams.bench.diagram import Link
from drake_tc.diagrams.bench.free_run import Recording, free_run

from drake_tc.actuation.model import ActuatorModel
from drake_tc.effects.unknown_load import PENDULUM, UnknownLoadEffect
from drake_tc.errors import ParamsError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import Pendulum, unknown_form
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

NEEDS_LOAD = ("load_dependent_friction", "load_stribeck", "directional_efficiency", "backlash", "elasticity")
"""Effects that depend on the torque that the gear passes."""
LEAST_LINK = 1e-3
"""Least inertia of the plant's link over that of the rotor: a fitted inertia of the load may be 0."""
LONGEST = 60.0
"""At most this much of a run is simulated [s]; the report says so when it is cut."""
LONGEST_STEP = 1.5e-3
"""Logs on slower clocks are simulated in several steps a sample [s]; the command is held between them."""


def rig_free_run(
    model: ActuatorModel, rig: Rig, joint: str, run: Run, longest: float = LONGEST
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """(time, recorded, simulated position), (T,) each, over the longest usable stretch of `run` up to `longest` [s].

    None where the model has no inertia that a free run could move, or where a load that is a curve over the position
    meets an effect that depends on the load (`load_in_bench`). A diverged run is NaN from there on.
    """
    stretch = max(run.segments(), key=lambda s: s.stop - s.start)
    stretch = slice(stretch.start, min(stretch.stop, stretch.start + round(longest / run.period)))
    q = run.columns[f"{joint}/position"][stretch]
    if q.size < 20:
        return None
    kernel = CommonKernel(max(0.02, 5.0 * run.period), run.period)
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        load = load.in_run(run)
    zero = load.zero if isinstance(load, Pendulum) else 0.0
    command = run.columns[rig.command_column(joint)][stretch]
    warm, supply = (run.columns.get(f"{joint}/{channel}") for channel in ("temperature", "supply_voltage"))
    torque = run.columns.get(f"{joint}/torque")
    known = Link(load.inertia, load.weight) if isinstance(load, Pendulum) else None
    measured = None if known is not None or torque is None else kernel.smooth(torque[stretch])
    if unknown_form(load) is not None:
        placed = load_in_bench(model)
        if placed is None:
            return None
        model, known, constant = placed
        measured = np.full(q.size, constant)
    recording = Recording(
        time=run.time[stretch] - run.time[stretch.start],
        command=command - zero if rig.drive[joint] == "position_servo" else command,
        initial_position=float(q[0]) - zero,
        initial_velocity=float(kernel.derivative(q)[0]),
        position_span=(float(q.min()) - zero, float(q.max()) - zero),
        load_torque=measured,
        pendulum=known,
        temperature=None if warm is None else warm[stretch],
        supply_voltage=None if supply is None else supply[stretch],
    )
    try:
        simulated = free_run(model, recording, substeps=max(1, math.ceil(run.period / LONGEST_STEP - 1e-9)))
    except ParamsError:
        return None
    return np.asarray(run.time[stretch] - run.time[0]), q, simulated + zero


def load_in_bench(model: ActuatorModel) -> tuple[ActuatorModel, Link | None, float] | None:
    """(model of the actuator, link of the plant, constant torque on it [N m]) of a model that lists an unknown load.

    A pendulum leaves the actuator and becomes the plant's link, so that the gear passes its torque. A smooth load stays
    with the actuator, and the plant is the motor's side without a link; None where another effect depends on the torque
    that the gear passes, which would then lack the load.
    """
    value = next((v for v in model.effects if isinstance(v.effect, UnknownLoadEffect)), None)
    if value is None:
        return None
    others = tuple(v for v in model.effects if v is not value)
    if value.effect is not PENDULUM:
        return None if any(v.effect.id in NEEDS_LOAD for v in others) else (model, None, 0.0)
    actuator = replace(model, effects=others)
    given = value.parameters
    inertia = max(given["inertia"], LEAST_LINK * actuator.inertia)
    link = Link(inertia, given["moment"], given["zero"])
    return (actuator, link, given["constant"]) if inertia > 0.0 else None
