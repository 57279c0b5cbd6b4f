"""How well fitted links tell a joint's drive gain, and between which bounds 1/K lies.

Let y be the effort and l = z - C delta the load by the fitted links, both less what friction and rotor explain of them,
and r their correlation. The balance regresses l on y, which gives r^2/K where all noise is in the effort, and 1/K where
all of it is in the load: least squares shrinks the coefficient of a noisy column. The truth lies between the two
(Frisch, 1934, "Statistical confluence analysis by means of complete regression systems"), and friction and all other
torques of the joint scale with it. A joint whose effort is nearly all friction has an r near 0.
"""

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit

LEAST_SHARED = 1e-6
"""r^2, at least: below it nothing is known of the drive gain."""
TOLD = 0.5
"""r^2 from which on the load tells the drive gain."""


def shared_variance(rows: JointRows, fitted: StackedFit, number: int) -> float:
    """r^2 of one joint; 1 where its drive gain is declared, 0 where the load falls with the effort.

    Args:
        rows: Of the joint.
        fitted: All joints together.
        number: Which of them it is.
    """
    return 1.0 if rows.held is not None else max(_spreads(rows, fitted)[2], 0.0) ** 2


def stiffness_to_hold(rows: JointRows, fitted: StackedFit, number: int) -> float:
    """1/K [N m/effort] at which a joint is searched by itself.

    That of the common fit where the load tells it. Elsewhere that of the reverse regression, as the noise is in the
    effort; r is then taken to be at least its own standard deviation, 1/sqrt(n). A smaller 1/K would leave nothing of
    the effort, and of the friction in it, beside the load.
    """
    if rows.held is not None or shared_variance(rows, fitted, number) >= TOLD:
        return rows.stiffness(fitted.beta[number])
    effort, load, r = _spreads(rows, fitted)
    least = 1.0 / np.sqrt(_independent(rows, fitted, number))
    return float(max(load / max(effort, 1e-300) / max(r, least), 1e-12))


def dilution(rows: JointRows, fitted: StackedFit, number: int) -> float:
    """1/r^2 - 1: by which share of itself 1/K may be too small; r at the lower end of its 95 % interval.

    With n rows that say something of their own, atanh r has a standard deviation of 1/sqrt(n - 3) (Fisher, 1921).
    """
    if rows.held is not None:
        return 0.0
    r = min(np.sqrt(shared_variance(rows, fitted, number)), 1.0 - 1e-12)
    deviation = 1.0 / np.sqrt(_independent(rows, fitted, number) - 3.0)
    lowest = np.tanh(np.arctanh(r) - float(norm.ppf(0.975)) * deviation)
    return float(1.0 / max(lowest, np.sqrt(LEAST_SHARED)) ** 2 - 1.0)


def _independent(rows: JointRows, fitted: StackedFit, number: int) -> float:
    return max(float(fitted.effective[number]) * rows.target.size, 4.0)


def _spreads(rows: JointRows, fitted: StackedFit) -> tuple[float, float, float]:
    """RMS of y [effort] and of l [N m], and r."""
    load = rows.target - rows.shared[:, fitted.columns] @ fitted.delta
    both = np.column_stack([rows.own[:, 0], load])
    friction = rows.own[:, 1:]
    left = both - friction @ np.linalg.lstsq(friction, both, rcond=None)[0]
    gram = left.T @ left / len(left)
    sizes = np.sqrt(np.diag(gram))
    return float(sizes[0]), float(sizes[1]), float(gram[0, 1] / max(sizes[0] * sizes[1], 1e-300))
