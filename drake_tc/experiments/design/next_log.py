"""The log of an experiment before it is made: simulated with the sensors and the noise of the logs so far.

The motion is sampled as the logs are. Each channel gets the noise that its sensor has there, and the effort what the
most probable model of the logs leaves beyond the sensors' noise, as two Ornstein-Uhlenbeck processes. The
result is filtered as a diagnosis does. Intervals and log odds are those of its posterior at the joint's own parameters
and with the noise of the logs: a fit of the simulated log would add an error of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.problem.regression import noise_floor
from drake_tc.diagnosis.search import as_fit
from drake_tc.errors import IdentificationError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.joint_simulator.measurement import coloured_noise
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN, Rig, parse_rig
from drake_tc.types import FloatArray

PERIOD = 5e-3
"""Sampling period where no log tells it [s]."""
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
    rng, rig = np.random.default_rng(seed), rig_of(runs)
    made = [_simulated(run, rng) for run in runs]
    try:
        return _at_truth(prepare_joint(made, [], rig, runs[0].joint.name), runs[0].joint)
    except IdentificationError:
        return None


def _at_truth(prepared: Prepared, joint: DesignJoint) -> FittedJoint:
    """The posterior of a simulated log at the joint's own parameters, with the noise that the logs so far have."""
    numbers, model = joint.numbers, joint_model(prepared)
    known = {"viscous": numbers.viscous, "coulomb": numbers.coulomb}
    theta = np.concatenate(
        [np.zeros(0), *(np.full(len(t.effect.coefficients), known.get(t.effect.key, 0.0)) for t in model.declared)]
    )
    spread = replace(joint.spread, known=True)  # simulated runs do not differ, and tell nothing of it
    evidence = Evidence(model.relinearised(model.declared, theta, numbers.gain, {}), joint.left, spread)
    scored = evidence.score(model.declared)
    beta = scored.posterior.beta.copy()
    beta[: scored.coefficients] = numbers.gain * np.concatenate([[1.0], theta])
    scored = replace(scored, posterior=replace(scored.posterior, beta=beta))
    floor = noise_floor(evidence.model.train.recorded, as_fit(scored))
    white = joint.noise**2 / (1.0 + joint.left.ratio)
    variance = (floor / numbers.gain) ** 2 + max(white - joint.floor**2, 0.0)
    slow = replace(
        joint.left, ratio=joint.left.ratio * white / variance
    )  # as large as it is, beside more or less noise
    evidence = Evidence(evidence.model, slow, spread)
    own = evidence.score(model.declared, numbers.gain**2 * variance)
    scored = replace(own, posterior=replace(own.posterior, beta=beta))
    return FittedJoint(prepared, evidence, scored, (evidence, scored), floor, (), {})


def declared_fit(prepared: Prepared) -> FittedJoint:
    """The declared model as a diagnosis has it before it looks for effects."""
    model = joint_model(prepared)
    evidence = Evidence(model).heard(model.declared)
    scored = evidence.refined(evidence.score(model.declared))
    return FittedJoint(prepared, evidence, scored, (evidence, scored), prepared.floor, (), {})


def rig_of(runs: Sequence[PlannedRun]) -> Rig:
    """The rig of the joint alone, whose load is a column, or the pendulum that it is in each run."""
    joint, context = runs[0].joint, runs[0].joint.context
    servo: dict[str, object] = {"joint": joint.name, "drive": context.drive, "load": "torque"}
    if joint.rotor_inertia:
        servo["declared"] = {"rotor_inertia": joint.rotor_inertia}
    rig = joint.rig or parse_rig(servo)
    load = rig.load[joint.name]
    if context.load == "pendulum":
        each = [(run.name, _pendulum(run.joint)) for run in runs]
        load = replace(each[0][1], by_run=tuple(each))
    elif context.load in ("robot", "links"):
        load = "torque"
    gain = context.declared.get("drive_gain")
    return replace(
        rig,
        joints=(joint.name,),
        drive={joint.name: context.drive},
        load={joint.name: load},
        declared={joint.name: rig.declared[joint.name]},
        drive_gain={joint.name: gain} if gain else {},
        derivative_gain={},
        saturation={},
        robot=None,
        coupled={},
    )


def _pendulum(joint: DesignJoint) -> Pendulum:
    """The joint's load; a declared pendulum tells a diagnosis its weight and inertia alone."""
    return Pendulum(1.0, joint.gravity / 9.81, joint.link_inertia, joint.zero)


def _simulated(run: PlannedRun, rng: np.random.Generator) -> Run:
    """What a logger would record of a motion that the joint follows."""
    joint, resolution = run.joint, run.joint.resolution or UNKNOWN
    period = joint.context.period if joint.context.period > 0.0 else PERIOD
    grid = np.arange(run.motion.shape[1]) * run.step
    time: FloatArray = np.asarray(np.arange(int(grid[-1] / period)) * period, dtype=np.float64)
    spline = CubicHermiteSpline(grid, run.motion[0], run.motion[1])
    motion = np.stack([spline(time), spline(time, 1), np.interp(time, grid, run.motion[2]), np.zeros_like(time)])
    signals = joint.signals(motion, period, sharp=True)
    step, white = resolution.position_step, resolution.position_noise
    position = motion[0] + np.sqrt(max(white**2 - step**2 / 12.0, 0.0)) * rng.standard_normal(time.size)
    columns = {"position": step * np.round(position / step) if step > 0.0 else position}
    noise = resolution.torque_noise, resolution.torque_correlation_time
    columns["torque"] = signals.load_torque + coloured_noise(time, *noise, rng)
    effort = signals.effort + _left(joint, time, rng)
    effort += max(resolution.effort_noise, resolution.effort_step / np.sqrt(12.0)) * rng.standard_normal(time.size)
    servo = joint.context.drive == "position_servo"
    columns[COMMAND_COLUMN[joint.context.drive]] = motion[0] + effort if servo else effort
    named = {f"{joint.name}/{name}": values for name, values in columns.items()}
    steps = {f"{joint.name}/position": step} if step > 0.0 else {}
    return Run(run.name, None, time, period, named, np.zeros(time.size, dtype=np.int64), steps=steps)


def _left(joint: DesignJoint, time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(T,) what a model of the logs leaves beyond the sensors' noise [effort]: as fast as rows, and slow."""
    own = joint.noise**2 / (1.0 + joint.left.ratio)
    parts = (
        (max(own - joint.floor**2, 0.0), 0.5 / joint.independent_per_second),
        (joint.left.ratio * own, joint.left.memory),
    )
    drawn = [coloured_noise(time, float(np.sqrt(v)), memory, rng) for v, memory in parts]
    return np.asarray(joint.numbers.gain * np.sum(drawn, axis=0))


def as_fitted(joint: DesignJoint, fitted: FittedJoint | None) -> DesignJoint:
    """The joint with the filters and the noise of a fit, for a criterion that a search maximises."""
    if fitted is None:
        return joint
    samples, noise = fitted.prepared.train.samples, fitted.balance
    return replace(
        joint,
        noise=noise.left,
        floor=noise.floor,
        independent_per_second=fitted.per_second,
        kernel_width=samples.light.actual_width_s,
        final_width=samples.kernel.actual_width_s,
    )
