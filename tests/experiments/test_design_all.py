"""The goal `all` states the sizes that the check states, and none where no motion shows an effect."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drake_tc.experiments.check.joint import joint_effects
from drake_tc.experiments.design.default_motion import default_motion
from drake_tc.experiments.design.found_sizes import found_from
from drake_tc.experiments.design.goal import criterion_of, parse_goal
from drake_tc.experiments.design.joint import LogColumns, MotionColumns
from drake_tc.experiments.design.known import joint_from_logs
from drake_tc.experiments.design.run import DesignOptions, design_joint
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig


@pytest.fixture(scope="module")
def known(demo):
    rig = load_rig(demo[0])
    return joint_from_logs(rig, load_runs(demo[1], rig), rig.joints[0])


def test_the_sizes_of_the_logs_are_those_of_the_check(known):
    joint, _, prepared = known
    criterion = criterion_of(parse_goal("all"), joint, 30.0)
    columns = LogColumns(joint, prepared.train)
    checked = {each.key: each.smallest for each in joint_effects(prepared).effects}
    noise = criterion.noise(columns.joint, columns.seconds)
    found = {form.effect.key: found_from(form, columns, noise) for form in criterion.forms}
    assert {"load_dependent_friction", "deadzone", "saturation", "delay.loop", "stribeck"} <= set(found)
    for key, size in found.items():
        smallest = checked[key] if checked[key] > 0.0 else math.inf
        # the check adds the drive gain's column only where it is free, and solves by QR instead of by a singular value
        assert size == pytest.approx(smallest, rel=1e-5), key


def test_an_effect_that_the_declared_model_imitates_has_no_size(known):
    """Without gravity a sensor's bias is a constant, which an asymmetry of the sliding friction does not contain."""
    joint, limits, _ = known
    still = replace(joint, gravity=0.0, link_inertia=0.0, constant=0.0)
    columns = MotionColumns(still, default_motion(still, limits, 10.0, 5e-3), 5e-3)
    criterion = criterion_of(parse_goal("all"), still, 10.0)
    form = next(each for each in criterion.forms if each.effect.key == "load_dependent_friction")
    assert found_from(form, columns, criterion.noise(columns.joint)) == math.inf


def test_the_page_names_the_effects_without_a_size(known):
    joint, limits, _ = known
    still = replace(joint, gravity=0.0, link_inertia=0.0, constant=0.0)
    design = design_joint(still, limits, parse_goal("all"), DesignOptions(duration=10.0, starts=0))
    assert any("shows no size" in text and "load_dependent_friction" in text for text in design.sentences)
    values = [each.after for each in design.expected]
    assert all(value == math.inf or value < 1e6 for value in values), values
    assert np.isinf(values).any()
    saturation = next(each for each in design.expected if "saturation" in each.name)
    assert saturation.name == "largest saturation that is found"
