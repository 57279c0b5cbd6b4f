"""Fault flags: each fault raises its own flag in time, and a live, noisy robot raises none."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from estimation.machines import joint_xml, link_xml
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from drake_tc.errors import ParamsError
from drake_tc.hardware.stepper import LatestReadings
from drake_tc.robot.robot import ForceTorqueMount, Mount, Pose, Robot
from drake_tc.sensing.spec import SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec
from drake_tc.sensor_validation.fault_monitor import FaultMonitor
from drake_tc.sensor_validation.monitor_spec import MonitorSpec

DT = 1e-3
N = 3
RAW = ("position", "imu", "wrench")


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    """Three joints, an F/T at the end, an IMU on the welded base, upside down about x."""
    folder: Path = tmp_path_factory.mktemp("robot")
    rng = np.random.default_rng(0)
    names = ["base", "a", "b", "c", "foot"]
    joints = [
        joint_xml(f"j{i}", "fixed" if child == "foot" else "revolute", parent, child, Pose(), (0, 1, 0))
        for i, (parent, child) in enumerate(pairwise(names))
    ]
    file = folder / "leg.urdf"
    file.write_text(f'<robot name="leg">{"".join(link_xml(name, rng) for name in names)}{"".join(joints)}</robot>')
    return Robot(
        name="leg",
        urdf=file,
        base="base",
        fixed_base=True,
        joints=("j0", "j1", "j2"),
        posture=np.zeros(N),
        source=folder / "leg.yaml",
        base_pose=Pose(rpy=(np.pi, 0.0, 0.0)),
        imu=(Mount("imu", "base", Pose(rpy=(0.0, np.pi / 2, 0.0))),),
        force_torque=(ForceTorqueMount("ankle", "j3", Pose(), Mount("ankle", "foot")),),
    )


def live(steps: int, seed: int = 0) -> dict[str, np.ndarray]:
    """(T, ...) raw readings of a moving leg whose sensors have noise; the IMU sees gravity in its frame."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(steps)[:, None]
    resolution = 1e-5
    encoder = 0.3 * np.sin(2 * np.pi * time + np.arange(N)) + resolution * rng.standard_normal((steps, N))
    # base turned by pi about x: up is -z of the base; the IMU's x axis is -z of the base, so it reads up on x
    imu = np.array([0.0, 0.0, 0.0, 9.81, 0.0, 0.0]) + np.array([5e-3] * 3 + [0.05] * 3) * rng.standard_normal(
        (steps, 6)
    )
    wrench = np.array([0.0, 0.0, -20.0, 0.0, 0.0, 0.0]) + np.array([1.0] * 3 + [0.05] * 3) * rng.standard_normal(
        (steps, 6)
    )
    return {
        "position": np.round(encoder / resolution) * resolution,
        "imu": imu,
        "wrench": wrench,
        "reference_velocity": 0.6 * np.pi * np.cos(2 * np.pi * time + np.arange(N)),
        "unknown_wrench": 2.0 * rng.standard_normal((steps, 6)),
        "contact_wrench": rng.standard_normal((steps, 6)),
        "torque_residual": 5.0 * rng.standard_normal((steps, N)),
    }


def run(robot: Robot, signals: dict[str, np.ndarray], spec: MonitorSpec | None = None) -> dict[str, np.ndarray]:
    """Flags by name (T,), as they stand after the tick that read row t."""
    monitor = FaultMonitor(robot, spec, DT, free=("ankle",))
    context = monitor.CreateDefaultContext()
    flags = []
    for row in range(len(signals["position"])):
        for name, values in signals.items():
            monitor.GetInputPort(name).FixValue(context, values[row])
        context.SetTime(row * DT)
        context.SetDiscreteState(monitor.EvalUniquePeriodicDiscreteUpdate(context))
        flags.append(monitor.GetOutputPort("flags").Eval(context))
        level = 2.0 if flags[-1][:3].any() else flags[-1].max()
        assert monitor.GetOutputPort("any_fault").Eval(context)[0] == level
    return dict(zip(monitor.flag_names, np.array(flags).T, strict=True))


def raised(flags: dict[str, np.ndarray]) -> dict[str, int]:
    """First tick of every flag that went up."""
    return {name: int(np.argmax(values)) for name, values in flags.items() if values.any()}


