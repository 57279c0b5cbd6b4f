"""What a free run is given of a recorded run, and the two sides of the model that never enter the plant.

A free run drives a model by the recorded command alone. Its plant is a pendulum or, where the load torque was recorded,
the motor's side of the gear. `recording_of` reads it from the canonical columns of a log. The Drake diagram
of the bench and `drake_tc.actuation.free_run` share this module.

A position loop that is known by its data sheet, around a drive that was identified by its own effort.

Servos of one kind differ in their firmware's gain only. The motor is identified once, with the effort (voltage) as
command, from the runs at all gains; any gain then gives the model of a position servo,

    y = clip(g (q_d - q), -y_max, y_max)   =>   K' = K/g,   and every parameter in efforts is divided by g.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.config.records import Checked, Range
from drake_tc.effects.base import Signals, TransmissionEffect, plain_signals
from drake_tc.effects.unknown_load import PENDULUM, SLIDER, UnknownLoadEffect
from drake_tc.errors import ParamsError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

NEEDS_LOAD = ("load_dependent_friction", "load_stribeck", "directional_efficiency", "backlash", "elasticity")
"""Effects that depend on the torque that the gear passes."""
LEAST_LINK = 1e-3
"""Least inertia of the plant's link over that of the rotor: a fitted inertia of the load may be 0."""
SMALLEST_INERTIA, LARGEST = 1e-15, 1e9
"""Of a link, in SI units."""
SHORTEST = 20
"""A run of fewer samples is not simulated."""
LONGEST = 60.0
"""At most this much of a run is simulated [s]; the report says so when it is cut."""


@dataclass(frozen=True)
class PositionLoop:
    """A proportional firmware law.

    Attributes:
        gain: g [effort/rad], > 0.
        limit: y_max [effort], > 0; infinite where there is none.

    Raises:
        ParamsError: a value that is not positive.
    """

    gain: float
    limit: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise ParamsError(f"position loop: expected a positive gain [effort/rad], got {self.gain!r}")
        if not self.limit > 0.0:
            raise ParamsError(f"position loop: expected a positive limit [effort], got {self.limit!r}")


def through_loop(model: ActuatorModel, loop: PositionLoop) -> ActuatorModel:
    """The position servo that `loop` makes of a current or voltage drive; the loop clips before any drive effect.

    Args:
        model: Identified with the effort as command.
        loop: The firmware's law.

    Raises:
        ParamsError: the model is a position servo already.
    """
    if model.drive.kind == "position_servo":
        raise ParamsError(f"joint {model.joint!r}: expected a current or voltage drive to put in a loop, got a servo")
    scaled = tuple(_scaled(value, loop.gain) for value in model.effects)
    clip = (EffectValue("saturation", {"limit": loop.limit / loop.gain}),) if math.isfinite(loop.limit) else ()
    return replace(model, drive=Drive("position_servo", model.drive.gain / loop.gain), effects=(*clip, *scaled))


def _scaled(value: EffectValue, gain: float) -> EffectValue:
    units = {p.name: p.unit for p in value.effect.parameters}
    per = {name: gain if units[name].startswith("effort") else 1.0 for name in value.parameters}
    numbers = {name: number / per[name] for name, number in value.parameters.items()}
    intervals = {name: (low / per[name], high / per[name]) for name, (low, high) in value.ci95.items()}
    return replace(value, parameters=numbers, ci95=intervals)


@dataclass(frozen=True)
class Link(Checked):
    """What the joint carries.

    Attributes:
        inertia: About the axis [kg m^2].
        gravity_moment: m g l [N m].
        zero: Position at which it hangs [rad].
    """

    inertia: Annotated[float, Range(f"a number from {SMALLEST_INERTIA:g} to {LARGEST:g}", SMALLEST_INERTIA, LARGEST)]
    gravity_moment: Annotated[float, Range(f"a number from 0 to {LARGEST:g}", 0.0, LARGEST)] = 0.0
    zero: Annotated[float, Range(f"an angle from {-LARGEST:g} to {LARGEST:g}", -LARGEST, LARGEST)] = 0.0


