"""What stands in for an IMU, for F/T sensors and contacts in Faraji et al. (2015)'s loop."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import ParamsError
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.plant import make_plant
from drake_tc.sensing.spec import SensorFault
from drake_tc.sensor_validation.body_sensors import SETTLED, ValidatedImu, ValidatedWrench
from drake_tc.sensor_validation.standing_feet import TILT_TIME, StandingFeet
from drake_tc.tsid.configuration import load_law

FILE = Path(__file__).resolve().parents[2] / "diagrams" / "coman.scenario.yaml"
DT = 1e-3


def step(system, context):
    after = system.EvalUniquePeriodicDiscreteUpdate(context)
    context.SetTime(context.get_time() + DT)
    for group in range(after.num_groups()):
        context.SetDiscreteState(group, np.array(after.value(group)))


def imu_run(samples, flagged=None, jolts=None):
    """(T, 6) what is given, (T,) whether left out, of samples that begin `SETTLED` after the start."""
    system = ValidatedImu(np.repeat([0.3, 1.5], 3), 1, 2, DT)
    context, found, out = system.CreateDefaultContext(), [], []
    context.SetTime(SETTLED)
    for k, sample in enumerate(samples):
        system.GetInputPort("imu").FixValue(context, sample)
        system.GetInputPort("flagged").FixValue(context, [0.0 if flagged is None else flagged[k]])
        system.GetInputPort("jolt").FixValue(context, np.zeros(2) if jolts is None else jolts[k])
        found.append(system.GetOutputPort("reading").Eval(context).copy())
        out.append(system.GetOutputPort("left_out").Eval(context)[0])
        step(system, context)
    return np.array(found), np.array(out)


def standing_imu(ticks):
    noise = np.random.default_rng(3).normal(size=(ticks, 6)) * np.repeat([5e-3, 0.05], 3)
    return noise + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.81])


def test_an_imu_that_jumps_is_left_out_until_it_is_back():
    samples = standing_imu(900)
    samples[200:500, 3] += 3.0
    found, _ = imu_run(samples)
    assert_array_equal(found[:200], samples[:200])
    assert np.isnan(found[200:500]).all()
    # its mean is back to half of 1.5 m/s^2 after T ln(3/0.75)
    back = 500 + 50.0 * np.log(4.0)
    assert np.isnan(found[500 : int(back) - 15]).all()
    assert_array_equal(found[int(back) + 15 :], samples[int(back) + 15 :])


def test_a_jump_that_feet_feel_too_is_true():
    """Felt before it, with it or within 20 ms: believed from then on; felt later than that: left out as if not."""
    samples = standing_imu(400)
    samples[200:, 3] += 3.0
    for first, left_out in ((190, range(0)), (200, range(0)), (205, range(200, 206)), (225, range(200, 400))):
        jolts = np.zeros((400, 2))
        jolts[first : first + 30, 1] = 1.0
        found, _ = imu_run(samples, jolts=jolts)
        assert_array_equal(np.flatnonzero(np.isnan(found).all(axis=1)), np.array(left_out, dtype=int))


@pytest.mark.parametrize(("long", "left_out"), [(1, 2), (15, 16), (40, None)])
def test_a_jump_that_is_soon_over_costs_its_own_samples(long, left_out):
    """A bad sample or a short hit, in a gyro that turns on at 10 rad/s^2; a long one is left out for 0.1 s and more."""
    samples = standing_imu(500)
    samples[:, 2] += 0.01 * np.arange(500)
    samples[200 : 200 + long, 4] += 5.0
    found, _ = imu_run(samples)
    lost = np.isnan(found).all(axis=1)
    assert lost[200 : 200 + long].all() and not lost[:200].any()
    assert lost.sum() == left_out if left_out else lost.sum() >= 100


def test_a_contact_of_which_nothing_is_told_goes_by_its_load():
    system = ValidatedWrench(2, 1, (0, 1), DT)
    context = system.CreateDefaultContext()
    for name, value in (("wrench", np.ones(12)), ("flagged", [0.0, 1.0]), ("contacts", [np.nan, 1.0])):
        system.GetInputPort(name).FixValue(context, value)
    assert_array_equal(system.GetOutputPort("contacts").Eval(context), [1.0, 2.0])


def test_an_imu_that_stays_off_stays_out_and_flags_and_nan_leave_it_out_at_once():
    samples = standing_imu(600)
    samples[100:, 5] += 3.0
    samples[50] = np.nan
    flagged = np.zeros(600)
    flagged[70:80] = 1.0
    found, out = imu_run(samples, flagged)
    lost = np.isnan(found).all(axis=1)
    assert_array_equal(np.flatnonzero(lost), [50, *range(70, 80), *range(100, 600)])
    assert out[101:].all()


def test_an_f_t_sensor_that_is_lost_repeats_its_last_good_reading_and_its_contact_is_kept():
    system = ValidatedWrench(2, 2, (1, 0, 1), DT)  # the first contact's load is the second sensor's
    context = system.CreateDefaultContext()
    good = np.arange(12.0)
    ports = {name: system.GetInputPort(name) for name in ("wrench", "flagged", "contacts")}
    ports["wrench"].FixValue(context, good)
    ports["flagged"].FixValue(context, np.zeros(4))
    ports["contacts"].FixValue(context, [1.0, 1.0, 0.0])
    reading, contacts = system.GetOutputPort("reading"), system.GetOutputPort("contacts")
    assert_array_equal(reading.Eval(context), good)
    assert_array_equal(contacts.Eval(context), [1.0, 1.0, 0.0])
    step(system, context)
    lost = 2.0 * good
    lost[8] = np.nan
    ports["wrench"].FixValue(context, lost)
    assert_array_equal(reading.Eval(context), [*lost[:6], *good[6:]])
    assert_array_equal(contacts.Eval(context), [2.0, 1.0, 0.0])  # the third is lifted: it stays off
    ports["flagged"].FixValue(context, [0.0, 1.0, 0.0, 0.0])
    assert_array_equal(reading.Eval(context), good)
    assert_array_equal(contacts.Eval(context), [2.0, 2.0, 0.0])


@pytest.fixture(scope="module")
def law():
    scenario = TsidScenario.load(FILE, "stand")
    return load_law(scenario.path(scenario.controller), scenario.changes)


def feet_of(law, tilt):
    """The system, and a context in which the whole robot is tilted by `tilt` [rad] about x, at rest."""
    robot = law.model.robot
    plant = make_plant(robot, 0.0)
    mine = plant.CreateDefaultContext()
    q = plant.GetPositions(mine).copy()
    for joint, angle in zip(robot.joints, robot.posture, strict=True):
        q[plant.GetJointByName(joint).position_start()] = angle
    q[:4] = [np.cos(0.5 * tilt), np.sin(0.5 * tilt), 0.0, 0.0]
    v = np.zeros(plant.num_velocities())
    system = StandingFeet(robot, law.model.contacts, range(k := len(law.model.contacts)), np.full((k, 2), 2e-3), DT)
    context = system.CreateDefaultContext()
    system.GetInputPort("estimated_state").FixValue(context, np.concatenate([q, v]))
    system.GetInputPort("cop").FixValue(context, np.zeros(2 * k))
    system.GetInputPort("link_angle").FixValue(context, np.array(robot.posture))
    system.GetInputPort("wrench").FixValue(context, np.tile([0.0, 0.0, 150.0, 0.0, 0.0, 0.0], len(robot.force_torque)))
    return system, context


def test_feet_say_how_the_base_is_tilted_where_no_imu_does(law):
    """Soles loaded in the middle are flat in truth; an estimate 0.1 rad off goes over to that at dt/T a tick."""
    system, context = feet_of(law, 0.1)
    system.GetInputPort("imu").FixValue(context, np.zeros(6))
    tilt = system.GetOutputPort("imu_tilt")
    assert np.isnan(tilt.Eval(context)).all()
    system.GetInputPort("imu").FixValue(context, np.full(6, np.nan))
    assert_allclose(tilt.Eval(context), [0.1 * (1.0 - DT / TILT_TIME), 0.0], atol=2e-5)
    # loaded at (20, -5) mm, soles tilt by 2e-3 x 150 x those: the base with them, forwards and to the right
    system.GetInputPort("cop").FixValue(context, np.tile([0.02, -0.005], len(law.model.contacts)))
    for _ in range(100):  # until the tilts are at rest
        step(system, context)
    roll, pitch = tilt.Eval(context)
    assert_allclose(pitch, 6e-3 * DT / TILT_TIME, rtol=0.02)
    assert_allclose(roll, 0.1 + (1.5e-3 - 0.1) * DT / TILT_TIME, atol=2e-5)
    reading = system.GetOutputPort("reading")
    assert_allclose(reading.Eval(context)[:3], 0.0, atol=1e-9)
    # the load moves: 20 ms later the low pass has 1 - 1/e of a step in tilt, over 20 ms that is the rate
    system.GetInputPort("cop").FixValue(context, np.tile([0.03, -0.005], len(law.model.contacts)))
    for _ in range(4):
        step(system, context)
    found = reading.Eval(context)
    assert_allclose(found[1], 3e-3 / 0.02 * np.exp(-1.0), rtol=0.02)  # pitching forwards
    assert np.isnan(found[3:]).all()


def test_a_gyro_that_turns_standing_feet_is_flagged_in_time(law):
    """1 deg/s: s = b (1 - exp(-t/T)) reaches 11 mrad/s after 30 ms, at the sixth look of 5 ms or the seventh."""
    system, context = feet_of(law, 0.0)
    system.GetInputPort("imu").FixValue(context, np.zeros(6))
    step(system, context)
    state = np.array(system.GetInputPort("estimated_state").Eval(context))
    joints = len(law.model.robot.joints)
    state[-joints - 4] = np.deg2rad(1.0)  # of the base, about the vertical: [q; omega; v; joints]
    system.GetInputPort("estimated_state").FixValue(context, state)
    flags = []
    for _ in range(8):
        step(system, context)
        flags.append(system.GetOutputPort("flag").Eval(context)[0])
    assert flags[:5] == [0.0] * 5
    assert flags[6:] == [1.0] * 2
    # a waist that turns is no foot that does; nor is anything said of a robot that moves
    state[-joints - 4] = 0.0
    system.GetInputPort("estimated_state").FixValue(context, state)
    for k in range(60):
        angles = np.array(law.model.robot.posture)
        angles[law.model.robot.joints.index("waist_yaw")] = 2e-4 * k
        angles[0] = 0.02 * k if k > 50 else angles[0]
        system.GetInputPort("link_angle").FixValue(context, angles)
        step(system, context)
    assert system.GetOutputPort("flag").Eval(context)[0] == 0.0


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        (
            {"lidar": ()},
            "faults: no sensor 'lidar'; possible: encoder, motor_encoder, gauge, imu, force_torque, contacts",
        ),
        ({"imu": (SensorFault("nan"),)}, "faults: expected state: base_estimator and torque: series_elastic beside it"),
    ],
)
def test_faults_that_cannot_be_are_refused(faults, message):
    with pytest.raises(ParamsError, match=message):
        TsidScenario("x.yaml", faults=faults)


def wrench_run(samples):
    """(T, 12) readings given for raw ones that begin `SETTLED` after the start, and the contacts (T, 2)."""
    system = ValidatedWrench(2, 1, (0, 1), DT)
    context, found, contacts = system.CreateDefaultContext(), [], []
    context.SetTime(SETTLED)
    system.GetInputPort("flagged").FixValue(context, np.zeros(2))
    for sample in samples:
        system.GetInputPort("wrench").FixValue(context, sample)
        found.append(system.GetOutputPort("reading").Eval(context).copy())
        contacts.append(system.GetOutputPort("contacts").Eval(context).copy())
        step(system, context)
    return np.array(found), np.array(contacts)


def standing_wrench(ticks):
    """Two feet with 135 N each."""
    samples = np.random.default_rng(5).normal(size=(ticks, 12)) * 0.3
    samples[:, [2, 8]] += 135.0
    return samples


@pytest.mark.parametrize("jump", [150.0, -120.0])
def test_a_force_that_jumps_without_the_other_foot_is_left_out_for_good(jump):
    samples = standing_wrench(1500)
    samples[200:, 2] += jump
    found, contacts = wrench_run(samples)
    assert_array_equal(found[:200], samples[:200])
    assert_array_equal(found[200:, :6], np.tile(samples[199, :6], (1300, 1)))
    assert_array_equal(found[200:, 6:], samples[200:, 6:])
    assert_array_equal(contacts[200:], np.tile([2.0, 1.0], (1300, 1)))


def test_a_force_that_jumps_back_is_believed_at_once():
    samples = standing_wrench(600)
    samples[200:300, 2] += 150.0
    found, _ = wrench_run(samples)
    assert_array_equal(found[300:], samples[300:])


def test_a_load_that_goes_over_to_the_other_foot_is_believed():
    samples = standing_wrench(600)
    samples[200:, 2] += 100.0
    samples[200:, 8] -= 100.0
    found, contacts = wrench_run(samples)
    assert_array_equal(found, samples)
    assert (contacts == 1.0).all()


def test_a_landing_is_believed_when_its_impact_is_over():
    """One foot carries all; the other lands with 300 N in a tick, and 8 ms later both share the weight."""
    samples = standing_wrench(600)
    samples[:200, 2] += 135.0
    samples[:200, 8] -= 135.0
    samples[200:208, 8] += 300.0
    found, _ = wrench_run(samples)
    assert (found[200:208, 8] < 10.0).all()
    assert_array_equal(found[208:], samples[208:])
