"""From a run in memory to the actuator it was made with."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import IdentificationError
from drake_tc.identification.actuator import ratio_interval
from drake_tc.identification.identify import identify
from drake_tc.logs.record import Run
from drake_tc.logs.rig import parse_rig

INERTIA, K_TAU, K_V, K_C = 0.31, 4e-4, 9e-3, 2e-3


def bench_run(name, *, noise=0.0, seed=0, load="torque"):
    """A pendulum in a growing sinusoid, pushed by hand the while; everything in closed form."""
    t = np.arange(12_000) * 1e-3
    w, envelope = 2 * np.pi * 0.7, 0.1 + 0.05 * t
    q = envelope * np.sin(w * t)
    v = 0.05 * np.sin(w * t) + envelope * w * np.cos(w * t)
    a = 0.1 * w * np.cos(w * t) - envelope * w**2 * np.sin(w * t)
    push = 25.0 * np.sin(2 * np.pi * 1.3 * t)
    tau = 0.025 * a + 4.905 * np.sin(q) + (push if load == "torque" else 0.0)
    effort = K_TAU * (tau + INERTIA * a) + K_V * v + K_C * np.sign(v)
    effort = effort + noise * np.random.default_rng(seed).normal(size=t.size)
    columns = {"knee/position": q, "knee/position_command": q + effort, "knee/torque": tau}
    segment = np.where(np.arange(t.size) < 7000, 0, 1)
    return Run(name, None, t, 1e-3, columns, segment)


RIG = parse_rig({"joint": "knee", "drive": "position_servo", "declared": {"rotor_inertia": INERTIA}})


def test_least_squares_finds_the_actuator():
    result = identify([bench_run("a")], RIG)
    # every channel passed the same filter: without noise nothing but rounding is left
    assert_allclose([result.parameters[k] for k in ("K_tau", "K_v", "K_c")], [K_TAU, K_V, K_C], rtol=1e-9)
    assert result.rms < 1e-12
    assert result.runs == ("a",)


def test_a_pendulum_stands_in_for_the_torque_column():
    pendulum = {"pendulum": {"mass": 1.0, "length": 0.5, "inertia": 0.025}}
    rig = parse_rig(
        {"joint": "knee", "drive": "position_servo", "load": pendulum, "declared": {"rotor_inertia": INERTIA}}
    )
    run = bench_run("a", load="pendulum")
    result = identify([run], rig, width_s=0.02)
    assert_allclose([result.parameters[k] for k in ("K_tau", "K_v", "K_c")], [K_TAU, K_V, K_C], rtol=2e-2)


@pytest.mark.parametrize("method", ["least_squares", "asymmetric", "two_stage"])
def test_every_linear_method_is_near_and_states_an_interval(method):
    runs = [bench_run(n, noise=2e-4, seed=s) for s, n in enumerate("ab")]
    result = identify(runs, RIG, method, joint="knee")
    truth = {"K_tau": K_TAU, "K_v": K_V, "K_c": K_C}
    for name, value in truth.items():
        # asymmetric: shrunk by about the noise; two_stage: some friction below the speed taken as rest
        assert_allclose(result.parameters[name], value, rtol=0.02)
        low, high = result.intervals[name]
        assert low < result.parameters[name] < high


def test_piecewise_names_its_pieces():
    result = identify([bench_run("a", noise=1e-4)], RIG, "piecewise")
    assert {"forward.tau_1", "backward.k_2"} <= set(result.parameters)
    assert result.residual.size > 10_000


def test_refusals():
    with pytest.raises(IdentificationError, match="no joint 'hip'"):
        identify([bench_run("a")], RIG, joint="hip")
    with pytest.raises(IdentificationError, match="possible: least_squares"):
        identify([bench_run("a")], RIG, "lasso")  # type: ignore[arg-type]
    with pytest.raises(IdentificationError, match="longer than the smoothing kernel"):
        identify([bench_run("a")], RIG, width_s=20.0)
    run = bench_run("a")
    bare = Run("a", None, run.time, 1e-3, {"knee/position": run.columns["knee/position"]}, run.segment)
    with pytest.raises(IdentificationError, match="knee/torque"):
        identify([bare], RIG)


@pytest.mark.parametrize("correlation", [-0.8, 0.8])
def test_the_interval_of_a_ratio_is_that_of_drawn_pairs(correlation):
    x, k, dx, dk = 0.5, -2.0, 0.005, 0.02  # one per cent each: of first order
    covariance = [[dx**2, correlation * dx * dk], [correlation * dx * dk, dk**2]]
    drawn = np.random.default_rng(0).multivariate_normal([x, k], covariance, 100_000)
    around = [(mean - 1.96 * d, mean + 1.96 * d) for mean, d in ((x, dx), (k, dk))]
    low, high = ratio_interval(around[0], x, around[1], k, correlation)
    assert_allclose(0.5 * (low + high), x / k, rtol=1e-12)
    # a deviation of as many draws scatters by 0.2 %
    assert_allclose(0.5 * (high - low), 1.96 * np.std(drawn[:, 0] / drawn[:, 1]), rtol=0.02)
