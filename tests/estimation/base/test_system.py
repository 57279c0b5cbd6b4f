"""`BaseEstimator`: ports, what they depend on, and that it is the pure function, tick by tick."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RollPitchYaw
from pydrake.multibody.tree import JacobianWrtVariable

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import BaseEstimator, CopEstimator
from drake_tc.estimation.base_kinematics import (
    CONTACT_FLAGS,
    CONTACT_MEMORY,
    FLAGS,
    SCALARS,
    BaseKinematics,
    initial_state,
    packed,
    place_of,
    unpacked,
)
from drake_tc.estimation.base_log import run_log
from drake_tc.estimation.base_rig import BaseEstimatorSpec, ContactSpec
from drake_tc.kernels.base import state as base_state
from drake_tc.kernels.base.sample import posture_of, turning
from drake_tc.kernels.base.state import size_of
from drake_tc.robot.fields import Mount
from drake_tc.robot.plant import make_plant

from .constructed import REAL, Motion, construct, spec, walker

PERIOD = 5e-3
INPUTS = ("position", "velocity", "imu", "imu_tilt", "wrench", "contact_switch")
OUTPUTS = ("base_pose", "base_velocity", "estimated_state", "cop", "status")


@pytest.fixture(scope="module")
def made():
    return construct(Motion(duration=0.8, period=PERIOD, rest=0.1), REAL, seed=21)


def fixed(system, context, log, i, *, tilt=True):
    values = {
        "position": log.q[i],
        "velocity": log.qd[i],
        "imu": np.concatenate((log.gyro[i], log.accel[i])),
        "wrench": log.wrench[i].ravel(),
    }
    if tilt:
        values["imu_tilt"] = log.tilt[i]
    for name, value in values.items():
        system.GetInputPort(name).FixValue(context, value)


def ticked(system, context):
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context).get_vector(0).CopyToVector())


def outputs(system, context):
    return {name: system.GetOutputPort(name).Eval(context).copy() for name in OUTPUTS}


@pytest.mark.parametrize("tilt", [True, False])
def test_it_is_the_pure_function(made, tilt):
    robot = walker()
    start, yaw = made.truth.position[0], made.truth.rpy[0, 2]
    log = made.log
    if not tilt:
        log = replace(log, tilt=np.full_like(log.tilt, np.nan))
    track = run_log(CopEstimator(robot, spec(PERIOD)), log, start, yaw)
    system = BaseEstimator(robot, spec(PERIOD), position=start, yaw=yaw)
    context = system.CreateDefaultContext()
    plant = make_plant(robot, 0.0)
    for i in range(len(log.time)):
        fixed(system, context, log, i, tilt=tilt)
        ticked(system, context)
        if i % 20:
            continue
        out = outputs(system, context)
        assert_allclose(out["base_pose"][4:], track.position[i], rtol=0, atol=0)
        assert_allclose(out["cop"], track.pressure[i].ravel(), rtol=0, atol=0)
        assert_allclose(out["status"], [*track.flags[i], *track.contact_flags[i].ravel()], rtol=0, atol=0)
        # through the robot's plant: pose and velocity of the base, and the joints in their places
        plant_context = plant.CreateDefaultContext()
        plant.SetPositionsAndVelocities(plant_context, out["estimated_state"])
        base = plant.GetBodyByName(robot.base)
        X = base.EvalPoseInWorld(plant_context)
        assert_allclose(X.translation(), track.position[i], atol=1e-14)
        assert_allclose(X.rotation().matrix(), RollPitchYaw(track.rpy[i]).ToRotationMatrix().matrix(), atol=1e-12)
        V = base.EvalSpatialVelocityInWorld(plant_context)
        assert_allclose(V.translational(), track.velocity[i], atol=1e-14)
        assert_allclose(out["base_velocity"], V.get_coeffs(), atol=1e-14)
        for j, name in enumerate(robot.joints):
            assert plant.GetJointByName(name).GetOnePosition(plant_context) == log.q[i, j]


def test_outputs_come_from_the_state_alone():
    system = BaseEstimator(walker(), spec(PERIOD))
    assert not system.HasAnyDirectFeedthrough()
    context = system.CreateDefaultContext()
    first = outputs(system, context)
    assert_allclose(first["base_pose"], [1, 0, 0, 0, *walker().base_pose.xyz])
    n, k = 30, 2
    state = system.base_state(context)
    moved = packed(state)
    ports = {"position": "base_pose", "velocity": "base_velocity", "q": "estimated_state", "pressure": "cop"}
    for name, port in (ports | {"flags": "status"}).items():
        values = moved.copy()
        getattr(unpacked(values, n, k), name).flat[0] += 0.1  # a view into the vector
        context.SetDiscreteState(values)
        now = outputs(system, context)
        assert np.abs(now[port] - first[port]).max() > 0.01, port


def test_before_the_first_tick_it_shows_where_the_robot_starts():
    """Controllers that read it at once find the robot file's posture, and the pose that was given."""
    system = BaseEstimator(walker(), spec(PERIOD), position=np.array([1.0, 2.0, 0.6]), yaw=0.8)
    out = outputs(system, system.CreateDefaultContext())
    plant = make_plant(walker(), 0.0)
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, out["estimated_state"])
    X = plant.GetBodyByName(walker().base).EvalPoseInWorld(context)
    assert_allclose(X.translation(), [1.0, 2.0, 0.6], atol=1e-14)
    assert_allclose(RollPitchYaw(X.rotation()).vector(), [0.0, 0.0, 0.8], atol=1e-12)
    angles = [plant.GetJointByName(name).GetOnePosition(context) for name in walker().joints]
    assert_allclose(angles, walker().posture, rtol=0)
    assert_allclose(plant.GetVelocities(context), 0.0, atol=0)


