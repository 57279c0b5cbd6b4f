"""Our own humanoid: sizes as published, every mass possible, left the mirror of right, the leg the same leg."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import BodyIndex, UnitInertia

from drake_tc.actuation.model_file import load_models
from drake_tc.robot.plant import joint_limits, make_plant
from drake_tc.robot.robot import load_robot

FOLDER = Path(__file__).resolve().parents[2] / "models" / "hrp2_like"
FULL, LEG = load_robot(FOLDER / "hrp2_like.yaml"), load_robot(FOLDER / "hrp2_like_leg.yaml")
TABLE_1 = {  # 10^3 K_tau [rad/(N m)], 10^3 K_v [rad/(rad/s)]
    "hip_yaw": (0.212, 13.0),
    "hip_roll": (0.030, 6.332),
    "hip_pitch": (0.12, 7.0),
    "knee": (0.051, 6.561),
    "ankle_pitch": (0.177, 7.698),
    "ankle_roll": (0.240, 6.0),
}


def solids():
    """(link name, <visual> element) of every link."""
    root = ET.parse(FULL.urdf).getroot()
    return [(link.get("name"), link.find("visual")) for link in root.findall("link")]


def stretched():
    """Plant and context with all joints at zero and the soles on the ground."""
    plant = make_plant(FULL, 1e-3)
    context = plant.CreateDefaultContext()
    positions = plant.GetPositions(context)
    positions[[plant.GetJointByName(name).position_start() for name in FULL.joints]] = 0.0
    plant.SetPositions(context, positions)
    return plant, context


def test_thirty_joints_and_58_kg():
    plant = make_plant(FULL, 1e-3)
    assert len(FULL.joints) == plant.num_actuators() == 30
    assert_allclose(plant.CalcTotalMass(plant.CreateDefaultContext()), 58.0, rtol=1e-12)


def test_stretched_it_is_154_cm_high():
    plant, context = stretched()
    ends = []
    for name, visual in solids():
        box = visual.find("geometry/box")
        if name in ("head", "r_foot", "l_foot"):
            height = float(box.get("size").split()[2])
            centre = np.array([float(x) for x in visual.find("origin").get("xyz").split()])
            z = (plant.GetBodyByName(name).EvalPoseInWorld(context) @ centre)[2]
            ends += [z - height / 2, z + height / 2]
    assert_allclose(max(ends) - min(ends), 1.54, atol=0.005)


def test_it_stands_on_both_soles_and_its_centre_of_mass_is_above_them():
    plant = make_plant(FULL, 1e-3)
    context = plant.CreateDefaultContext()
    com = plant.CalcCenterOfMassPositionInWorld(context)
    for mount in FULL.force_torque[:2]:
        sole = plant.GetBodyByName(mount.contact.link).EvalPoseInWorld(context) @ mount.contact.pose.transform
        assert_allclose(sole.translation()[2], 0.0, atol=1e-4)
        assert_allclose(sole.rotation().matrix(), np.eye(3), atol=1e-4)
        heel, toe = sole.translation()[0] + 0.03 - 0.115, sole.translation()[0] + 0.03 + 0.115
        assert heel + 0.03 < com[0] < toe - 0.03
    assert_allclose(com[1], 0.0, atol=1e-9)
    assert 0.7 < com[2] < 0.9


def test_each_link_weighs_like_its_solid():
    plant, _ = stretched()
    context = plant.CreateDefaultContext()
    for name, visual in solids():
        body = plant.GetBodyByName(name)
        spatial = body.CalcSpatialInertiaInBodyFrame(context)
        assert spatial.IsPhysicallyValid()
        shape = next(iter(visual.find("geometry")))
        if shape.tag == "box":
            unit = UnitInertia.SolidBox(*(float(x) for x in shape.get("size").split()))
        else:
            unit = UnitInertia.SolidCylinder(float(shape.get("radius")), float(shape.get("length")), [0, 0, 1])
        origin = {key: [float(x) for x in value.split()] for key, value in visual.find("origin").attrib.items()}
        turned = unit.CopyToFullMatrix3()
        if "rpy" in origin:  # cylinders across the body: their axis is y
            assert_allclose(origin["rpy"], [np.pi / 2, 0, 0], atol=1e-15)
            turned = turned[np.ix_([0, 2, 1], [0, 2, 1])]
        about_com = spatial.Shift(spatial.get_com())
        assert_allclose(spatial.get_com(), origin["xyz"], atol=1e-12)
        expected = spatial.get_mass() * turned
        assert_allclose(about_com.CalcRotationalInertia().CopyToFullMatrix3(), expected, rtol=2e-4, atol=1e-6)


def test_the_leg_is_the_right_leg_of_the_whole():
    leg, (full, context) = make_plant(LEG, 1e-3), stretched()
    still = leg.CreateDefaultContext()
    leg.SetPositions(still, np.zeros(6))
    shift = leg.GetBodyByName("waist").EvalPoseInWorld(still).translation()
    shift = shift - full.GetBodyByName("waist").EvalPoseInWorld(context).translation()
    for i in range(1, leg.num_bodies()):
        name = leg.get_body(BodyIndex(i)).name()
        pair = [(p.GetBodyByName(name), c) for p, c in ((leg, still), (full, context))]
        inertias = [body.CalcSpatialInertiaInBodyFrame(c).CopyToFullMatrix6() for body, c in pair]
        assert_allclose(inertias[0], inertias[1], atol=1e-15)
        places = [body.EvalPoseInWorld(c).translation() for body, c in pair]
        assert_allclose(places[0] - shift, places[1], atol=1e-12)
    models, whole = load_models(LEG.actuators), load_models(FULL.actuators)
    assert list(models) == list(LEG.joints)
    assert list(whole) == [name for name in whole if name in FULL.joints]
    assert set(whole) == set(FULL.joints)
    ours, theirs = joint_limits(LEG), joint_limits(FULL)
    for i, name in enumerate(LEG.joints):
        j = FULL.joints.index(name)
        assert (models[name].drive, models[name].effects) == (whole[name].drive, whole[name].effects)
        for field in ("effort", "velocity", "lower", "upper"):
            assert getattr(ours, field)[i] == getattr(theirs, field)[j]


def test_the_hanging_leg_reaches_no_ground():
    plant = make_plant(LEG, 1e-3)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(6))
    mount = LEG.force_torque[0]
    sole = plant.GetBodyByName(mount.contact.link).EvalPoseInWorld(context) @ mount.contact.pose.transform
    assert_allclose(sole.translation()[2], 0.3, atol=1e-9)


@pytest.mark.parametrize("joint", TABLE_1)
def test_the_legs_actuators_are_those_of_table_1(joint):
    model = load_models(LEG.actuators)[f"r_{joint}"]
    values = {value.key: value.parameters for value in model.effects}
    k_tau, k_v = TABLE_1[joint]
    assert model.drive.kind == "position_servo"
    assert_allclose(1e3 * model.drive.gain, k_tau, rtol=1e-12)
    assert_allclose(1e3 * model.drive.gain * values["viscous"]["viscous"], k_v, rtol=1e-4)
    keys = [value.key for value in model.effects]
    assert keys.index("velocity_sign_switch") < keys.index("deadzone")
    assert 2e-4 <= values["deadzone"]["deadzone"] <= 5e-4
    assert 0.1 <= values["rotor_inertia"]["rotor_inertia"] <= 1.5
