"""The goal `all` states sizes, and none where no motion shows an effect."""

import math
from dataclasses import replace

import numpy as np

from drake_tc.experiments.design.goal import criterion_of, parse_goal
from drake_tc.experiments.design.lead import default_motion
from drake_tc.experiments.design.next_log import PlannedRun, next_log
from drake_tc.experiments.design.run import DesignOptions, design_joint


def test_an_effect_that_the_declared_model_imitates_has_no_size(logged):
    """Without any load there is no friction that depends on it."""
    joint, limits = logged
    still = replace(joint, gravity=0.0, link_inertia=0.0, constant=0.0, resolution=None)
    fitted = next_log([PlannedRun("run", still, default_motion(still, limits, 10.0, 1e-3), 1e-3)])
    found = criterion_of(parse_goal("all"), still).worth(fitted)
    sizes = {name: size for name, _, size in found.values}
    assert sizes["smallest load_dependent_friction that is found"] == math.inf
    assert math.isfinite(sizes["smallest stribeck that is found"])


def test_the_page_names_the_effects_without_a_size(logged):
    joint, limits = logged
    still = replace(joint, gravity=0.0, link_inertia=0.0, constant=0.0, resolution=None)
    design = design_joint(still, limits, parse_goal("all"), DesignOptions(duration=10.0, starts=1, iterations=0))
    assert any("no size" in text and "load_dependent_friction" in text for text in design.sentences)
    values = [each.after for each in design.expected]
    assert all(value == math.inf or value < 1e6 for value in values), values
    assert np.isinf(values).any()
    saturation = next(each for each in design.expected if "saturation" in each.name)
    assert saturation.name == "largest saturation that is found"
