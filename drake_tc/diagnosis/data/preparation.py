"""From recorded runs to `Samples`: every channel of a joint through common filters.

What fixes the scale of the torques of an unknown load is settled here too (`LoadScale`). Without a load torque the
balance  y*/K = J qddot + G(q) + friction  holds for every drive gain K: all torques scale with 1/K. A declared drive
gain fixes the scale, and so does a drive that is commanded in N m. A declared rotor inertia fixes it for a load that
has no inertia of its own, which is a smooth function of the position: J qddot is then a known torque. An unknown
pendulum's inertia adds to J, so J fixes nothing. Where nothing fixes the scale, K is set to 1 effort/(N m) and torques
are told as effort.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drake_tc.diagnosis.data.channels import Channels, aged, channels_of, silent_effort
from drake_tc.diagnosis.data.clocks import between_samples, command_scatter, timing_of_rows, timing_scatter
from drake_tc.diagnosis.data.resolution import LEAST_COVER, NoiseFloor, Resolution, final_widths, light_width
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.data.sensors import encoder_of, resolution_of
from drake_tc.diagnosis.data.sliding import choose_rows, covered, direction_of_motion, require_rows, speed_at_rest
from drake_tc.diagnosis.notes import ScaleNote, ScaleOfRotorInertia, TorqueAsCommanded, TorqueAsEffort
from drake_tc.effects.base import Context, Signals
from drake_tc.effects.context import LoadKind
from drake_tc.estimation.robot_loads import ACCELERATION
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.loads import Load, Pendulum, RobotLoad, unknown_form
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray, IntArray

SLOWER = 3.0
"""Width of the filter of a load torque that effects differentiate, over that of the light kernel."""


def slower(light: CommonKernel) -> CommonKernel:
    """The filter of a load torque that effects differentiate."""
    return CommonKernel(SLOWER * light.actual_width_s, light.period)


def _load(
    channels: Channels, rig: Rig, light: CommonKernel, q: FloatArray, a: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(tau, the same from a slower filter, d tau/dq), (T,) each: measured, a pendulum's, or 0 where unknown."""
    load = rig.load[channels.joint]
    if unknown_form(load) is not None:
        return np.zeros_like(q), np.zeros_like(q), np.zeros_like(q)
    slow = slower(light)
    if not isinstance(load, Pendulum):
        raw = channels.raw("torque")
        return light.smooth(raw), slow.smooth(raw), np.zeros_like(q)
    pendulums = [load.in_run(run) for _, run, _ in channels.pieces]
    lengths = [s.stop - s.start for _, _, s in channels.pieces]
    moment, inertia = (np.repeat(v, lengths) for v in ([p.weight for p in pendulums], [p.inertia for p in pendulums]))
    raw_q = channels.raw("position")
    gravity = moment * np.sin(raw_q - load.zero)
    return (
        light.smooth(gravity) + inertia * a,
        slow.smooth(gravity) + inertia * slow.second_derivative(raw_q),
        moment * np.cos(q - load.zero),
    )


def _width(channels: Channels, rig: Rig, position: FloatArray, noise: float) -> float:
    """Width [s] of the light kernel, for the encoder or the sensor of the velocity, and for the slowest channel."""
    segments, period = channels.segments, channels.period
    slowest = channels.slowest(rig.required_columns(channels.joint))
    if channels.speed_only:
        return light_width(channels.raw("velocity"), noise, segments, period, slowest, order=1)
    return light_width(position, noise, segments, period, slowest)


