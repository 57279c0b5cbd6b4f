"""What a tick of the base estimator costs on the 30-joint robot; printed as rows (run with -s)."""

import time

import numpy as np
import pytest
from estimation.base.constructed import REAL, Motion, construct, spec, walker

from drake_tc.estimation.base_estimator import BaseEstimator, CopEstimator
from drake_tc.estimation.base_kinematics import packed, unpacked

from .machine import require

pytestmark = pytest.mark.benchmark


@pytest.fixture(scope="module")
def made():
    return construct(Motion(duration=2.0, period=2e-3), REAL)


def ticks(estimator, log):
    state = estimator.initial_state(np.array(walker().base_pose.xyz), 0.0)
    samples = [log.sample(i) for i in range(len(log.time))]
    seconds, limited = [], []
    for sample in samples:
        begin = time.perf_counter()
        state = estimator.step(state, sample)
        seconds.append(time.perf_counter() - begin)
        limited.append(bool(state.contact_flags[:, 1].any()))
    return np.array(seconds[20:]), np.array(limited[20:])


def test_a_tick_with_two_soles_is_no_slower_than_its_bound(made):
    estimator = CopEstimator(walker(), spec(2e-3))

    def both():
        seconds, limited = ticks(estimator, made.log)
        assert limited.any()
        return {"tick, closed form": seconds[~limited], "tick, with the QP": seconds[limited]}

    require({"tick, closed form": 50e-6, "tick, with the QP": 160e-6}, both)


def test_the_system_around_it_is_no_slower_than_its_bound(made):
    system = BaseEstimator(walker(), spec(2e-3))
    log = made.log

    def updates():
        context, seconds, packing = system.CreateDefaultContext(), [], []
        for i in range(400):
            values = {
                "position": log.q[i],
                "velocity": log.qd[i],
                "imu": np.concatenate((log.gyro[i], log.accel[i])),
                "imu_tilt": log.tilt[i],
                "wrench": log.wrench[i].ravel(),
            }
            for name, value in values.items():
                system.GetInputPort(name).FixValue(context, value)
            begin = time.perf_counter()
            after = system.EvalUniquePeriodicDiscreteUpdate(context)
            seconds.append(time.perf_counter() - begin)
            context.SetDiscreteState(after.get_vector(0).CopyToVector())
            state = system.base_state(context)
            begin = time.perf_counter()
            unpacked(packed(state), 30, 2)
            packing.append(time.perf_counter() - begin)
        return {"tick of the system": seconds, "packing and unpacking the state": packing}

    require({"tick of the system": 50e-6, "packing and unpacking the state": np.inf}, updates)