def test_inputs_all_count_in_a_tick(made):
    system = BaseEstimator(walker(), spec(PERIOD))
    context = system.CreateDefaultContext()
    for i in range(20):
        fixed(system, context, made.log, i)
        system.GetInputPort("contact_switch").FixValue(context, np.zeros(2))
        ticked(system, context)
    before = context.get_discrete_state(0).CopyToVector()

    def after():
        context.SetDiscreteState(before)
        ticked(system, context)
        return context.get_discrete_state(0).CopyToVector()

    usual = after()
    for name, change in (("position", 1e-3), ("velocity", 1e-2), ("imu", 0.1), ("imu_tilt", 1e-2), ("wrench", 3.0),
                         ("contact_switch", -1.0)):  # fmt: skip
        port = system.GetInputPort(name)
        value = port.Eval(context).copy()
        port.FixValue(context, value + change)
        assert np.nanmax(np.abs(after() - usual)) > 1e-9, name
        port.FixValue(context, value)
    assert_allclose(after(), usual, rtol=0)


def test_two_contexts_do_not_know_of_each_other(made):
    system = BaseEstimator(walker(), spec(PERIOD))
    one, two = system.CreateDefaultContext(), system.CreateDefaultContext()
    fixed(system, one, made.log, 50)
    ticked(system, one)
    fixed(system, two, made.log, 0)
    ticked(system, two)
    alone = system.CreateDefaultContext()
    fixed(system, alone, made.log, 0)
    ticked(system, alone)
    assert_allclose(outputs(system, two)["estimated_state"], outputs(system, alone)["estimated_state"], rtol=0)


def test_a_state_packs_and_unpacks():
    size = packed(initial_state(np.zeros(7), 3, np.zeros(3), 0.0)).size
    vector = np.random.default_rng(0).normal(size=size)
    assert_allclose(packed(unpacked(vector, 7, 3)), vector, rtol=0)


def test_every_number_of_a_state_belongs_to_one_part():
    """Writing each part's own number into it fills the vector, in the order of the parts and without a gap."""
    vector = np.full(size_of(7, 3), -1.0)
    parts = unpacked(vector, 7, 3)
    for number, part in enumerate(parts):
        part[:] = number
    sizes = [part.size for part in parts]
    assert_allclose(vector, np.repeat(np.arange(len(sizes)), sizes), rtol=0)
    assert [part.size for part in (parts.scalars, parts.flags, parts.contacts[0], parts.contact_flags[0])] == [
        len(names) for names in (SCALARS, FLAGS, CONTACT_MEMORY, CONTACT_FLAGS)
    ]
    for name in parts._fields:
        assert_allclose(vector[place_of(name, 7, 3)], np.ravel(getattr(parts, name)), rtol=0)


@pytest.mark.parametrize(
    "names", [SCALARS, CONTACT_MEMORY, FLAGS, CONTACT_FLAGS], ids=["scalars", "contacts", "flags", "contact_flags"]
)
def test_names_stand_where_the_kernels_have_their_places(names):
    """A name is that of its constant; contacts' flags have other constants than columns of the same name."""
    constants = {"on": "TOUCHES", "slip": "SLIPS", "tilt": "TILTED"} if names is CONTACT_FLAGS else {}
    assert [getattr(base_state, constants.get(name, name.upper())) for name in names] == list(range(len(names)))


def test_flags_have_names_of_their_contacts():
    names = BaseEstimator(walker(), spec(PERIOD)).flag_names
    assert len(names) == 9 + 2 * 5
    assert {"yaw_drift", "left/slip", "right/force_offset"} <= set(names)


