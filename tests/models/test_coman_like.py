"""The humanoid with springs in its joints: sizes as published, masses possible, left the mirror of right, it stands."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.wiring import add_actuators
from drake_tc.loops.whole_body.references import KnotSpec
from drake_tc.loops.whole_body.running import simulate_tsid, task_errors
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.plant import add_robot, joint_limits, make_plant
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import Status

FOLDER = Path(__file__).resolve().parents[2] / "models" / "coman_like"
ROBOT = load_robot(FOLDER / "coman_like.yaml")
TSID = FOLDER / "coman_like_tsid.yaml"
RATIO, KT, RM, JM, SUPPLY = 100.0, 0.04, 0.6, 1.2e-5, 24.0  # as the head of the actuator file has them
MAKERS = {  # kg, of the makers' model; the head with its camera, forearms with hands, feet with ankles
    "pelvis": 1.80,
    "waist_roll_link": 0.546,
    "waist_pitch_link": 0.754,
    "torso": 6.36,
    "r_hip_pitch_link": 0.893,
    "r_hip_roll_link": 1.025,
    "r_thigh": 1.700,
    "r_shank": 1.410,
    "r_ankle_roll_link": 0.730,
    "r_shoulder_pitch_link": 0.568,
    "r_shoulder_roll_link": 0.777,
    "r_upper_arm": 1.046,
    "r_forearm r_hand": 1.881,
}


@pytest.fixture(scope="module")
def stretched():
    """Plant and context with all joints at zero and the soles on the ground."""
    plant = make_plant(ROBOT, 1e-3)
    context = plant.CreateDefaultContext()
    for name in ROBOT.joints:
        plant.GetJointByName(name).set_angle(context, 0.0)
    pose = ROBOT.base_pose.transform
    plant.SetFreeBodyPose(context, plant.GetBodyByName(ROBOT.base), pose)
    return plant, context


@pytest.fixture(scope="module")
def moved():
    """The centre of mass forwards, over the left foot and down, with ideal torques and no cost on them."""
    return moving({"tasks": {"torque": None}})


def moving(changes):
    motion = {"com": KnotSpec((0.1, 0.8), ((0.0, 0.0, 0.0), (0.02, 0.03, -0.02)))}
    return simulate_tsid(TsidScenario(controller=str(TSID), duration=1.0, motion=motion, changes=changes))


def bodies(plant):
    return [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]


def sole_of(plant, context, mount):
    return plant.GetBodyByName(mount.contact.link).EvalPoseInWorld(context) @ mount.contact.pose.transform


def test_twenty_three_joints_and_31_kg(stretched):
    plant, context = stretched
    assert len(ROBOT.joints) == plant.num_actuators() == 2 * 6 + 3 + 2 * 4
    assert_allclose(plant.CalcTotalMass(context), 31.2, rtol=1e-12)
    for names, mass in MAKERS.items():
        total = sum(plant.GetBodyByName(name).get_mass(context) for name in names.split())
        assert_allclose(total, mass, atol=0.2, err_msg=names)


def test_stretched_it_is_95_cm_high_and_its_hips_are_at_52(stretched):
    plant, context = stretched
    soles = [sole_of(plant, context, mount).translation() for mount in ROBOT.force_torque]
    head = plant.GetBodyByName("head").EvalPoseInWorld(context) @ np.array([0.0, 0.0, 0.0458])
    assert_allclose([head[2] - sole[2] for sole in soles], 0.945, atol=0.002)
    pelvis = plant.GetBodyByName("pelvis").EvalPoseInWorld(context).translation()
    assert_allclose([pelvis[2] - sole[2] for sole in soles], 0.52, atol=0.001)
    assert_allclose(soles[1][1] - soles[0][1], 0.1452, atol=1e-9)


def test_every_inertia_is_possible(stretched):
    """Positive definite with the triangle inequality, for each link by itself, about its own centre."""
    plant, context = stretched
    for body in bodies(plant):
        spatial = body.CalcSpatialInertiaInBodyFrame(context)
        about_com = spatial.Shift(spatial.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        moments = np.sort(np.linalg.eigvalsh(about_com))
        assert moments[0] > 0.0, body.name()
        assert moments[2] <= moments[0] + moments[1], body.name()
        size = np.sqrt(moments.max() / spatial.get_mass())
        assert 0.01 < size < 0.12, body.name()  # radius of gyration of links of 6 to 24 cm


def test_each_link_weighs_like_its_solid(stretched):
    """By quadrature over the visual solid: mass/volume times the integral of r^2 1 - r r^T."""
    plant, context = stretched
    for link in ET.parse(ROBOT.urdf).getroot().findall("link"):
        spatial = plant.GetBodyByName(link.get("name")).CalcSpatialInertiaInBodyFrame(context)
        visual = link.find("visual")
        assert_allclose(spatial.get_com(), [float(x) for x in visual.find("origin").get("xyz").split()], atol=1e-12)
        shape = next(iter(visual.find("geometry")))
        points = solid_points(shape, visual.find("origin").get("rpy"))
        second = points.T @ points / len(points)
        unit = np.trace(second) * np.eye(3) - second
        found = spatial.Shift(spatial.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        assert_allclose(found, spatial.get_mass() * unit, rtol=5e-3, atol=1e-7, err_msg=link.get("name"))


def solid_points(shape, rpy, n=40):
    """Midpoints of equal cells that fill a box, or equal shells and angles of a cylinder along z, or y with `rpy`."""
    middle = (np.arange(n) + 0.5) / n - 0.5
    if shape.tag == "box":
        sides = [float(x) for x in shape.get("size").split()]
        return np.stack(np.meshgrid(*(side * middle for side in sides)), axis=-1).reshape(-1, 3)
    radius, angle = float(shape.get("radius")) * np.sqrt(middle + 0.5), 2.0 * np.pi * middle
    r, a, z = np.meshgrid(radius, angle, float(shape.get("length")) * middle)
    upright = np.stack([r * np.cos(a), r * np.sin(a), z], axis=-1).reshape(-1, 3)
    return upright[:, [0, 2, 1]] if rpy else upright


def test_torque_limits_are_those_of_series_elastic_joints():
    limits = joint_limits(ROBOT)
    assert ((limits.effort >= 30.0) & (limits.effort <= 55.0)).all()
    assert (limits.velocity == 4.0).all()
    assert (limits.upper - limits.lower > 0.5).all()


def test_it_stands_on_both_soles_and_its_centre_of_mass_is_above_them():
    plant = make_plant(ROBOT, 1e-3)
    context = plant.CreateDefaultContext()
    com, law = plant.CalcCenterOfMassPositionInWorld(context), load_law(TSID)
    for mount, contact in zip(ROBOT.force_torque, law.model.contacts, strict=True):
        sole = sole_of(plant, context, mount)
        assert_allclose(sole.translation()[2], 0.0, atol=1e-4)
        assert_allclose(sole.rotation().matrix(), np.eye(3), atol=1e-4)
        corners = law.starting_terms().pose(contact.name)[1] + contact.corners
        assert corners[:, 0].min() + 0.04 < com[0] < corners[:, 0].max() - 0.04
        assert_allclose(corners[:, 2], 0.0, atol=1e-4)
    assert_allclose(com[1], 0.0, atol=1e-9)


def test_forearm_and_hand_weigh_as_one_bar(stretched):
    """A bar of 24 cm, cut at the F/T sensor: its inertia about its own middle."""
    plant, context = stretched
    forearm, hand = (plant.GetBodyByName(f"l_{name}") for name in ("forearm", "hand"))
    joined = forearm.CalcSpatialInertiaInBodyFrame(context)
    joined += hand.CalcSpatialInertiaInBodyFrame(context).Shift(np.array([0.012, 0.0, 0.16]))
    assert_allclose(joined.get_mass(), 1.9, rtol=1e-12)
    assert_allclose(joined.get_com(), [-0.012, 0.0, -0.1], atol=1e-12)
    about = joined.Shift(joined.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    across = 1.9 / 12.0 * (0.06**2 + 0.24**2)
    assert_allclose(about, np.diag([across, across, 1.9 / 12.0 * 2.0 * 0.06**2]), rtol=1e-3, atol=1e-9)


def test_leaning_it_has_both_soles_on_the_ground_and_a_level_forearm():
    leaning = load_robot(FOLDER / "coman_like_leaning.yaml")
    plant = make_plant(leaning, 1e-3)
    context = plant.CreateDefaultContext()
    soles, palm = leaning.force_torque[:2], sole_of(plant, context, leaning.force_torque[2])
    for mount in soles:
        sole = sole_of(plant, context, mount)
        assert_allclose(sole.translation()[2], 0.0, atol=1e-4)
        assert_allclose(sole.rotation().matrix(), np.eye(3), atol=1e-4)
    assert_allclose(palm.rotation().matrix()[:, 2], [-1.0, 0.0, 0.0], atol=1e-4)
    ankle = plant.GetBodyByName("l_ankle").EvalPoseInWorld(context).translation()
    assert ankle[0] < -0.03  # the pelvis is in front of it
    assert palm.translation()[0] > 0.25


def test_the_actuators_are_what_motor_and_gear_make_of_them():
    for name, model in load_models(ROBOT.actuators).items():
        values = {value.key: value.parameters for value in model.effects}
        assert model.drive.kind == "voltage"
        assert_allclose(model.drive.gain, RM / (KT * RATIO), rtol=1e-6, err_msg=name)
        assert_allclose(values["rotor_inertia"]["rotor_inertia"], JM * RATIO**2, rtol=1e-6)
        assert 0.0 < values["viscous"]["viscous"] - (KT * RATIO) ** 2 / RM < 3.0
        assert values["saturation"]["limit"] == SUPPLY
        stiffness = 1.0 / values["elasticity"]["compliance"]
        assert 100.0 <= stiffness <= 300.0
        assert SUPPLY / model.drive.gain > joint_limits(ROBOT).effort[ROBOT.joints.index(name)]


def test_a_joint_without_load_turns_as_fast_as_its_voltage_lets_it():
    """omega = (V/K - tau_co)/(ke kt N^2/Rm + tau_v): an elbow of the welded robot, without gravity."""
    plant = MultibodyPlant(1e-3)
    add_robot(plant, replace(ROBOT, fixed_base=True))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    plant.Finalize()
    builder, volts, elbow = DiagramBuilder(), np.zeros(23), ROBOT.joints.index("r_elbow")
    builder.AddSystem(plant)
    volts[elbow] = -6.0
    models = load_models(ROBOT.actuators)
    actuators = add_actuators(builder, plant, {joint: models[joint] for joint in ROBOT.joints})
    source = builder.AddSystem(ConstantVectorSource(volts))
    builder.Connect(source.get_output_port(), actuators.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    rates = []
    for tick in range(300):
        simulator.AdvanceTo(1e-3 * (tick + 1))
        context = plant.GetMyContextFromRoot(simulator.get_context())
        rates.append(plant.GetJointByName("r_elbow").get_angular_rate(context))
    values = {value.key: value.parameters for value in models["r_elbow"].effects}
    friction = values["viscous"]["viscous"] - (KT * RATIO) ** 2 / RM
    level = values["coulomb"]["coulomb"]
    speed = (6.0 * KT * RATIO / RM - level) / ((KT * RATIO) ** 2 / RM + friction)
    assert_allclose(np.mean(rates[150:]), -speed, rtol=0.02)


def test_with_ideal_torques_it_moves_its_centre_of_mass(moved):
    assert moved.fell is None
    assert moved.status(Status.FALLBACK).max() == 0.0
    assert np.linalg.norm(task_errors(moved)["com"], axis=1).max() < 1e-3
    effort = joint_limits(ROBOT).effort
    assert (np.abs(moved["torque"]) < 0.5 * effort).all()
    velocity = moved["state"][-1, moved.law.model.nq + moved.law.model.actuated]
    assert np.abs(velocity).max() < 1e-2


def test_the_cost_on_torques_buys_smaller_torques_with_a_sag_of_millimetres(moved):
    soft = moving({})
    assert soft.fell is None and soft.status(Status.FALLBACK).max() == 0.0
    assert np.linalg.norm(soft["torque"], axis=1).mean() < 0.99 * np.linalg.norm(moved["torque"], axis=1).mean()
    assert 1e-3 < np.linalg.norm(task_errors(soft)["com"], axis=1).max() < 2e-2


def test_the_cost_of_a_wrench_is_that_of_the_least_forces_at_the_corners():
    """sum of f^2 over the corners, f = pinv(G) w, G their map to the wrench."""
    law = load_law(TSID)
    weight = next(task for task in law.tasks if task.name == "force").weight[:6]
    skews = [np.cross(np.eye(3), corner) for corner in law.model.contacts[0].corners]
    grasp = np.vstack([np.hstack([np.eye(3)] * 4), np.hstack(skews)])
    for wrench in np.random.default_rng(0).normal(size=(5, 6)) * [50, 50, 200, 5, 10, 3]:
        forces = np.linalg.pinv(grasp) @ wrench
        assert_allclose(np.sum((weight * wrench) ** 2), 1e-2 * forces @ forces, rtol=1e-4)


def test_its_feet_carry_its_weight(moved):
    weight = moved["contact_force"].reshape(-1, 2, 6)[-1, :, 2]
    assert_allclose(weight.sum(), 31.2 * 9.81, rtol=0.01)
    assert weight[1] > 1.5 * weight[0] > 0.0  # the centre of mass is over the left foot by now
