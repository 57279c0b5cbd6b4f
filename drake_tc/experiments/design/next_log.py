"""The log of an experiment before it is made, and its posterior.

`next_log` simulates it with the sensors and the noise of the logs so far. Each channel gets the noise that its sensor
has there, and the effort what the most probable model of the logs leaves beyond the sensors' noise, as two
Ornstein-Uhlenbeck processes. The result is filtered as a diagnosis does. `rough_log` leaves most of this out, for a
search that compares motions. Of both, the posterior is told at the joint's own parameters and with the noise of the
logs: a fit of the simulated log would add an error of its own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from drake_tc.diagnosis.data.preparation import build_samples, context_of, load_scale
from drake_tc.diagnosis.data.resolution import SPEED_OF_NOISE, NoiseFloor, Resolution
from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import mode, posterior
from drake_tc.diagnosis.model import JointModel
from drake_tc.diagnosis.problem.columns import Columns, coefficients_by_term
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.problem.unknown_load import with_fitted_load
from drake_tc.diagnosis.split import with_needed
from drake_tc.errors import IdentificationError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.fitted import FittedJoint, rig_alone
from drake_tc.joint_simulator.measurement import coloured_noise
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig, parse_rig
from drake_tc.types import FloatArray

PERIOD = 5e-3
"""Sampling period where no log tells it [s]."""
SHORTEST = 8e-3
"""Shortest sampling period of a rough log [s]; of a designed motion, whose bandwidth is a few hertz, it shows all."""
UNKNOWN = Resolution(position_step=0.0, position_noise=1e-7, torque_noise=0.0, velocity_noise=0.0)
"""Of sensors where no log tells it: all noise is the effort's."""


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """One run of an experiment.

    Attributes:
        name: Of the run.
        joint: The joint with what it carries in this run.
        motion: (4, T) position, velocity, acceleration and jerk. step: between its samples [s].
    """

    name: str
    joint: DesignJoint
    motion: FloatArray
    step: float


def next_log(runs: Sequence[PlannedRun], seed: int = 0) -> FittedJoint | None:
    """The posterior of the simulated runs; None where they do not identify the declared model.

    Args:
        runs: Of the experiment; all of one joint.
        seed: Of the noise.
    """
    rng = np.random.default_rng(seed)
    made = [_simulated(run, rng) for run in runs]
    try:
        prepared = prepare_joint(made, [], rig_of(runs), runs[0].joint.name)
    except IdentificationError:
        return None
    return _at_truth(prepared, runs[0].joint, runs[0].joint.resolution or prepared.train.samples.resolution)


def rough_log(runs: Sequence[PlannedRun], repeats: int = 1) -> FittedJoint | None:
    """The same of runs at a period of at least `SHORTEST`, with the noise of the position alone; quicker.

    White noise is as loud as in a log at its own period: by the root of the one period over the other. The ages of the
    channels are those of a log at its own period.

    Args:
        runs: Of the experiment; all of one joint.
        repeats: How often all of them are made.
    """
    joint, rig, period = runs[0].joint, rig_of(runs), runs[0].joint.context.period or PERIOD
    step = max(period, SHORTEST)
    known, servo = joint.resolution or UNKNOWN, joint.context.drive == "position_servo"
    louder = {
        name: math.sqrt(period / step) * getattr(known, name)
        for name in ("position_step", "position_noise", "torque_noise", "effort_noise")
    }
    known, rng, made = replace(known, **louder), np.random.default_rng(0), []
    for run in runs:
        clean, name = _recorded(run, *_on_clock(run, step)), f"{joint.name}/position"
        noisy = clean.columns[name] + known.position_noise * rng.standard_normal(clean.time.size)
        made.append(replace(clean, columns=dict(clean.columns) | {name: noisy}))
    try:
        samples = build_samples(made, rig, joint.name, at_rest=joint.slowest / SPEED_OF_NOISE, resolution=known)
        samples = replace(samples, effort_period=period, torque_period=period)
        columns = Columns(samples, declared_gain=load_scale(rig, joint.name).gain)
        plain = fit(columns, joint.declared)
        columns = with_fitted_load(columns.with_model(plain.terms, plain.beta, servo=servo), plain)
    except IdentificationError:
        return None
    context = replace(joint.context, load=context_of(samples, rig, joint.name).load)
    return _at_truth(Prepared(columns, columns, plain.terms, 0.0, context, ()), joint, known, repeats)


