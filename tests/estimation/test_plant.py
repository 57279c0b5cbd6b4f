"""The plant of the estimators is cut at the F/T sensors, and leaves nothing behind of the joints that it removes."""

import gc
from pathlib import Path

from pydrake.multibody.tree import WeldJoint

from drake_tc.estimation.plant import build_plant
from drake_tc.robot.robot import load_robot

ROBOT = Path(__file__).resolve().parents[2] / "models" / "hrp2_like" / "hrp2_like.yaml"


def welds_in_python() -> int:
    """Weld joints that Python holds, where Drake's bindings tell the garbage collector (newer releases)."""
    return sum(isinstance(each, WeldJoint) for each in gc.get_objects())


def test_no_removed_joint_stays_in_python():
    """One that stays passes for any later joint that Drake makes at its address, whatever that joint's type is."""
    robot = load_robot(ROBOT)
    gc.collect()
    before = welds_in_python()
    plant = build_plant(robot)
    assert plant.cuts
    gc.collect()
    assert welds_in_python() == before
