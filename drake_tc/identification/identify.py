"""From runs to an actuator: effort = Kτ (τ + J q̈) + Kv q̇ + Kc sign(q̇), by one of four methods.

Source: Del Prete et al., 2016, section 3.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.identification.asymmetric import AsymmetricFit, PiecewiseFit, asymmetric_least_squares, fit_piecewise
from drake_tc.identification.free_parameters import require_physical
from drake_tc.identification.regression import LinearFit, least_squares
from drake_tc.identification.two_stage import TwoStageFit, fit_two_stage
from drake_tc.logs.loads import Pendulum
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

Method = Literal["least_squares", "asymmetric", "two_stage", "piecewise"]
Fit = LinearFit | AsymmetricFit | TwoStageFit | PiecewiseFit
NAMES = ("K_tau", "K_v", "K_c")


@dataclass(frozen=True)
class JointSamples:
    """One joint's signals, all through the same low-pass, stretches one after another; arrays (T,).

    Attributes:
        torque: Transmitted torque τ + J q̈ [N·m].
        velocity: q̇ [rad/s].
        direction: sign(q̇), low-passed like the rest, in [-1, 1].
        effort: q_d − q [rad], current [A] or voltage [V].
        lengths: Samples of each stretch.
    """

    torque: FloatArray
    velocity: FloatArray
    direction: FloatArray
    effort: FloatArray
    lengths: tuple[int, ...]

    @property
    def still_below(self) -> float:
        """Speed below which a sample counts as at rest [rad/s]: 2 % of the 99th percentile of the speed."""
        return 0.02 * float(np.percentile(np.abs(self.velocity), 99))


@dataclass(frozen=True)
class Identified:
    """An identified actuator and where it came from.

    Attributes:
        joint: Name of the joint.
        drive: Kind of its drive.
        method: How it was fitted.
        parameters: K_tau [effort/(N·m)], K_v [effort s/rad], K_c [effort]; breaks and slopes for "piecewise".
        intervals: 95 % intervals by parameter; empty for "piecewise".
        rms: Of the residual [effort].
        residual: (T,) [effort].
        fit: The method's own result: covariance, correlation, condition number, bounds hit.
        runs: Names of the runs it came from.
    """

    joint: str
    drive: str
    method: Method
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    rms: float
    residual: FloatArray
    fit: Fit
    runs: tuple[str, ...]


def identify(
    runs: Sequence[Run],
    rig: Rig,
    method: Method = "least_squares",
    *,
    joint: str | None = None,
    width_s: float = 0.05,
) -> Identified:
    """Fit one joint's actuator to runs.

    Args:
        runs: Runs with the rig's columns.
        rig: Drive, load and declared values (rotor_inertia is used as J).
        method: "least_squares", "asymmetric", "two_stage" or "piecewise".
        joint: Which joint; None for the rig's first.
        width_s: Width of the common smoothing kernel [s].

    Raises:
        IdentificationError: Unknown joint or method, a load that is not known, no usable samples, poor excitation, or a
            result that no joint has.

    Example:
        >>> found = identify(leg_runs(), leg_rig())
        >>> round(found.parameters["K_tau"], 2)
        0.4
    """
    name = rig.joints[0] if joint is None else joint
    if name not in rig.joints:
        raise IdentificationError(f"no joint {name!r} in the rig; joints here: {', '.join(rig.joints)}")
    samples = prepare(runs, rig, name, width_s)
    parameters, intervals, residual, fit = identify_arrays(samples, method)
    require_physical(name, parameters, intervals, samples.velocity, samples.direction)
    rms = float(np.sqrt(np.mean(residual**2)))
    names = tuple(run.name for run in runs)
    return Identified(name, rig.drive[name], method, parameters, intervals, rms, residual, fit, names)


def prepare(runs: Sequence[Run], rig: Rig, joint: str, width_s: float = 0.05) -> JointSamples:
    """All usable samples of a joint, every channel through one `CommonKernel`.

    Raises:
        IdentificationError: A column that a run lacks, a load that is not known, or no stretch long enough.
    """
    parts: list[tuple[FloatArray, ...]] = []
    for run in runs:
        missing = [c for c in rig.required_columns(joint) if c not in run.columns]
        if missing:
            raise IdentificationError(f"{run.name}: identification of {joint} needs {', '.join(missing)}")
        kernel = CommonKernel(width_s, run.period)
        parts += [_stretch(run, rig, joint, kernel, s) for s in run.segments() if s.stop - s.start > 2 * kernel.margin]
    if not parts:
        raise IdentificationError(f"no stretch of {joint}'s runs is longer than the smoothing kernel of {width_s:g} s")
    torque, velocity, direction, effort = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return JointSamples(torque, velocity, direction, effort, tuple(p[0].size for p in parts))


def _stretch(run: Run, rig: Rig, joint: str, kernel: CommonKernel, part: slice) -> tuple[FloatArray, ...]:
    position = run.columns[f"{joint}/position"][part]
    command = run.columns[rig.command_column(joint)][part]
    effort = command - position if rig.drive[joint] == "position_servo" else command
    velocity, acceleration = kernel.derivative(position), kernel.second_derivative(position)
    load = rig.load[joint]
    if isinstance(load, Pendulum):
        pendulum = load.in_run(run)
        gravity = pendulum.torque(position, np.zeros_like(position))
        torque = kernel.smooth(gravity) + pendulum.inertia * acceleration
    elif load == "torque":
        torque = kernel.smooth(run.columns[f"{joint}/torque"][part])
    else:
        raise IdentificationError(f"{joint}: the load torque is not known; give a torque column or a pendulum")
    torque = torque + rig.known(joint, "rotor_inertia") * acceleration
    direction = kernel.smooth(np.sign(velocity))
    valid = kernel.valid(position.size)
    return torque[valid], velocity[valid], direction[valid], kernel.smooth(effort)[valid]


Result = tuple[Mapping[str, float], Mapping[str, tuple[float, float]], FloatArray, Fit]


def identify_arrays(samples: JointSamples, method: Method = "least_squares") -> Result:
    """Parameters, their 95 % intervals, the residual (T,) [effort] and the method's own result.

    Raises:
        IdentificationError: An unknown method, or data that cannot identify it.
    """
    if method not in _METHODS:
        raise IdentificationError(f"no method {method!r}; possible: {', '.join(_METHODS)}")
    return _METHODS[method](samples)


def _columns(s: JointSamples) -> FloatArray:
    return np.stack([s.torque, s.velocity, s.direction], axis=1)


def _linear(s: JointSamples) -> Result:
    fit = least_squares(_columns(s), s.effort, names=NAMES, lengths=s.lengths)
    return fit.parameters, fit.intervals, fit.residual, fit


def _asymmetric(s: JointSamples) -> Result:
    fit = asymmetric_least_squares(_columns(s), s.effort, names=NAMES, lengths=s.lengths)
    intervals = {n: (float(lo), float(hi)) for n, (lo, hi) in zip(NAMES, fit.ci95, strict=True)}
    return fit.parameters, intervals, fit.residual, fit


def _two_stage(s: JointSamples) -> Result:
    fit = fit_two_stage(s.torque, s.velocity, s.effort, still_below=s.still_below, lengths=s.lengths)
    return fit.parameters, fit.intervals, fit.residual, fit


def _piecewise(s: JointSamples) -> Result:
    fit = fit_piecewise(s.torque, s.velocity, s.effort)
    named: dict[str, float] = {}
    for way, curve in (("forward", fit.forward), ("backward", fit.backward)):
        numbers = (*curve.breaks, *curve.slopes, curve.offset)
        labels = ("tau_1", "tau_2", "k_1", "k_2", "k_3", "offset")
        named |= {f"{way}.{label}": number for label, number in zip(labels, numbers, strict=True)}
    return named, {}, np.asarray(s.effort - fit(s.torque, s.velocity)), fit


_METHODS: Mapping[Method, Callable[[JointSamples], Result]] = {
    "least_squares": _linear,
    "asymmetric": _asymmetric,
    "two_stage": _two_stage,
    "piecewise": _piecewise,
}
