"""What the rig file declares of the sensors replaces what the log shows of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.logs.rig import parse_rig

from ..rigs import Joint, record

JOINT = Joint(duration=8.0, torque_noise=0.3, encoder_step=1e-5)


def samples(**sensors: float) -> Samples:
    document = {"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 0.3}}
    rig = parse_rig(document | ({"sensors": sensors} if sensors else {}))
    return build_samples([record(JOINT)], rig, "joint", width_s=0.03, final_s=0.03)


def floor(made: Samples) -> float:
    """Noise floor [N m] of a balance with little friction, in which the torque's noise outweighs the encoder's."""
    return float(made.floor.torque(0.0, 0.1, 0.0))


def test_without_a_declaration_the_log_shows_noise_and_step():
    found = samples().resolution
    assert found.torque_noise == pytest.approx(JOINT.torque_noise, rel=0.1)
    assert found.position_step == pytest.approx(JOINT.encoder_step, rel=1e-6)


def test_declared_noise_of_the_torque_replaces_the_estimate():
    one, two = (samples(torque_noise=noise) for noise in (1.0, 2.0))
    assert (one.resolution.torque_noise, two.resolution.torque_noise) == (1.0, 2.0)
    assert floor(two) == pytest.approx(2.0 * floor(one), rel=0.01)
    assert floor(one) == pytest.approx(floor(samples()) / JOINT.torque_noise, rel=0.1)


def test_noise_that_is_declared_as_correlated_leaves_more_behind_the_filters():
    white, slow = samples(torque_noise=0.3), samples(torque_noise=0.3, correlation_time=0.05)
    assert slow.resolution.torque_correlation_time == 0.05
    assert floor(slow) > 2.0 * floor(white)


@pytest.mark.parametrize("memory", [0.0, 0.02])
def test_declared_noise_of_a_torque_on_a_slower_clock_leaves_what_such_noise_leaves(memory):
    every, random = 4, np.random.default_rng(3)
    run = record(JOINT)
    run = replace(run, slower={"joint/torque": every * run.period})
    sensors = {"torque_noise": 0.3} | ({"correlation_time": memory} if memory else {})
    rig = parse_rig({"joint": "joint", "drive": "current", "sensors": sensors})
    made = build_samples([run], rig, "joint", width_s=0.05, final_s=0.05)
    size, stay = 40_000, np.exp(-every * run.period / memory) if memory else 0.0
    own = lfilter([0.3 * np.sqrt(1.0 - stay**2)], [1.0, -stay], random.standard_normal(size))
    noise = np.interp(np.arange(every * (size - 1)), every * np.arange(size), own)
    left = made.kernel.smooth(made.light.smooth(noise))[1000:-1000]
    assert np.sqrt(made.floor.torque_variance) == pytest.approx(np.std(left), rel=0.05)


def test_a_declared_step_of_the_encoder_replaces_the_one_of_the_log():
    coarse = samples(encoder_step=2e-3)
    assert coarse.resolution.position_step == 2e-3
    assert coarse.resolution.position_noise >= 2e-3 / np.sqrt(12.0) * 0.9


def test_declared_noise_of_the_position_adds_to_its_step():
    found = samples(encoder_step=1e-3, position_noise=2e-3).resolution
    assert found.position_noise == pytest.approx(np.hypot(2e-3, 1e-3 / np.sqrt(12.0)), rel=1e-9)
