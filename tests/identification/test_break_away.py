"""Static friction from break-away events: a closed form, and a simulated joint that sticks over a wide band."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.identification.break_away import break_away
from drake_tc.logs.rig import parse_rig
from drake_tc.loops.joint_bench import BenchScenario, Table, record_bench


def test_a_ramp_that_ends_in_motion_gives_its_last_value():
    motor = np.concatenate([np.linspace(0, 5, 101), np.full(50, 5.0), np.linspace(5, -7, 241), np.full(50, -7.0)])
    moving = np.zeros(motor.size, dtype=bool)
    moving[101:151], moving[392:] = True, True
    velocity = np.where(moving, np.sign(motor), 0.0)
    found = break_away(motor, np.full(motor.size, 1.0), velocity, moving, least_rest=20)
    assert found.index.tolist() == [100, 391]
    assert_allclose(found.direction, [1.0, -1.0])
    assert_allclose(found.torque, [4.0, 8.0])  # motor torque less the load of 1 N m, along the motion
    assert_allclose(found.level, 6.0)
    assert found.interval == (-np.inf, np.inf)  # two events bound no median


def test_a_short_rest_is_no_event():
    moving = np.ones(100, dtype=bool)
    moving[40:50] = False
    assert break_away(np.ones(100), np.zeros(100), np.ones(100), moving, least_rest=20).index.size == 0


@pytest.mark.parametrize("excess", [0.0, 6.0])
def test_a_joint_that_sticks_breaks_away_at_its_static_friction(excess):
    gain, coulomb = 0.08, 3.0
    values = {
        "rotor_inertia": {"rotor_inertia": 0.3},
        "viscous": {"viscous": 6.0},
        "coulomb": {"coulomb": coulomb},
        "static_friction": {"static_excess": excess, "break_away_speed": 0.01},
    }
    model = ActuatorModel("joint", Drive("current", gain), tuple(EffectValue(k, p) for k, p in values.items()))
    bench = BenchScenario(duration=25.0, log_period=2e-3, step=1e-3, link_inertia=0.3, gravity_moment=8.0)
    time = np.arange(25_001) * 1e-3
    ramp = gain * 14.0 * (2.0 / np.pi) * np.arcsin(np.sin(2 * np.pi * time / 5.0))
    run = record_bench(model, Table(time, ramp), bench)
    rig = parse_rig({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 0.3}})
    samples = build_samples([run], rig, "joint", width_s=0.02)
    s = samples.signals
    needed = s.load_torque + 0.3 * s.acceleration + 6.0 * s.velocity
    found = break_away(s.effort / gain, needed, s.velocity, samples.moving, least_rest=100)
    assert found.index.size >= 6
    # the ramp rises by 11 N m/s, and the filters blur the instant by some 10 ms
    assert_allclose(found.level, coulomb + excess, atol=0.3)
    low, high = found.interval
    assert low - 0.2 <= coulomb + excess <= high + 0.2
