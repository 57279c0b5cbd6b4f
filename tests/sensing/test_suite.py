"""Suites and faults from YAML, and all sensors of a committed robot at once."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from drake_tc.config.records import read_record
from drake_tc.config.yaml_file import parse_yaml
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.sensor import corrupt
from drake_tc.sensing.spec import SensorFault, SensorSpec, joined
from drake_tc.sensing.suite import SENSORS, SensorSuiteSpec, add_sensors, load_suite, sensor_seed

DT = 1e-3
LEG = Path(__file__).resolve().parents[2] / "models" / "hrp2_like" / "hrp2_like_leg.yaml"


def test_a_preset_and_what_differs_from_it():
    text = "{preset: realistic, encoder: {latency: 2e-3}, force: {bias: [0, 0, 3.0]}}"
    suite, base = load_suite("f.yaml: sensors", parse_yaml(text, "s")), SensorSuiteSpec.realistic()
    assert suite.encoder == SensorSpec(noise=base.encoder.noise, resolution=base.encoder.resolution, latency=2e-3)
    assert suite.force.bias == (0.0, 0.0, 3.0)
    assert suite.force.noise == base.force.noise
    assert (suite.gyro, suite.accel, suite.torque) == (base.gyro, base.accel, base.torque)
    assert load_suite("", None) == SensorSuiteSpec.perfect() == load_suite("", {"preset": "perfect"})


def test_an_encoder_of_the_preset_at_rest_never_looks_frozen_for_20_ms():
    readings = corrupt(np.full((20_000, 1), 0.4), SensorSuiteSpec.realistic().encoder, DT)[:, 0]
    moves = np.flatnonzero(np.diff(readings))
    assert np.diff(moves).max() < 20


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{preset: ideal}", "s.preset: expected one of perfect, realistic, got 'ideal'"),
        ("{encoders: {}}", "s: unknown key 'encoders'; did you mean 'encoder'?"),
        ("{encoder: {noises: 1}}", "s.encoder: unknown key 'noises'; did you mean 'noise'?"),
        ("{encoder: {noise: big}}", "s.encoder.noise: expected a finite number, got 'big'"),
        ("{encoder: {noise: -1}}", "s.encoder.noise: expected numbers >= 0, got -1"),
        ("{gyro: {bias: [1, x, 2]}}", "s.gyro.bias[1]: expected a finite number, got 'x'"),
        ("[1]", "s: expected a mapping with preset, encoder"),
    ],
)
def test_a_bad_suite_is_refused_in_one_line(text, message):
    with pytest.raises(ParamsError) as caught:
        load_suite("s", parse_yaml(text, "s"))
    assert message in str(caught.value)
    assert str(caught.value).startswith("s")
    assert "\n" not in str(caught.value)


@dataclass(frozen=True)
class Faults:
    encoder: tuple[SensorFault, ...] = ()
    imu: tuple[SensorFault, ...] = ()


def test_faults_of_a_scenario():
    text = """
    encoder: [{kind: frozen, start: 1.0, duration: 0.02, channels: [3]}, {kind: dropped, start: 2}]
    imu: [{kind: biased, start: 0.5, duration: .inf, value: 0.1}]
    """
    assert read_record(Faults, parse_yaml(text, "f"), "f") == Faults(
        encoder=(SensorFault("frozen", 1.0, 0.02, (3,)), SensorFault("dropped", 2.0)),
        imu=(SensorFault("biased", 0.5, value=0.1),),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{lidar: []}", "f: unknown key 'lidar'; allowed: encoder, imu"),
        ("{imu: {kind: nan}}", "f: imu: expected a list, got {'kind': 'nan'}"),
        ("{imu: [{start: 1}]}", "f: imu[0]: kind is missing"),
        (
            "{imu: [{kind: melted}]}",
            "f: imu[0].kind: expected one of frozen, dropped, biased, nan, spikes, late, got 'melted'",
        ),
        ("{imu: [{kind: nan, start: soon}]}", "f: imu[0].start: expected a finite number, got 'soon'"),
        ("{imu: [{kind: nan, channels: 3}]}", "f: imu[0].channels: expected a list, got 3"),
        (
            "{imu: [{kind: nan}, {kind: nan, duration: 0}]}",
            "f: imu[1].duration: expected a time > 0 [s], or .inf, got 0",
        ),
    ],
)
def test_bad_faults_are_refused_in_one_line(text, message):
    with pytest.raises(ParamsError) as caught:
        read_record(Faults, parse_yaml(text, "f"), "f")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_parts_are_joined_in_order_and_their_latencies_must_agree():
    spec = joined([(SensorSpec(noise=1.0, latency=DT), 2), (SensorSpec(noise=(2.0, 3.0), bias=4.0, latency=DT), 2)])
    assert spec.noise == (1.0, 1.0, 2.0, 3.0)
    assert spec.bias == (0.0, 0.0, 4.0, 4.0)
    assert spec.latency == DT
    with pytest.raises(ParamsError, match="one for all parts"):
        joined([(SensorSpec(latency=DT), 3), (SensorSpec(), 3)])


def test_sensors_derive_different_seeds():
    seeds = {sensor_seed(seed, name) for seed in range(20) for name in SENSORS}
    assert len(seeds) == 20 * len(SENSORS)


def leg(suite, faults=None, seed=0):
    robot = load_robot(LEG)
    builder = DiagramBuilder()
    plant = MultibodyPlant(DT)
    add_robot(plant, robot)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    builder.AddNamedSystem("plant", plant)
    sensors = add_sensors(builder, plant, robot, suite, DT, seed, faults)
    builder.ExportInput(plant.get_actuation_input_port(), "actuation")
    return builder.Build(), plant, robot, sensors


def read(sensor, root):
    return sensor.GetOutputPort("reading").Eval(sensor.GetMyContextFromRoot(root)).copy()


def test_perfect_sensors_of_a_leg_held_still():
    diagram, plant, robot, sensors = leg(SensorSuiteSpec.perfect())
    root = diagram.CreateDefaultContext()
    own = plant.GetMyContextFromRoot(root)
    assert_array_equal([plant.GetJointByName(j).velocity_start() for j in robot.joints], np.arange(6))
    gravity = -plant.CalcGravityGeneralizedForces(own)
    diagram.GetInputPort("actuation").FixValue(root, gravity)
    assert_array_equal(read(sensors.encoder, root), robot.posture)
    imu = read(sensors.imu, root)
    assert_allclose(imu[:3], 0.0, atol=1e-12)
    assert_allclose(np.linalg.norm(imu[3:]), 9.81, rtol=1e-9)
    assert_allclose(read(sensors.joint_torque, root), gravity, atol=1e-9)
    foot = plant.GetBodyByName(robot.force_torque[0].contact.link)
    assert_allclose(np.linalg.norm(read(sensors.force_torque, root)[:3]), 9.81 * foot.default_mass(), rtol=1e-9)


def test_realistic_sensors_fail_as_told_and_repeat_with_the_seed():
    faults = {"imu": (SensorFault("nan", 0.05, 0.02),), "encoder": (SensorFault("frozen", 0.02, channels=(2,)),)}
    rows = {}
    for run, seed in enumerate((7, 7, 8)):
        diagram, plant, _, sensors = leg(SensorSuiteSpec.realistic(), faults, seed)
        simulator = Simulator(diagram)
        root = simulator.get_mutable_context()
        diagram.GetInputPort("actuation").FixValue(root, np.zeros(plant.num_actuators()))
        got = []
        for k in range(1, 100):
            simulator.AdvanceTo(k * DT)
            got.append(np.concatenate([read(s, root) for s in (sensors.encoder, sensors.imu, sensors.force_torque)]))
        rows[run] = np.array(got)
    assert_array_equal(rows[0], rows[1])
    assert not np.array_equal(rows[0][:10], rows[2][:10])
    lost = np.isnan(rows[0])
    assert lost[49:69, 6:12].all()
    assert lost.sum() == 20 * 6
    assert np.ptp(rows[0][19:, 2]) == 0.0
    assert np.all(np.ptp(rows[0][:, :6], axis=0) > 0.0)


def test_a_fault_of_a_sensor_that_is_not_there_is_refused():
    with pytest.raises(ParamsError, match="no sensor 'lidar'; possible: encoder, imu"):
        leg(SensorSuiteSpec.perfect(), {"lidar": (SensorFault("nan"),)})
