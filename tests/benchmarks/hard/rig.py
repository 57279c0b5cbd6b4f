"""One rig: its joint, its runs, its channels; simulated and recorded."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.signal import savgol_filter

from tests.benchmarks.hard.causes import CAUSES, Scales, Shape, View, World
from tests.benchmarks.hard.motions import held, motion, pushes, warming
from tests.benchmarks.hard.oracle import Problem
from tests.benchmarks.hard.physics import Array, Joint, Traces, simulate
from tests.benchmarks.hard.sensors import Channel, encoder_error, record, stamps

BAND = 0.02
"""Residuals are averaged over this time [s] before their size is stated: what is faster is noise of single samples."""
EFFORT_COLUMN = {"position_servo": "position_command", "current": "current", "voltage": "voltage"}


@dataclass(frozen=True)
class Run:
    """One run: its motion, and what differs from run to run (factors of friction, error of the zero)."""

    name: str
    kind: str
    duration: float
    seed: int
    coulomb: float
    viscous: float
    zero: float
    held_out: bool


@dataclass(frozen=True)
class Rig:
    """A rig as drawn.

    Attributes:
        scales: Sizes from which causes are made.
        causes: Shapes of the missing causes.
        gain_held: The rig file states the gain of the drive.
        channels: Column to how it is recorded.
        friction_spread: Standard deviations of the runs' factors of Coulomb and viscous friction.
        zero_spread: Standard deviation of the runs' zero, in the unit of the channel that has it.
        tolerances: Standard deviations that the rig file states, by sensor and kind.
        settings: The numbers of the draw, for the truth file.
    """

    name: str
    drive: str
    load: str
    world: World
    scales: Scales
    causes: Mapping[str, Shape]
    gain_held: bool
    runs: tuple[Run, ...]
    rate: float
    stamp_jitter: float
    travel: float
    fastest_hz: float
    command_hz: float
    push: float
    channels: Mapping[str, Channel]
    friction_spread: tuple[float, float]
    zero_spread: float
    tolerances: Mapping[str, float]
    settings: Mapping[str, float | str]

    @property
    def training(self) -> tuple[Run, ...]:
        """The runs that are fitted."""
        return tuple(run for run in self.runs if not run.held_out)

    @property
    def zero_column(self) -> str:
        """The column whose zero differs from run to run: the torque, or the effort of a drive that is measured."""
        return "torque" if self.load == "torque" else EFFORT_COLUMN[self.drive]


@dataclass(frozen=True)
class Recording:
    """Columns of a log, their errors, the errors of the position that are noise, and the true signals."""

    time: Array
    columns: Mapping[str, Array]
    errors: Mapping[str, Array]
    position_noise: Array
    traces: Traces


@lru_cache(maxsize=4)
def _inputs(run: Run, travel: float, fastest: float, hertz: float, push: float) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng([run.seed, 1])
    q, rate = motion(run.kind, run.duration, travel, fastest, rng)
    external = pushes(q.size, push, rng) if push > 0.0 else np.zeros(q.size)
    return held(q, hertz) if hertz > 0.0 else q, rate, external, warming(q.size, rng)


def run_traces(rig: Rig, world: World, run: Run) -> Traces:
    """The run in a world."""
    joint = world.joint._replace(coulomb=world.joint.coulomb * run.coulomb, viscous=world.joint.viscous * run.viscous)
    hertz = rig.command_hz if rig.drive == "position_servo" else 0.0
    reference, rate, external, celsius = _inputs(run, rig.travel, rig.fastest_hz, hertz, rig.push)
    return simulate(joint, reference, rate, external, celsius, float(reference[0]))


def record_run(rig: Rig, world: World, run: Run) -> Recording:
    """Simulate and record a run. The noise is that of the run's seed, whatever the world."""
    traces = run_traces(rig, world, run)
    rng = np.random.default_rng([run.seed, 2])
    time = stamps(rig.rate, run.duration, rig.stamp_jitter, rng)
    errors = world.sensors
    reading = encoder_error(traces.q, errors.offset, errors.sine, errors.cosine)
    signals = {
        "position": traces.q + reading,
        "velocity": traces.v,
        "position_command": traces.command,
        "current": traces.effort,
        "voltage": traces.effort,
        "torque": (1.0 + errors.gain) * traces.torque + errors.bias + errors.drift * traces.time,
        "temperature": traces.celsius,
    }
    columns, wrong = {}, {}
    for number, (name, channel) in enumerate(sorted(rig.channels.items())):
        own = np.random.default_rng([run.seed, 3, number])
        column, clean = record(channel, time, traces.time, signals[name], own)
        zero = run.zero if name == rig.zero_column else 0.0
        columns[name] = column + zero
        wrong[name] = columns[name] - clean
    wrong["torque"] = wrong.get("torque", 0.0) + np.interp(time, traces.time, signals["torque"] - traces.torque)
    noise = wrong["position"]
    wrong["position"] = noise + np.interp(time, traces.time, reading)
    return Recording(time, columns, wrong, noise, traces)