def test_a_live_robot_raises_nothing(robot):
    assert raised(run(robot, live(2000))) == {}


START = 300


def frozen(values):
    values[START:] = values[START]


def nan(values):
    values[START:, 0] = np.nan


def biased(size, channel=0):
    def apply(values):
        values[START:, channel] += size

    return apply


FAULTS = [
    ("position", nan, "encoder/missing", 1),
    ("imu", nan, "imu/missing", 1),
    ("wrench", nan, "ankle/missing", 1),
    ("position", frozen, "encoder/frozen", 25),
    ("imu", frozen, "imu/frozen", 15),
    ("wrench", frozen, "ankle/frozen", 15),
    ("position", biased(0.1), "encoder/jump", 1),
    ("imu", biased(3.0), "imu/jump", 1),
    ("imu", biased(0.2), "imu/inconsistent", 20),
    ("imu", biased(2.0, 4), "imu/inconsistent", 20),
    ("wrench", biased(200.0), "ankle/jump", 1),
    ("contact_wrench", biased(30.0), "ankle/unexpected", 20),
    ("unknown_wrench", biased(8.0, 5), "unknown_wrench/unexpected", 20),
    ("torque_residual", biased(100.0), "torque/inconsistent", 20),
]


@pytest.mark.parametrize(
    ("signal", "fault", "flag", "within"), FAULTS, ids=[f"{f[2]}-{i}" for i, f in enumerate(FAULTS)]
)
def test_each_fault_raises_its_flag_in_time(robot, signal, fault, flag, within):
    signals = live(START + 60)
    fault(signals[signal])
    seen = raised(run(robot, signals))
    assert START <= seen[flag] < START + within
    assert min(seen.values()) >= START
    if signal in ("position", "imu"):
        assert {name.split("/")[0] for name in seen} == {{"position": "encoder"}.get(signal, signal)}


def test_a_gap_of_twenty_ticks_is_missing_and_its_end_no_jump(robot):
    signals = live(START + 300)
    for name in ("position", "imu", "wrench"):
        signals[name][START : START + 20] = np.nan
    flags = run(robot, signals)
    assert set(raised(flags)) == {"encoder/missing", "imu/missing", "ankle/missing"}
    for values in flags.values():
        assert not values[-1]


def test_a_flag_holds_for_the_hold_time(robot):
    signals = live(START + 300)
    signals["imu"][START] = np.nan
    up = np.flatnonzero(run(robot, signals, MonitorSpec(hold=0.05))["imu/missing"])
    assert_array_equal(up, np.arange(START, START + 50))


@pytest.mark.parametrize(("lasts", "up_to"), [(True, 300), (False, 100)])
def test_a_wrench_that_jumped_stays_flagged_until_it_jumps_back(robot, lasts, up_to):
    signals = live(START + 500)
    signals["wrench"][START : START + 200, 2] += 150.0
    flags = run(robot, signals, MonitorSpec(wrench_jump_lasts=lasts))["ankle/jump"]
    back = np.arange(START + 200, START + 300)  # hold: 100 ticks, after each of the jumps
    assert_array_equal(np.flatnonzero(flags), np.union1d(np.arange(START, START + up_to), back))


def moving_at(speed, steps, seed=0):
    """Encoders of joints that all move at a steady speed, with their noise."""
    signals = {name: values for name, values in live(steps, seed).items() if name in RAW}
    noise = 1e-5 * np.random.default_rng(seed).standard_normal((steps, N))
    signals["position"] = np.round((speed * DT * np.arange(steps)[:, None] + noise) / 1e-5) * 1e-5
    return signals


@pytest.mark.parametrize("size", [3.3e-3, -3.3e-3])
@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_jump_beyond_what_the_largest_acceleration_allows_stays_flagged(robot, speed, size):
    """2000 rad/s^2 for 1 ms and 1 mrad of noise are 3 mrad; a fifth of what the speed limit of 20 rad/s lets pass."""
    signals = moving_at(speed, START + 300)
    signals["position"][START : START + 100, 1] += size
    flags = run(robot, signals)
    assert set(raised(flags)) == {"encoder/jump"}
    assert_array_equal(np.flatnonzero(flags["encoder/jump"]), np.arange(START, START + 200))  # hold: 100 ticks