@dataclass(frozen=True)
class Recording:
    """What a free run is given; (T,) arrays on one uniform clock.

    Attributes:
        time: [s].
        command: q_d [rad], i [A] or V [V]; q_d with a `loop`.
        initial_position, initial_velocity: As recorded at the first sample [rad, rad/s].
        position_span: (lowest, highest) recorded position [rad]; beyond 10 times it the run has diverged.
        load_torque: Recorded link-side torque [N m]; None when the load is `pendulum`. With a pendulum: torque on the
            link from outside is -load_torque.
        pendulum: Inertia and gravity moment of the link; None when the load is recorded.
        temperature: [deg C]; None: 25.
        supply_voltage: Of the drive [V]; None: its nominal one.
        loop: Known position loop through which the command reaches a current or voltage drive; None: there is none.
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
    loop: PositionLoop | None = None

    @property
    def period(self) -> float:
        """Of the clock [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)

    def thinned(self, stride: int) -> "Recording":
        """Every `stride`-th sample."""
        names = ("time", "command", "load_torque", "temperature", "supply_voltage")
        arrays = {name: getattr(self, name) for name in names}
        taken: dict[str, Any] = {name: None if v is None else v[::stride] for name, v in arrays.items()}
        return replace(self, **taken)


@dataclass(frozen=True)
class PlantSide:
    """A model and a recording as the plant has them.

    Attributes:
        model: The actuator. Where the load is recorded its gear is stiff: the plant is the motor's side.
        load: (T,) true torque on the joint besides the pendulum [N m]; 0 where none was recorded.
        lead: (T,) of the plant's joint over the link [rad], by the twist of the gear under a recorded load.
        start: Position of the plant's joint at the first sample [rad].
        signals: True signals at the start's position, for the sensors.
    """

    model: ActuatorModel
    load: FloatArray
    lead: FloatArray
    start: float
    signals: Signals

    def shown(self, position: FloatArray) -> FloatArray:
        """What the rig's encoder would have shown (T,) [rad] of the plant's joint at `position` (T,) [rad]."""
        seen = replace(self.signals, position=position - self.lead)
        for effect, parameters in self.model.sensor_effects:
            seen = effect.corrupt(seen, parameters)
        return np.asarray(seen.position)


def plant_side(model: ActuatorModel, recording: Recording) -> PlantSide:
    """Sensor effects taken off the recorded load and start, and the gear's twist under a recorded load.

    Raises:
        ParamsError: nothing that has inertia, no load, or arrays that do not fit.
    """
    _check(model, recording)
    size = recording.time.size
    time = np.asarray(np.arange(size) * recording.period, dtype=np.float64)
    load = np.zeros(size) if recording.load_torque is None else recording.load_torque
    known = {"time": time, "position": np.full(size, recording.initial_position), "load_torque": load}
    true = replace(plain_signals(size, known), period=recording.period)
    for effect, parameters in reversed(model.sensor_effects):
        true = effect.restore(true, parameters)
    lead = np.zeros(size)
    if recording.pendulum is None:
        for gear, parameters in model.transmission_effects:
            lead += gear.twist(true.load_torque, parameters)
        stiff = tuple(value for value in model.effects if not isinstance(value.effect, TransmissionEffect))
        model = replace(model, effects=stiff)
    load = true.load_torque if recording.load_torque is not None else np.zeros(size)
    return PlantSide(model, load, lead, float(true.position[0] + lead[0]), true)


def _check(model: ActuatorModel, recording: Recording) -> None:
    size = recording.time.size
    if size < 2:
        raise ParamsError(f"free run: expected at least 2 samples, got {size}")
    for name in ("command", "load_torque", "temperature", "supply_voltage"):
        values = getattr(recording, name)
        if values is not None and values.shape != (size,):
            raise ParamsError(f"free run: expected {name} of shape ({size},), got {values.shape}")
    if recording.load_torque is None and recording.pendulum is None:
        raise ParamsError("free run: expected a load: load_torque or pendulum, got neither")
    if recording.pendulum is None and model.inertia <= 0.0:
        raise ParamsError(f"free run: joint {model.joint!r} has no inertia; expected rotor_inertia > 0 or a pendulum")