def problem(rig: Rig, world: World, recordings: Mapping[str, Recording]) -> tuple[Problem, View]:
    """The oracle's rows of the training runs; the balance holds but for the errors of the sensors.

    A load or inertia that is computed from the motion has the noise of the encoder, twice differentiated.
    """
    joint = world.joint
    parts = [_rows(rig, world, recordings[run.name], number) for number, run in enumerate(rig.training)]
    view = View(*(np.concatenate([part[name] for part in parts]) for name in View.__dataclass_fields__))
    inertia = np.zeros_like(view.a) if "rotor_inertia" in rig.causes else joint.rotor * view.a
    driven = joint.gain * (view.observed_torque + inertia)
    base = [view.v, view.slide]
    target = view.effort - driven if rig.gain_held or rig.load == "unknown" else view.effort
    if not rig.gain_held and rig.load != "unknown":
        base.append(driven)
    if rig.load == "unknown":
        base += [np.sin(view.q), np.cos(view.q), np.ones_like(view.q), view.a]
    nuisance, spread = _nuisances(rig, joint.gain, view, joint)
    causes = {name: CAUSES[name].columns(view, world, shape) for name, shape in rig.causes.items()}
    return Problem(
        target, np.stack(base, axis=-1), nuisance, spread, causes, view.run, max(1, round(BAND * rig.rate))
    ), view


def _rows(rig: Rig, world: World, recording: Recording, number: int) -> dict[str, Array]:
    joint, time, wrong = world.joint, recording.time, recording.errors
    at = {name: recording.traces.at(name, time) for name in Traces._fields if name != "time"}
    effort = at["acting"] + joint.gain * joint.derivative * at["rotor_v"] + joint.back_emf * at["rotor_v"]
    effort += at["delay_part"] + at["deadzone_part"] + at["saturation_part"] + at["lag_part"]
    effort -= joint.switch * at["switched"] + joint.integral_rate * at["integral"]
    if rig.drive == "position_servo":
        effort += at["after_gap"] + wrong["position_command"] - wrong["position"]
    else:
        effort += wrong[EFFORT_COLUMN[rig.drive]]
    computed = joint.rotor + (0.0 if rig.load == "torque" else joint.link)
    effort -= joint.gain * computed * _acceleration(recording.position_noise, rig)
    if rig.load == "torque":
        observed = at["torque"] + wrong["torque"]
    elif rig.load == "pendulum":
        observed = joint.link * at["a"] + joint.moment * np.sin(at["q"] + wrong["position"])
    else:
        observed = np.zeros_like(time)
    rows = {name: at[name] for name in ("q", "torque", "slide", "soft", "after_gap", "delay_part", "integral")}
    rows |= {
        name: at[name] for name in ("deadzone_part", "saturation_part", "switched", "lag_part", "celsius", "pressed")
    }
    rows |= {"time": time, "run": np.full(time.size, float(number)), "v": at["rotor_v"], "a": at["rotor_a"]}
    return rows | {"observed_torque": observed, "effort": effort}


def _acceleration(noise: Array, rig: Rig) -> Array:
    """Second derivative of the encoder's noise, by a filter of a quarter of the period of the fastest motion."""
    window = min(max(2 * round(0.125 * rig.rate / rig.fastest_hz) + 1, 5), noise.size // 2 * 2 - 1)
    return np.asarray(savgol_filter(noise, window, 3, deriv=2, delta=1.0 / rig.rate))


def _nuisances(rig: Rig, gain: float, view: View, joint: Joint) -> tuple[Array, Array]:
    """Friction and zero of each run, and errors of sensors within their tolerances."""
    columns, spread = [], []
    unit = gain if rig.zero_column == "torque" else 1.0
    for number in np.unique(view.run):
        here = (view.run == number).astype(float)
        columns += [here * view.slide, here * view.v, here]
        spread += [gain * joint.coulomb * rig.friction_spread[0], gain * joint.viscous * rig.friction_spread[1]]
        spread.append(max(unit * rig.zero_spread, 1e-12))
    ones = np.ones_like(view.q)
    for key, size in rig.tolerances.items():
        column = {"torque.gain": gain * view.torque, "torque.bias": gain * ones}.get(key, ones)
        if key == "encoder.offset":
            column = gain * joint.moment * np.cos(view.q)
        columns.append(column)
        spread.append(size)
    return np.stack(columns, axis=-1), np.array(spread)