def _filtered_motion(
    channels: Channels, light: CommonKernel, position: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(q, qdot, qddot), (T,) each; of a speed-only log the rates come from the recorded velocity. Where the links are
    fitted, the acceleration comes from the filters of their columns: another filter would tell a rotor from a link.
    """
    if channels.speed_only:
        raw = channels.raw("velocity")
        return light.smooth(position), light.smooth(raw), light.derivative(raw)
    smoothed = channels.raw(ACCELERATION)
    same = np.isfinite(smoothed).all()
    acceleration = light.smooth(smoothed) if same else light.second_derivative(position)
    return light.smooth(position), light.derivative(position), acceleration


def _signals(
    channels: Channels, rig: Rig, light: CommonKernel, runs: Sequence[Run], raw_command: FloatArray
) -> Signals:
    """Every channel through the light kernel, without direction of motion and travel; `raw_command` as it acts."""
    joint, raw_q = channels.joint, channels.raw("position")
    q, v, a = _filtered_motion(channels, light, raw_q)
    command, load = light.smooth(raw_command), rig.load[joint]
    torque, slow_torque, slope = _load(channels, rig, light, q, a)
    temperature, motor_position, supply = (
        light.smooth(raw) if np.isfinite(raw).any() else raw
        for raw in map(channels.raw, ("temperature", "motor_position", "supply_voltage"))
    )
    return Signals(
        time=channels.time,
        position=q,
        velocity=v,
        acceleration=a,
        load_torque=torque,
        expected_torque=torque,
        slow_torque=slow_torque,
        effort=command - q if rig.drive[joint] == "position_servo" else command,
        command=command,
        direction=np.zeros_like(q),
        travel=np.zeros_like(q),
        load_slope=slope,
        temperature=temperature,
        motor_position=motor_position,
        supply_voltage=supply,
        known_torque=np.zeros_like(q),
        link_inertia=float(np.mean([load.in_run(run).inertia for run in runs])) if isinstance(load, Pendulum) else 0.0,
        rotor_inertia=load_scale(rig, joint).rotor_inertia,
        period=channels.period,
    )


def final_kernel(
    moving: BoolArray, segments: Sequence[slice], light: CommonKernel, widths: Sequence[float]
) -> CommonKernel:
    """The widest of the kernels under which enough of the moving samples stay usable."""
    kernels = [CommonKernel(width, light.period) for width in widths]
    least = LEAST_COVER * covered(moving, segments, kernels[0], light)
    return next(k for k in reversed(kernels) if covered(moving, segments, k, light) >= least)


def build_samples(
    runs: Sequence[Run],
    rig: Rig,
    joint: str,
    width_s: float | None = None,
    final_s: float | None = None,
    at_rest: float = 0.0,
    *,
    effort_age: float = 0.0,
    both_sides: bool = False,
    resolution: Resolution | None = None,
) -> Samples:
    """Filter the runs' channels with common kernels and choose the rows.

    Args:
        runs: Runs on uniform clocks.
        rig: Says drive and load.
        joint: Which joint.
        width_s: Width of the light kernel [s]; None lets the data choose.
        final_s: Width of the final kernel [s]; None lets the data choose.
        at_rest: Filtered velocity that other runs of the joint show at rest [rad/s].
        effort_age: How much older the command or effort that acts is [periods]; `HELD` if held until the next sample,
            negative if it is recorded after it acted.
        both_sides: As in `direction_of_motion`.
        resolution: Of the sensors; None lets the data tell.

    Raises:
        IdentificationError: nothing usable, or the joint does not move long enough at a stretch.
    """
    channels = channels_of(runs, joint)
    period, segments, load = channels.period, channels.segments, rig.load[joint]
    raw_q = channels.raw("position")
    if resolution is None:
        step, noise = encoder_of(channels, rig, raw_q)
        timing = None if channels.speed_only else timing_scatter(raw_q, segments, period, step)
    else:
        step, noise, timing = resolution.position_step, resolution.position_noise, None
    whole_noise = noise if timing is None else float(timing.position_noise(np.array(timing.speed)))
    light = CommonKernel(_width(channels, rig, raw_q, whole_noise) if width_s is None else width_s, period)
    raw_command = channels.raw(rig.command_column(joint).rpartition("/")[2])
    signals = _signals(channels, rig, light, runs, aged(raw_command, segments, effort_age))
    q, v, a = signals.position, signals.velocity, signals.acceleration
    inner = [slice(s.start + light.margin, max(s.stop - light.margin, s.start + light.margin)) for s in segments]
    at_rest = max(at_rest, speed_at_rest(q, v, inner, period))
    servo = rig.drive[joint] == "position_servo"
    if resolution is None:
        scatter = command_scatter(raw_command, segments, period) if servo else 0.0
        resolution = replace(resolution_of(channels, rig, step, noise, light), timing=timing, command_scatter=scatter)
    resolution = replace(resolution, speed_at_rest=at_rest)
    direction, travel, moving = direction_of_motion(
        q, v, inner, resolution, rig.joint_type(joint), both_sides=both_sides
    )
    signals = replace(signals, direction=direction, travel=travel)
    order, raw_noise = (1, resolution.raw_velocity_noise) if channels.speed_only else (2, whole_noise)
    if load == "torque" and "rotor_inertia" not in rig.declared[joint]:
        raw_noise = 0.0  # no inertia is in the balance, and a wider kernel would hide one that is missing
    kept = np.concatenate([a[s] for s in inner if s.stop > s.start] or [a])
    widths = final_widths(kept, raw_noise, light, order=order) if final_s is None else [final_s]
    final = final_kernel(moving, segments, light, widths)
    rows, block = choose_rows(moving, segments, final, light, period)
    moments = None if timing is None else timing_of_rows(timing.time, channels, light, final, v, rows)
    require_rows(rows, moving, resolution, final, f"joint {joint}, {', '.join(r.name for r in runs)}")
    samples = Samples(
        signals=signals,
        segments=segments,
        light=light,
        kernel=final,
        rows=rows,
        run=channels.run_of_sample[rows],
        block=block,
        moving=moving,
        runs=tuple(r.name for r in runs),
        resolution=resolution,
        floor=NoiseFloor.of(resolution, light, final, signals, rows, servo=servo, timing=moments),
        timing=moments,
        between=_between_samples(channels, light, final, rows, load),
        row_period=float(np.median(np.diff(rows))) * period,
        run_of_sample=channels.run_of_sample,
        notes=(*channels.notes(runs), *silent_effort(channels, rig.command_column(joint), raw_command, moving)),
        load_unknown=unknown_form(load) is not None,
        effort_age=effort_age,
        units=replace(rig.units_of(joint), torque_as_effort=load_scale(rig, joint).as_effort),
        effort_period=channels.slowest([rig.command_column(joint)]),
        torque_period=channels.slowest([f"{joint}/torque"]),
    )
    return samples.with_settled_margins()


def _between_samples(
    channels: Channels, light: CommonKernel, final: CommonKernel, rows: IntArray, load: Load
) -> FloatArray | None:
    """(N,) what a measured torque on a slower clock lacks [N m]^2; None where it has the clock of the log."""
    ratios = channels.ratios("torque")
    if load != "torque" or max(ratios) <= 1.0:
        return None
    both = np.convolve(light.kernels[0], final.kernels[0])
    return between_samples(channels.raw("torque"), channels.segments, ratios, both)[rows]


def _slow_channels(signals: Signals, rows: IntArray) -> dict[str, Any]:
    """Fields of `Context` that describe the recorded supply voltage and temperature, where there are such."""
    out: dict[str, Any] = {}
    if signals.has("supply_voltage"):
        supply = signals.supply_voltage[rows]
        out["supply_voltage"] = float(np.nanmedian(supply))
        out["supply_change"] = float(np.nanmax(np.abs(supply - out["supply_voltage"])))
    if signals.has("temperature"):
        warm = signals.temperature[rows]
        out["temperature_span"] = (float(np.nanmin(warm)), float(np.nanmax(warm)))
    return out


def _kind_of(load: Load) -> LoadKind:
    if unknown_form(load) is not None:
        return "unknown"
    if isinstance(load, RobotLoad):
        return "links" if load.fitted else "robot"
    return "pendulum" if isinstance(load, Pendulum) else "torque"


def context_of(samples: Samples, rig: Rig, joint: str) -> Context:
    """What the logs offer to the effects."""
    s = samples.signals
    rows = samples.rows
    recorded = frozenset(n for n in ("temperature", "motor_position", "supply_voltage") if s.has(n))
    declared: Mapping[str, float] = {k: float(v) for k, v in rig.declared[joint].items() if v is not None}
    if joint in rig.drive_gain and not samples.load_unknown:
        declared = {**declared, "drive_gain": rig.drive_gain[joint]}
    low, high = np.percentile(s.effort[rows], [0.05, 99.95])
    load = rig.load[joint]
    return Context(
        drive=rig.drive[joint],
        load=_kind_of(load),
        link_inertia=s.link_inertia,
        hang_angle=load.zero if isinstance(load, Pendulum) else 0.0,
        recorded=recorded,
        declared=declared,
        max_speed=float(np.percentile(np.abs(s.velocity[rows]), 99.5)),
        position_span=(float(s.position[rows].min()), float(s.position[rows].max())),
        effort_span=(float(low), float(high)),
        period=s.period,
        torque_span=(float(s.load_torque[rows].min()), float(s.load_torque[rows].max())),
        duration=float(s.time.max()),
        position_recorded=samples.resolution.raw_velocity_noise == 0.0,
        joint_type=rig.joint_type(joint),
        load_follows_position=not (rig.units_of(joint).slides and unknown_form(load) == "pendulum"),
        **_slow_channels(s, rows),
    )


@dataclass(frozen=True)
class LoadScale:
    """How a joint's torques are scaled.

    Attributes:
        gain: Drive gain K [effort/(N m)] at which the fits are held; None: fitted.
        rotor_inertia: Declared J that takes part in the balance [kg m^2].
        fitted_inertia: Whether an inertia of the load is part of the fit.
        as_effort: Whether nothing fixes the scale, so that the torques are told as effort.
        notes: What the reader must know of it; () where the load is known or the gain is declared.
    """

    gain: float | None
    rotor_inertia: float
    fitted_inertia: bool = False
    as_effort: bool = False
    notes: tuple[ScaleNote, ...] = ()


def load_scale(rig: Rig, joint: str) -> LoadScale:
    """What fixes the scale of the joint's torques."""
    form, declared = unknown_form(rig.load[joint]), rig.drive_gain.get(joint)
    inertia = rig.known(joint, "rotor_inertia")
    if form is None:
        return LoadScale(declared, inertia)
    if declared is not None:
        return LoadScale(declared, inertia, fitted_inertia=True)
    if rig.drive[joint] == "torque":
        return LoadScale(1.0, inertia, fitted_inertia=True, notes=(TorqueAsCommanded(),))
    if form == "smooth" and inertia > 0.0:
        return LoadScale(None, inertia, notes=(ScaleOfRotorInertia(inertia),))
    note = TorqueAsEffort(rig.drive[joint], declares_inertia=inertia > 0.0)
    return LoadScale(1.0, 0.0, fitted_inertia=True, as_effort=True, notes=(note,))