def in_plant(model: ActuatorModel, recording: Recording) -> tuple[ActuatorModel, Recording] | None:
    """(actuator, recording) as the plant has them: the drive in its position loop, an unknown load in its place.

    Of an unknown load, a pendulum or a mass that slides leaves the actuator and becomes the plant's link, so that the
    gear passes its torque.
    A smooth load stays with the actuator, and the plant is the motor's side without a link. None where another effect
    depends on the torque that the gear passes, which would then lack the load, and where nothing has inertia.
    """
    if recording.loop is not None:
        model, recording = through_loop(model, recording.loop), replace(recording, loop=None)
    value = next((v for v in model.effects if isinstance(v.effect, UnknownLoadEffect)), None)
    if value is None:
        return model, recording
    size = recording.time.size
    others = tuple(v for v in model.effects if v is not value)
    if value.effect not in (PENDULUM, SLIDER):
        needs = any(v.effect.id in NEEDS_LOAD for v in others)
        return None if needs else (model, replace(recording, load_torque=np.zeros(size)))
    actuator = replace(model, effects=others)
    given = value.parameters
    inertia = max(given["inertia"], LEAST_LINK * actuator.inertia)
    if inertia < SMALLEST_INERTIA:
        return None
    link = Link(inertia, given.get("moment", 0.0), given.get("zero", 0.0))
    return actuator, replace(recording, load_torque=np.full(size, given["constant"]), pendulum=link)


def longest_stretch(run: Run, longest: float = LONGEST) -> slice | None:
    """The longest usable stretch of a run, its first `longest` [s]; None where it is too short."""
    stretch = max(run.segments(), key=lambda s: s.stop - s.start, default=slice(0, 0))
    stretch = slice(stretch.start, min(stretch.stop, stretch.start + round(longest / run.period)))
    return stretch if stretch.stop - stretch.start >= SHORTEST else None


def loop_of(rig: Rig, joint: str, run: Run) -> PositionLoop | None:
    """The position loop around a current or voltage drive, where the run has its gain and the position command."""
    gain = run.columns.get(f"{joint}/position_gain")
    if rig.drive[joint] == "position_servo" or gain is None or f"{joint}/position_command" not in run.columns:
        return None
    value = float(np.median(gain))
    return PositionLoop(value, rig.saturation.get(joint, np.inf)) if value > 0.0 else None


def recording_of(rig: Rig, joint: str, run: Run, stretch: slice) -> Recording:
    """What a free run over one stretch of a run is given; the load of a rig that does not know it stays open."""
    q = run.columns[f"{joint}/position"][stretch]
    loop = loop_of(rig, joint, run)
    command = rig.command_column(joint) if loop is None else f"{joint}/position_command"
    kernel = CommonKernel(max(0.02, 5.0 * run.period), run.period)
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        load = load.in_run(run)
    channels = ("temperature", "supply_voltage", "torque")
    warm, supply, torque = (run.columns.get(f"{joint}/{channel}") for channel in channels)
    known = Link(load.inertia, load.weight, load.zero) if isinstance(load, Pendulum) else None
    return Recording(
        time=run.time[stretch] - run.time[stretch.start],
        command=run.columns[command][stretch],
        initial_position=float(q[0]),
        initial_velocity=float(kernel.derivative(q)[0]),
        position_span=(float(q.min()), float(q.max())),
        load_torque=None if known is not None or torque is None else np.asarray(kernel.smooth(torque[stretch])),
        pendulum=known,
        temperature=None if warm is None else warm[stretch],
        supply_voltage=None if supply is None else supply[stretch],
        loop=loop,
    )
