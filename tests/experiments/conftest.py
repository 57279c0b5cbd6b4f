"""A short recording of the demo's rig: a servo joint whose owner declares its rotor's inertia and its friction."""

from pathlib import Path

import pytest

from drake_tc.cli.demo import DemoLength, record_demo
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.effects.library import effect
from drake_tc.experiments.check.effects import JointEffects, joint_effects
from drake_tc.experiments.design import known
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig

LOOKED_FOR = tuple(
    map(
        effect,
        (
            *("stribeck", "deadzone", "quadratic_viscous", "load_dependent_friction", "cable_spring", "payload"),
            *("torque_sensor_drift", "torque_sensor_bias", "asymmetric_friction", "asymmetric_friction.coulomb"),
            *("effort_bias", "backlash", "delay.command", "thermal_friction"),
        ),
    )
)
"""What the joint lacks, and some of each kind: imitated by others, found by shape, and beyond what is recorded."""


@pytest.fixture(scope="session")
def demo(tmp_path_factory) -> tuple[Path, list[Path], list[Path]]:
    return record_demo(tmp_path_factory.mktemp("demo"), 0, DemoLength(duration=8.0, period=4e-3, step=1e-3), jobs=1)


@pytest.fixture(scope="session")
def prepared(demo) -> Prepared:
    rig = load_rig(demo[0])
    return prepare_joint(load_runs(demo[1], rig), [], rig, rig.joints[0])


@pytest.fixture(scope="session")
def checked(prepared) -> JointEffects:
    """What the recording shows of `LOOKED_FOR`."""
    return joint_effects(prepared, LOOKED_FOR)


@pytest.fixture(scope="session")
def logged(demo, checked) -> tuple[DesignJoint, JointLimits]:
    """The joint as the recording shows it, and the limits that it kept; its search is the one of `checked`."""
    rig = load_rig(demo[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(known, "fitted_joint", lambda prepared: checked.fitted)
        return known.joint_from_logs(rig, load_runs(demo[1], rig), rig.joints[0])[:2]