def _at_truth(prepared: Prepared, joint: DesignJoint, resolution: Resolution, repeats: int = 1) -> FittedJoint:
    """The posterior of a log at the joint's own parameters, with the noise that the logs so far have."""
    numbers, samples, terms = joint.numbers, prepared.train.samples, prepared.terms
    servo, kernels = joint.context.drive == "position_servo", (samples.light, samples.kernel)
    sensors = NoiseFloor.of(resolution, *kernels, samples.signals, samples.rows, servo=servo)
    columns = prepared.train.changed(samples=replace(samples, resolution=resolution, floor=sensors))
    known = {"viscous": numbers.viscous, "coulomb": numbers.coulomb}
    fitted = coefficients_by_term(terms, fit(columns, terms).beta)
    theta = [np.full(v.size, known[t.effect.key]) if t.effect.key in known else v for t, v in fitted]
    beta = np.concatenate([[1.0 / numbers.gain], *theta])
    split = with_needed(columns, terms, beta, measured=prepared.context.load == "torque")
    model = JointModel(
        split, split, terms, prepared.context, columns.declared_gain, numbers.gain, numbers.coulomb, numbers.viscous
    )
    floor = noise_floor(columns, Fit(terms, beta, np.zeros(0), 0.0, 0.0, np.zeros(0)))
    white, known_floor = joint.noise**2 / (1.0 + joint.left.ratio), joint.floor**2
    shown = white / max(white, known_floor)  # of the sensors' noise: the logs leave no more than they do
    variance = shown * (floor / numbers.gain) ** 2 + max(white - known_floor, 0.0)
    # the slow discrepancy is as large as it is, beside more or less noise
    slow = replace(joint.left, ratio=joint.left.ratio * white / variance, share=joint.left.share * repeats)
    # simulated runs do not differ, and tell nothing of how much runs do
    evidence = Evidence(model, slow, replace(joint.spread, known=True))
    products, prior = evidence.products(split, terms)
    found = posterior(products, prior, numbers.gain**2 * variance)
    own = np.concatenate([numbers.gain * np.concatenate([[1.0], beta[1:]]), np.zeros(found.beta.size - beta.size)])
    others = np.arange(beta.size, own.size)  # ages and runs as they then are
    rest = products.at(others)
    rest = replace(rest, moment=rest.moment - products.gram[others] @ own)
    own[others] = mode(rest, prior.part(others), found.variance)
    scored = Scored(terms, found.log_evidence, replace(found, beta=own), beta.size)
    return FittedJoint(prepared, evidence, scored, (evidence, scored), floor, known=numbers)


def rig_of(runs: Sequence[PlannedRun]) -> Rig:
    """The rig of the joint alone, whose load is a column, or the pendulum that it is in each run."""
    joint, context = runs[0].joint, runs[0].joint.context
    servo: dict[str, object] = {"joint": joint.name, "drive": context.drive, "load": "torque"}
    if joint.rotor_inertia:
        servo["declared"] = {"rotor_inertia": joint.rotor_inertia}
    rig = rig_alone(joint.rig or parse_rig(servo), joint.name)
    if context.load == "pendulum":
        each = [(run.name, _pendulum(run.joint)) for run in runs]
        rig = replace(rig, load={joint.name: replace(each[0][1], by_run=tuple(each))})
    gain = context.declared.get("drive_gain")
    return replace(rig, drive_gain={joint.name: gain} if gain else {}, derivative_gain={}, saturation={})


def _pendulum(joint: DesignJoint) -> Pendulum:
    """The joint's load; a declared pendulum tells a diagnosis its weight and inertia alone."""
    return Pendulum(1.0, joint.gravity / 9.81, joint.link_inertia, joint.zero)


def _on_clock(run: PlannedRun, period: float) -> tuple[FloatArray, FloatArray]:
    """(time (T,), motion (4, T)) of a run at a sampling period [s]."""
    grid: FloatArray = np.asarray(np.arange(run.motion.shape[1]) * run.step, dtype=np.float64)
    if period == run.step:
        return grid, run.motion
    time: FloatArray = np.asarray(np.arange(int(grid[-1] / period)) * period, dtype=np.float64)
    spline = CubicHermiteSpline(grid, run.motion[0], run.motion[1])
    return time, np.stack([spline(time), spline(time, 1), np.interp(time, grid, run.motion[2]), np.zeros_like(time)])


def _recorded(run: PlannedRun, time: FloatArray, motion: FloatArray) -> Run:
    """What a logger without noise would record of a motion (4, T) that the joint follows."""
    joint, period = run.joint, float(time[1])
    signals = joint.signals(motion, period, sharp=True)
    command = COMMAND_COLUMN[joint.context.drive]
    columns = {"position": motion[0], "torque": signals.load_torque, command: signals.command}
    named = {f"{joint.name}/{name}": values for name, values in columns.items()}
    return Run(run.name, None, time, period, named, np.zeros(time.size, dtype=np.int64))


def _simulated(run: PlannedRun, rng: np.random.Generator) -> Run:
    """What a logger would record, with the noise of each channel."""
    joint, resolution = run.joint, run.joint.resolution or UNKNOWN
    time, motion = _on_clock(run, joint.context.period if joint.context.period > 0.0 else PERIOD)
    clean = _recorded(run, time, motion)
    step, white = resolution.position_step, resolution.position_noise
    position = motion[0] + np.sqrt(max(white**2 - step**2 / 12.0, 0.0)) * rng.standard_normal(time.size)
    if step > 0.0:
        position = step * np.round(position / step)
    load = coloured_noise(time, resolution.torque_noise, resolution.torque_correlation_time, rng)
    effort = _left(joint, time, rng)
    effort += max(resolution.effort_noise, resolution.effort_step / np.sqrt(12.0)) * rng.standard_normal(time.size)
    noise = {"position": position - motion[0], "torque": load, COMMAND_COLUMN[joint.context.drive]: effort}
    columns = {f"{joint.name}/{name}": clean.columns[f"{joint.name}/{name}"] + own for name, own in noise.items()}
    columns[f"{joint.name}/position"] = position
    steps = {f"{joint.name}/position": step} if step > 0.0 else {}
    return replace(clean, columns=columns, steps=steps)


def _left(joint: DesignJoint, time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(T,) what a model of the logs leaves beyond the sensors' noise [effort]: as fast as rows, and slow."""
    own = joint.noise**2 / (1.0 + joint.left.ratio)
    parts = (
        (max(own - joint.floor**2, 0.0), 0.5 / joint.independent_per_second),
        (joint.left.ratio * own, joint.left.memory),
    )
    drawn = [coloured_noise(time, float(np.sqrt(v)), memory, rng) for v, memory in parts]
    return np.asarray(joint.numbers.gain * np.sum(drawn, axis=0))