def test_the_largest_acceleration_is_the_users(robot):
    signals = moving_at(2.0, START + 10)
    signals["position"][START:, 1] += 3.3e-3
    assert raised(run(robot, signals, MonitorSpec(encoder_acceleration=3000.0))) == {}
    assert raised(run(robot, signals, MonitorSpec(encoder_acceleration=np.inf))) == {}


def test_readings_that_become_older_jump_back_by_the_way_of_that_time(robot):
    signals = moving_at(1.0, START + 60)
    signals["position"][START:] = signals["position"][START - 5 : -5]  # 5 ms: 5 mrad
    assert raised(run(robot, signals)) == {"encoder/jump": START}


def test_a_joint_that_is_stopped_by_a_blow_is_flagged_for_the_hold_time_alone(robot):
    signals = moving_at(4.0, START + 300)
    signals["position"][START:] = signals["position"][START - 1] + 1e-5 * np.random.default_rng(1).integers(
        -1, 2, (300, N)
    )
    flags = run(robot, signals)
    assert set(raised(flags)) == {"encoder/jump"}
    up = np.flatnonzero(flags["encoder/jump"])
    assert START <= up[0] <= START + 2  # a reading that repeats tells nothing
    assert up[-1] < START + 105


def test_readings_that_come_every_few_ticks_are_no_jumps(robot):
    """A slower bus: the reading repeats, and then goes as far as the joint went meanwhile."""
    signals = moving_at(3.0, 300)
    every = 5 * (np.arange(300) // 5)
    signals["position"] = signals["position"][every]
    assert raised(run(robot, signals)) == {}


@pytest.mark.parametrize(("timing", "flagged"), [(0.0, True), (5e-3, False)])
def test_readings_that_come_late_and_early_are_no_jumps_where_the_time_is_allowed(robot, timing, flagged):
    """A loaded computer: up to 3 ticks bring nothing, positions go on at their last speed, then the newest comes in."""
    signals, rng = moving_at(3.0, 900), np.random.default_rng(13)
    true = signals["position"].copy()
    readings, age, taken = LatestReadings({"position": true.shape[1]}, 1e-3, 5e-3), 0, 0
    for tick in range(900):
        age = int(rng.integers(1, 4)) if age == 0 and tick > 10 and rng.random() < 0.05 else max(age - 1, 0)
        late = int(rng.integers(0, 3)) if tick > 10 and rng.random() < 0.2 else 0
        taken = taken if age else max(taken, tick - late)  # when the newest reading was taken
        readings.update(None if age else {"position": true[taken]})
        signals["position"][tick] = readings.values["position"]
    flags = raised(run(robot, signals, MonitorSpec(encoder_timing=timing)))
    assert ("encoder/jump" in flags) is flagged
    assert set(flags) <= {"encoder/jump"}


def test_a_jump_at_speed_is_seen_where_time_is_allowed(robot):
    signals = moving_at(3.0, START + 300)
    signals["position"][START:, 0] += 0.05  # 5 ms at 3 rad/s are 15 mrad
    flags = run(robot, signals, MonitorSpec(encoder_timing=5e-3))
    assert flags["encoder/jump"][START + 1 :].all()


def test_a_single_wrong_reading_is_flagged_and_forgotten(robot):
    signals = moving_at(2.0, START + 300)
    signals["position"][START, 0] += 6e-3
    up = np.flatnonzero(run(robot, signals)["encoder/jump"])
    assert_array_equal(up, np.arange(START, START + 101))


def test_coarse_encoders_do_not_jump(robot):
    """12 bits: steps of 1.5 mrad."""
    step = 2 * np.pi / 4096
    suite = replace(SensorSuiteSpec.perfect(), encoder=SensorSpec(resolution=step))
    signals = moving_at(2.3, 500)
    signals["position"] = np.round(signals["position"] / step) * step
    assert raised(run(robot, signals, MonitorSpec(encoder_acceleration=100.0).for_sensors(suite))) == {}
    assert MonitorSpec().for_sensors(suite).encoder_jump == 2.0 * step


@pytest.mark.parametrize(("back", "up_to"), [(None, 700), (200, 300)])
def test_an_encoder_that_jumped_stays_flagged_until_it_jumps_back(robot, back, up_to):
    signals = live(START + 700)
    signals["position"][START : None if back is None else START + back, 1] += 0.08
    flags = run(robot, signals)
    assert set(raised(flags)) == {"encoder/jump"}
    assert_array_equal(np.flatnonzero(flags["encoder/jump"]), np.arange(START, START + up_to))  # hold: 100 ticks


def test_a_reading_that_repeats_for_a_few_long_ticks_is_not_frozen(robot):
    signals = {name: values for name, values in live(60).items() if name in (*RAW, "reference_velocity")}
    for name, repeats in (("position", 15), ("imu", 4), ("wrench", 4)):
        signals[name][20 : 20 + repeats] = signals[name][20]
    signals["reference_velocity"][:] = 0.0
    monitor = FaultMonitor(robot, dt=0.01)
    context = monitor.CreateDefaultContext()
    for row in range(60):
        for name, values in signals.items():
            monitor.GetInputPort(name).FixValue(context, values[row])
        context.SetDiscreteState(monitor.EvalUniquePeriodicDiscreteUpdate(context))
        assert monitor.GetOutputPort("any_fault").Eval(context)[0] == 0.0


def test_a_noiseless_encoder_is_frozen_only_where_the_reference_moves(robot):
    signals = live(200)
    signals["position"][:] = 0.1
    spec = MonitorSpec(encoder_frozen=np.inf)
    assert raised(run(robot, signals, spec)) == {"encoder/frozen": 40}
    signals["reference_velocity"][:] = 0.0
    assert raised(run(robot, signals, spec)) == {}


def test_sensors_without_noise_are_never_frozen(robot):
    signals = {name: np.tile(values[0], (200, 1)) for name, values in live(1).items() if name in RAW}
    assert {"encoder/frozen", "imu/frozen", "ankle/frozen"} <= set(raised(run(robot, signals)))
    assert raised(run(robot, signals, MonitorSpec().for_sensors(SensorSuiteSpec.perfect()))) == {}
    assert MonitorSpec().for_sensors(SensorSuiteSpec.realistic()) == MonitorSpec()
    one = replace(SensorSuiteSpec.realistic(), gyro=SensorSpec())
    assert MonitorSpec().for_sensors(one) == MonitorSpec(imu_frozen=np.inf)


def test_optional_inputs_stay_open(robot):
    signals = {name: values for name, values in live(100).items() if name in RAW}
    assert raised(run(robot, signals)) == {}


ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.lists(ANY, min_size=15, max_size=15), min_size=1, max_size=8))
def test_nothing_but_zero_and_one_comes_out(robot, rows):
    table = np.array(rows)
    signals = {
        "position": table[:, :3],
        "imu": table[:, 3:9],
        "wrench": table[:, 9:],
        "unknown_wrench": table[:, 9:],
        "torque_residual": table[:, :3],
    }
    for values in run(robot, signals).values():
        assert set(np.unique(values)) <= {0.0, 1.0}


