"""The noise that a design expects of its run is the one that a diagnosis of such a run has."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.experiments.design.default_motion import default_motion
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.noise import measured_as
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig


@pytest.fixture(scope="module")
def known(demo):
    rig = load_rig(demo[0])
    return joint_from_logs(rig, load_runs(demo[1], rig), rig.joints[0])


def test_a_recorded_motion_has_the_filters_and_the_noise_of_its_log(demo):
    rig = load_rig(demo[0])
    joint, _, prepared = joint_from_logs(rig, load_runs(demo[1][:1], rig), rig.joints[0])
    s, margin = prepared.train.samples.signals, prepared.train.samples.light.margin
    kept = slice(margin, len(s) - margin)  # the ends owe their filters something
    motion = np.stack([s.position[kept], s.velocity[kept], s.acceleration[kept], np.zeros(len(s) - 2 * margin)])
    found = measured_as(joint, motion, s.period)
    # one step of the widths that are tried is a factor of 1.25
    assert_allclose([found.kernel_width, found.final_width], [joint.kernel_width, joint.final_width], rtol=0.26)
    assert_allclose(found.floor, joint.floor, rtol=0.25)


def test_a_faster_motion_is_filtered_less_and_is_noisier(known):
    joint, _, _ = known
    slow, fast = (
        measured_as(joint, default_motion(joint, JointLimits((-0.5, 0.5), v, 8.0 * v), 20.0, 1e-3), 1e-3)
        for v in (0.3, 3.0)
    )
    assert fast.kernel_width < slow.kernel_width and fast.floor > slow.floor
    assert fast.independent_per_second > slow.independent_per_second
    assert_allclose(fast.noise**2 - fast.floor**2, joint.noise**2 - joint.floor**2, rtol=1e-9, atol=1e-12)


def test_without_a_log_nothing_is_known_of_the_sensors(known):
    joint = replace(known[0], resolution=None)
    assert measured_as(joint, np.zeros((4, 10)), 1e-3) is joint