@pytest.mark.parametrize("method", ["foot_centre", "foot_centre_imu"])
def test_the_baselines_have_the_same_ports(made, method):
    system = BaseEstimator(walker(), spec(PERIOD), method=method)
    context = system.CreateDefaultContext()
    fixed(system, context, made.log, 0)
    ticked(system, context)
    assert np.isfinite(outputs(system, context)["estimated_state"]).all()


def test_kinematics_agree_with_jacobians_of_the_whole_robot():
    """Poses and velocities of contacts against a base that turns: from the robot's plant, by another route."""
    robot, rng = walker(), np.random.default_rng(3)
    kinematics = BaseKinematics(robot, spec(PERIOD).contacts)
    q, qd, rate = rng.uniform(-0.4, 0.4, 30), rng.normal(size=30), rng.normal(size=3)
    posture = turning(posture_of(q, qd, tuple(kinematics.tree)), rate)
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    base, world = plant.GetBodyByName(robot.base).body_frame(), plant.world_frame()
    for name, angle in zip(robot.joints, q, strict=True):
        plant.GetJointByName(name).set_angle(context, angle)
    v = np.zeros(plant.num_velocities())
    X_WB = base.CalcPoseInWorld(context)
    v[:3] = X_WB.rotation().multiply(rate)
    for name, speed in zip(robot.joints, qd, strict=True):
        v[plant.GetJointByName(name).velocity_start()] = speed
    for i, side in enumerate(("l", "r")):
        frame, point = plant.GetFrameByName(f"{side}_foot"), np.array([0.0, 0.0, -0.055])
        J = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, frame, point, world, base)
        X_BF = frame.CalcPose(context, base)
        assert_allclose(posture.position[i], X_BF.multiply(point), atol=1e-12)
        assert_allclose(posture.rotation[i], X_BF.rotation().matrix(), atol=1e-12)
        assert_allclose(posture.rate[i], (J @ v)[:3], atol=1e-12)
        assert_allclose(posture.velocity[i], (J @ v)[3:], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period": 0.0}, "period: expected a positive number"),
        ({"ground": "tilted"}, "ground: expected one of"),
        ({"slip_time": np.nan}, "slip_time: expected"),
        ({"contacts": ()}, "at least one contact"),
    ],
)
def test_impossible_specifications_are_refused(changes, message):
    usual = {"contacts": spec(PERIOD).contacts, "period": PERIOD}
    with pytest.raises(ParamsError, match=message):
        BaseEstimatorSpec(**{**usual, **changes})


@pytest.mark.parametrize(
    ("mount", "sensor", "polygon", "message"),
    [
        (Mount("a", "no_such_link"), None, None, "no link 'no_such_link'"),
        (Mount("a", "l_foot"), "no_sensor", None, "no F/T sensor 'no_sensor'"),
        (Mount("a", "l_shank"), "left_ankle", ((0, 0), (1, 0), (0, 1)), "rigidly above it"),
    ],
)
def test_impossible_contacts_are_refused(mount, sensor, polygon, message):
    contact = ContactSpec(mount, polygon, sensor, 30.0, 20.0)
    with pytest.raises(ParamsError, match=message):
        CopEstimator(walker(), BaseEstimatorSpec((contact,), PERIOD))


def test_a_start_that_is_not_finite_and_an_unknown_method_are_refused():
    with pytest.raises(ParamsError, match="finite start"):
        BaseEstimator(walker(), spec(PERIOD), position=np.array([0.0, np.nan, 0.0]))
    with pytest.raises(ParamsError, match="method: expected one of cop, foot_centre"):
        BaseEstimator(walker(), spec(PERIOD), method="ekf")


def test_hands_are_points_and_carry_too(made):
    """Four contacts, two of them points at the wrists; a wrist that is held on by the switch fixes the base."""
    contacts = spec(PERIOD).contacts + tuple(
        ContactSpec(Mount(f"{s}_hand", f"{s[0]}_hand"), None, f"{s}_wrist", 20.0, 10.0) for s in ("right", "left")
    )
    estimator = CopEstimator(walker(), BaseEstimatorSpec(contacts, PERIOD))
    log = made.log
    state = estimator.initial_state(made.truth.position[0], 0.0)
    wide = replace(log, wrench=np.concatenate([log.wrench, np.zeros_like(log.wrench)], axis=1),
                   switch=np.tile([0.0, 0.0, 0.0, -1.0], (len(log.time), 1)))  # fmt: skip
    touch = wide.wrench.copy()
    touch[:, 2, 0] = 25.0  # across the hand: the length of the force counts
    wide = replace(wide, wrench=touch)
    for i in range(10):
        state = estimator.step(state, wide.sample(i))
    assert state.contacts[:, 0].tolist() == [1.0, 1.0, 1.0, 0.0]
    assert_allclose(state.pressure[2:], 0.0, atol=0.0)
    assert np.linalg.norm(state.position - made.truth.position[9]) < 1e-3
