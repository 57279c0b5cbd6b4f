"""How much better than a growing sinusoid any motion can identify the friction of a joint.

    tau = F_v v + F_c sign(v) + e,   u = |v|/v_max,   N independent samples of e ~ (0, s^2)
    Var F_c = s^2/N  E[u^2]/Var(u),   Var(F_v v_max) = s^2/N  1/Var(u)

Of all distributions of u in [0, 1], those with u near 0 have the least Var F_c, s^2/N, and those with a half near 0 and
a half at 1 the least Var F_v, 4 s^2/N. Their jumps of the speed need an infinite acceleration.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from drake_tc.experiments.design.lead import DEFAULT_HZ
from drake_tc.experiments.design.motions import JointLimits, motion_basis, scaled
from drake_tc.experiments.design.robot_goal import TURN_SPEED, RelativeIntervals, standard_errors
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid

LIMITS = JointLimits((-6.28, 6.28), velocity=3.15, acceleration=7.875, bandwidth_hz=0.8)
"""Of the first joints of the UR5."""
SECONDS, STEP = 30.0, 0.05


def errors(u, direction):
    """Standard errors of F_v v_max and F_c, in units of s/sqrt(N)."""
    columns = np.column_stack([u, direction])
    return standard_errors(columns.T @ columns / len(u))


def sinusoid():
    time = np.arange(0.0, SECONDS, STEP)
    wide = MotionLimits((-20.0, 20.0), LIMITS.velocity, 100.0)
    return growing_sinusoid(time, DEFAULT_HZ, 1.0, 19.0 / SECONDS, wide).velocity / LIMITS.velocity


def test_a_growing_sinusoid_is_within_40_and_50_percent_of_the_least_errors():
    found = errors(sinusoid(), np.sign(sinusoid()))
    assert_allclose(found, [3.97, 1.66], rtol=0.02)  # E u = 0.525 2/pi, E u^2 = 0.351/2
    assert_allclose([2.0 / found[0], 1.0 / found[1]], [0.50, 0.60], atol=0.01)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
def test_a_share_at_full_speed_serves_viscous_and_the_rest_coulomb_friction(share):
    u = np.where(np.arange(1000) < 1000 * share, 1.0, 1e-9)
    turns = np.where(np.arange(1000) % 2, 1.0, -1.0)
    assert_allclose(
        errors(u * turns, turns), [1.0 / np.sqrt(share * (1.0 - share)), 1.0 / np.sqrt(1.0 - share)], rtol=1e-6
    )


def test_limits_of_acceleration_and_frequency_leave_less():
    """The best motion found for the friction of one joint alone, from motions with a slow and a fast part."""
    basis = scaled(motion_basis("fourier", SECONDS, STEP, LIMITS.bandwidth_hz, 24), LIMITS)
    default = sinusoid()
    reference = errors(default, np.tanh(default / TURN_SPEED))
    criterion = RelativeIntervals(reference, (np.arange(2),))
    time = basis.step * np.arange(basis.matrices.shape[1])

    def value(x):
        u = basis.matrices[1] @ x / LIMITS.velocity
        z = np.column_stack([u, np.tanh(u / TURN_SPEED)]) / np.sqrt(u.size)
        found, slope = criterion.value_and_slope(z.T @ z)
        by_column = 2.0 * z @ slope / np.sqrt(u.size)
        by_speed = by_column[:, 0] + by_column[:, 1] * (1.0 - np.tanh(u / TURN_SPEED) ** 2) / TURN_SPEED
        return found, basis.matrices[1].T @ by_speed / LIMITS.velocity, np.sqrt(np.diag(np.linalg.inv(z.T @ z)))

    def within(x):
        speed, acceleration = (np.abs(basis.matrices[order] @ x).max() for order in (1, 2))
        return x / max(1.0, speed / LIMITS.velocity, acceleration / LIMITS.acceleration)

    def solved(start):
        program = MathematicalProgram()
        x = program.NewContinuousVariables(basis.size, "x")
        for order, bound in enumerate((6.28, LIMITS.velocity, LIMITS.acceleration)):
            rows = basis.matrices[order, ::3]
            program.AddLinearConstraint(rows, np.full(len(rows), -bound), np.full(len(rows), bound), x)

        def cost(at):
            if at.dtype != object:
                return -value(at)[0]
            found, slope, _ = value(ExtractValue(at).ravel())
            return AutoDiffXd(-found, -slope @ ExtractGradient(at))

        program.AddCost(cost, vars=x)
        options = SolverOptions()
        options.SetOption(SnoptSolver.id(), "Major iterations limit", 80)
        return within(SnoptSolver().Solve(program, start, options).GetSolution(x))

    found = []
    for slow in (0.3, 0.5, 0.7):
        speed = np.where(
            time < slow * SECONDS,
            0.1 * np.sign(np.sin(2.0 * np.pi * time / (slow * SECONDS))),
            0.9 * np.sign(np.sin(0.4 * np.pi * time)),
        )
        start = within(np.linalg.lstsq(basis.matrices[1], LIMITS.velocity * (speed - speed.mean()), rcond=None)[0])
        made = value(solved(start))
        found.append((made[0], *(made[2] / reference)))
    _, viscous, coulomb = max(found)
    assert_allclose([viscous, coulomb], [0.67, 0.80], atol=0.03)  # a local optimum
