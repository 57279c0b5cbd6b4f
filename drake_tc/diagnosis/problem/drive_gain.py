"""Whether a fit tells the drive gain, and the declared model where it does not.

Where the effort is nearly all friction, 1/K can rest at 0 in the declared model although no sign is wrong: an effect
that the model lacks weighs more than the load, and the best of all physical frictions is none. The search then starts
from the gain of the reverse regression. If the model found tells the gain, the declared model is told at that gain; if
not, the joint is refused.

A position servo with a strong integral action is another such joint. For K_i of the order of the motion's frequency,
y + K_i int y dt = K (tau + ...) is far from in phase with y, and y can even fall while the load rises. Whether the load
explains the effort is therefore asked beside friction, and for a position servo also beside friction and int y dt.
"""

from collections.abc import Iterator

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import LOAD_EXPLAINS, NO_STIFFNESS
from drake_tc.effects.base import DriveKind
from drake_tc.effects.servo_integrator import ServoIntegrator
from drake_tc.types import FloatArray


def tells_drive_gain(columns: Columns, fitted: Fit) -> bool:
    """Whether the effort enters the balance of a fit to these rows, 1/K > 0."""
    effort = columns.samples.reduce(columns.samples.signals.effort)
    typical = float(np.std(columns.target)) / max(float(np.std(effort)), 1e-300)
    return bool(fitted.beta[0] > NO_STIFFNESS * typical)


def beside_the_load(columns: Columns, drive: DriveKind) -> Iterator[FloatArray]:
    """What the effort may hold beside the load, (N, k): friction of any sign; of a position servo also int y dt."""
    samples = columns.samples
    s = samples.signals
    friction = np.column_stack([samples.reduce(s.velocity), samples.reduce(s.direction), np.ones(columns.target.size)])
    yield friction
    if drive == "position_servo":  # the integral may be charged when a run begins: a constant of its own for each run
        runs = (samples.run[:, None] == np.unique(samples.run)).astype(np.float64)
        yield np.column_stack([friction[:, :2], runs, columns.of(Term(ServoIntegrator()))])


def at_reverse_regression(columns: Columns, declared: Fit, drive: DriveKind) -> Fit:
    """The declared model; where it does not tell the drive gain, fitted at that of the regression of effort on load.

    With y the effort and l the load with the rotor's torque, both less what else explains of them (`beside_the_load`),
    K = (y . l)/(l . l), which is positive where the load explains anything of the effort (`require_consistent_signs`).
    Elsewhere the declared model is returned as it is.

    Args:
        columns: Training rows.
        declared: The declared model, fitted to them.
        drive: Of the joint.
    """
    if tells_drive_gain(columns, declared):
        return declared
    both = np.column_stack([columns.samples.reduce(columns.samples.signals.effort), columns.target])
    gains = []
    for others in beside_the_load(columns, drive):
        effort, load = (both - others @ np.linalg.lstsq(others, both, rcond=None)[0]).T
        gains.append(float(effort @ load) / float(load @ load))
        if gains[-1] > 0.0 and rms(effort - gains[-1] * load) <= LOAD_EXPLAINS * rms(effort):
            return _fit_at(columns, gains[-1], declared)
    return _fit_at(columns, gains[0], declared) if gains[0] > 0.0 else declared


def _fit_at(columns: Columns, gain: float, declared: Fit) -> Fit:
    """The declared model at a drive gain [effort/(N m)]."""
    return fit(columns.changed(declared_gain=gain), declared.terms)