def test_two_contexts_do_not_share_anything(robot):
    monitor = FaultMonitor(robot)
    assert not monitor.HasAnyDirectFeedthrough()
    contexts = [monitor.CreateDefaultContext() for _ in range(2)]
    signals = live(1)
    for context, encoder in zip(contexts, (signals["position"][0], np.full(N, np.nan)), strict=True):
        monitor.GetInputPort("position").FixValue(context, encoder)
        monitor.GetInputPort("imu").FixValue(context, signals["imu"][0])
        monitor.GetInputPort("wrench").FixValue(context, signals["wrench"][0])
        context.SetDiscreteState(monitor.EvalUniquePeriodicDiscreteUpdate(context))
    assert [monitor.GetOutputPort("any_fault").Eval(context)[0] for context in contexts] == [0.0, 2.0]


def test_refusals(robot):
    with pytest.raises(ParamsError, match="hold: expected a positive number"):
        MonitorSpec(hold=np.inf)
    with pytest.raises(ParamsError, match="gyro_jump: expected a positive number"):
        MonitorSpec(gyro_jump=0.0)
    with pytest.raises(ParamsError, match="no F/T sensor 'wrist'; there are"):
        FaultMonitor(robot, free=("wrist",))
    with pytest.raises(ParamsError, match="positive period"):
        FaultMonitor(robot, dt=0.0)
