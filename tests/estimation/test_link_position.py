"""The link behind a damped spring, from the motor's angle and the torque."""

import numpy as np
from numpy.testing import assert_allclose

from drake_tc.estimation.link_position import LinkPosition, spring_times


def test_spring_times_give_the_ratio_of_damping_by_eigenvalues():
    c, J, M = np.array([0.005, 0.008]), np.array([0.12, 0.12]), np.array([0.03, 0.5])
    for i, time in enumerate(spring_times(c, J, M)):
        stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]]) / c[i]
        inverse = np.diag([1.0 / J[i], 1.0 / M[i]])
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -time * inverse @ stiffness]])
        root = max(np.linalg.eigvals(A), key=lambda value: value.imag)
        assert_allclose(-root.real / abs(root), 0.05, rtol=1e-6)


def test_link_position_undoes_a_damped_spring():
    """A deflection of our own making, its rate by backward differences as the simulated gear has it."""
    dt, c, time = 1e-3, np.array([0.005, 0.008]), np.array([1.5e-3, 0.0])
    system = LinkPosition(c, time, dt)
    context = system.CreateDefaultContext()
    t = dt * np.arange(200)
    q = np.stack([np.sin(7.0 * t), np.cos(5.0 * t)], axis=1)
    d = 0.05 * np.stack([np.sin(60.0 * t) ** 2, np.cos(90.0 * t)], axis=1)
    rate = np.diff(d, axis=0, prepend=d[:1]) / dt
    for k in range(len(t)):
        system.GetInputPort("motor_angle").FixValue(context, q[k] + d[k])
        system.GetInputPort("torque").FixValue(context, (d[k] + time * rate[k]) / c)
        assert_allclose(system.GetOutputPort("position").Eval(context), q[k], atol=1e-12)
        context.SetDiscreteState(np.array(system.EvalUniquePeriodicDiscreteUpdate(context).value()))
    system.GetInputPort("torque").FixValue(context, [np.nan, 0.0])
    after = system.EvalUniquePeriodicDiscreteUpdate(context).value()
    assert np.isfinite(after).all()
