"""What Drake, MuJoCo and BAM make of exported terms: closed forms, and the ratio of their errors to the model's own."""

import json
from functools import partial

import numpy as np
import pandas as pd
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.actuation.recorded_run import Link
from drake_tc.cli.main import run as drake_tc
from drake_tc.diagrams.joint_bench import BenchScenario, record_bench
from drake_tc.errors import ParamsError
from drake_tc.exchange.bam import simulate_as_bam
from drake_tc.exchange.drake_run import simulate_in_drake, simulate_plain_in_drake
from drake_tc.exchange.mujoco_run import simulate_in_mujoco
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.target_run import RunInput
from drake_tc.exchange.trial import Exported, run_errors
from drake_tc.exchange.urdf import to_sdf, to_urdf
from drake_tc.logs.rig import parse_rig
from drake_tc.loops.joint_bench import Table
from drake_tc.simulator_files.read import read_joints
from drake_tc.simulator_files.terms import StribeckPeak, Terms

H = 1e-3
T = np.arange(3000) * H
NONE = np.zeros(T.size)


def alone(command=NONE, load=NONE, start=(0.0, 0.0)) -> RunInput:
    return RunInput(command, load, start, H)


RUNNERS = {
    "drake": (simulate_in_drake, "torque"),
    "bam": (simulate_as_bam, "voltage"),
    "mujoco": (simulate_in_mujoco, "torque"),
    "urdf": (partial(simulate_plain_in_drake, to_urdf), "torque"),
    "sdf": (partial(simulate_plain_in_drake, to_sdf), "torque"),
}
PLAIN = ("urdf", "sdf")
"""Formats without the inertia of a rotor: there it is that of the link."""


def of(*names):
    return pytest.mark.parametrize("target", names or list(RUNNERS))


def moved(target, given, kp=1.0, *, kind=None, inertia=0.3, weight=0.0, **terms):
    """Positions of a joint of this inertia [kg m^2], with a pendulum of this weight [N m] about 0.3 rad."""
    if target == "mujoco":
        pytest.importorskip("mujoco")
    simulate, usual = RUNNERS[target]
    armature = 0.0 if target in PLAIN else 0.2 * inertia if weight else inertia
    link = Link(inertia - armature, weight, 0.3) if weight or target in PLAIN else None
    return simulate(Terms(kind or usual, kp, armature=armature, **terms), link, given)


@of()
def test_inertia_and_damping_are_at_the_joint(target):
    given = RunInput(NONE, NONE, (0.0, 1.0), H, substeps=10)
    expected = 0.15 * (1.0 - np.exp(-2.0 * T / 0.3))
    # BAM: sum of h v[n+1] is I/b - h for 1 rad/s, and the sum of h^2/2 vdot is -h/2
    np.testing.assert_allclose(moved(target, given, damping=2.0), expected, rtol=0, atol=1.55 * given.step)


@of()
def test_one_unit_of_command_gives_kp(target):
    """0.5 units of 6 N m against a load of 2 N m: 1 N m on 0.3 kg m^2."""
    found = moved(target, alone(np.full(T.size, 0.5), np.full(T.size, 2.0)), 6.0)
    np.testing.assert_allclose(found, 0.5 * T**2 / 0.3, rtol=0, atol=2.0 * H * T[-1] / 0.3)


@of()
def test_a_pendulum_swings_with_its_frequency_about_its_zero(target):
    found = moved(target, alone(start=(0.31, 0.0)), inertia=0.5, weight=9.0)
    np.testing.assert_allclose(found, 0.3 + 0.01 * np.cos(np.sqrt(9.0 / 0.5) * T), rtol=0, atol=2e-4)


@of("drake", "mujoco", *PLAIN)
def test_a_servo_rests_where_it_carries_the_load(target):
    given = alone(np.full(T.size, 0.5), np.full(T.size, 5.0))
    assert moved(target, given, 50.0, kind="position_servo", damping=10.0)[-1] == pytest.approx(0.4, abs=2e-3)


@of("drake", "mujoco", *PLAIN)
@pytest.mark.parametrize("kind", ["position_servo", "current"])
def test_a_limit_of_torque(target, kind):
    found = moved(target, alone(np.full(T.size, 100.0)), 1e4, kind=kind, torque_limit=0.6)
    np.testing.assert_allclose(found, 0.5 * T**2 * 0.6 / 0.3, rtol=0, atol=2e-2)


@of("mujoco", "bam")
@pytest.mark.parametrize("delay", [0.004, 0.010, 0.025])
def test_a_delay_is_that_of_the_command(target, delay):
    given, kind = alone(np.where(T > 0.9995, 0.5, 0.0)), {"mujoco": "position_servo", "bam": "voltage"}[target]
    at_once, late = (moved(target, given, 500.0, kind=kind, damping=20.0, delay=each) for each in (0.0, delay))
    shift = round(delay / H)
    np.testing.assert_allclose(late[shift:], at_once[: T.size - shift], rtol=0, atol=1e-9)


@of("mujoco", "bam")
def test_dry_friction_stops_what_slides(target):
    """It slides v^2 I/2F far."""
    assert moved(target, alone(start=(0.0, 1.0)), frictionloss=0.2)[-1] == pytest.approx(0.3 / (2 * 0.2), rel=2e-3)


def test_a_peak_of_dry_friction_by_bams_equations():
    """At rest it holds what dry friction alone would not."""
    sliding = Terms("voltage", 1.0, armature=0.3, frictionloss=0.2)
    held = Terms("voltage", 1.0, armature=0.3, frictionloss=0.2, stribeck=StribeckPeak(0.1, 0.05, 1.0))
    pushed = alone(np.full(T.size, 0.25))
    assert simulate_as_bam(held, None, pushed)[-1] == 0.0
    assert simulate_as_bam(sliding, None, pushed)[-1] == pytest.approx(0.5 * 0.05 / 0.3 * T[-1] ** 2, rel=1e-2)


def test_friction_under_load_by_bams_equations():
    """A load of 2 N m brakes by a tenth of it, and holds what is less than that."""
    terms = Terms("voltage", 1.0, armature=0.3, frictionloss=0.1, load_friction=0.1)
    loaded, pushed = np.full(T.size, 2.0), 0.5 * T[-1] ** 2 / 0.3
    assert simulate_as_bam(terms, None, alone(np.full(T.size, 2.29), loaded))[-1] == 0.0
    up = simulate_as_bam(terms, None, alone(np.full(T.size, 2.4), loaded))[-1]
    down = simulate_as_bam(terms, None, alone(np.full(T.size, 1.6), loaded))[-1]
    assert (up, down) == (pytest.approx(0.1 * pushed, rel=1e-2), pytest.approx(-0.1 * pushed, rel=1e-2))


GEARED = """<robot name="r" xmlns:drake="http://drake.mit.edu">
  <link name="base"/>
  <link name="shank">
    <inertial><mass value="1"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="knee" type="revolute"><parent link="base"/><child link="shank"/><axis xyz="0 1 0"/></joint>
  <transmission name="t">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="knee"/>
    <actuator name="m"><drake:rotor_inertia value="3e-5"/><drake:gear_ratio value="100"/></actuator>
  </transmission>
</robot>
"""


def test_the_gear_counts_squared_in_drakes_own_simulation(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(GEARED, encoding="utf-8")
    plant = MultibodyPlant(H)
    Parser(plant).AddModels(str(path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    simulator = Simulator(plant)
    plant.get_applied_generalized_force_input_port().FixValue(simulator.get_mutable_context(), [0.6])
    simulator.AdvanceTo(1.0)
    accelerated = plant.GetVelocities(simulator.get_context())[0]
    armature = read_joints(path, ParamsError)["knee"].terms.armature
    assert armature == pytest.approx(3e-5 * 100.0**2)
    assert accelerated == pytest.approx(0.6 / armature, rel=1e-5)


SERVO = (EffectValue("rotor_inertia", {"rotor_inertia": 0.3}), EffectValue("viscous", {"viscous": 20.0}))
COULOMB = EffectValue("coulomb", {"coulomb": 1.5})
PEAK = EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.2, "stribeck_exponent": 1.0})


def recorded(model: ActuatorModel):
    """A rig and a held-out run of the simulated bench with that model."""
    time = np.arange(4000) * H
    command = 0.6 * np.sin(2.0 * time) + 0.1 * np.sin(5.0 * time)
    if model.drive.kind == "voltage":
        command = 20.0 * np.sin(2.0 * time) + 15.0 * np.sin(5.0 * time)
    run = record_bench(model, Table(time, command), BenchScenario(duration=4.0, link_inertia=0.5))
    return parse_rig({"joint": "joint", "drive": model.drive.kind}, "rig.yaml"), run


@pytest.mark.parametrize(
    ("target", "model", "expressed"),
    [
        ("drake-urdf", ActuatorModel("joint", Drive("position_servo", 2e-3), SERVO), True),
        pytest.param(
            *("drake-urdf", ActuatorModel("joint", Drive("position_servo", 2e-3), (*SERVO, COULOMB)), False),
            marks=pytest.mark.slow,
        ),
        ("bam", ActuatorModel("joint", Drive("voltage", 0.5), (*SERVO, COULOMB, PEAK)), True),
    ],
)
def test_an_export_is_as_good_as_the_model_where_nothing_is_lost(target, model, expressed):
    rig, run = recorded(model)
    projection = project(model, TARGETS[target])
    assert (projection.losses == ()) is expressed
    (row,) = run_errors({"joint": model}, Exported([projection], target), rig, [run])
    span = np.std(run.columns["joint/position"])
    if expressed:
        assert row.export < max(1.2 * row.model, 1e-3 * span)
    else:
        assert row.export > 5.0 * row.model


def command_into_the_users_file(folder, capsys, target):
    """`export` into a file with three times the damping, with a rig, a held-out run and a page."""
    model = ActuatorModel("joint", Drive("position_servo", 2e-3), SERVO)
    _, log = recorded(model)
    columns = {name: values for name, values in log.columns.items() if name.startswith("joint/")}
    pd.DataFrame({"time": log.time, **columns})[:2000].to_csv(folder / "held.csv", index=False)
    (folder / "rig.yaml").write_text("{joint: joint, drive: position_servo, load: torque}\n")
    save_models({"joint": model}, folder / "model.yaml")
    stiff = ActuatorModel("joint", model.drive, (SERVO[0], EffectValue("viscous", {"viscous": 60.0})))
    save_models({"joint": stiff}, folder / "mine.yaml")
    assert drake_tc(["export", str(folder / "mine.yaml"), "--to", target, "--out", str(folder / "mine.urdf")]) == 0
    capsys.readouterr()
    options = {"into": "mine.urdf", "rig": "rig.yaml", "holdout": "held.csv", "page": "export.html"}
    given = [word for key, name in options.items() for word in (f"--{key}", str(folder / name))]
    return ["export", str(folder / "model.yaml"), "--to", target, *given]


def test_the_command_runs_the_export_beside_the_users_own_file(tmp_path, capsys):
    command = command_into_the_users_file(tmp_path, capsys, "drake-urdf")
    assert drake_tc([*command, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["free_runs"]
    assert row["original"] > 3.0 * row["export"] and row["unit"] == "rad"
    page = (tmp_path / "export.html").read_text(encoding="utf-8")
    for value in (row["model"], row["export"], row["original"]):
        assert f"{1e3 * value:#.3g} mrad".replace(" ", "\u00a0") in page
    assert "expresses all effects" in page and "your file (Drake&#39;s plant)" in page and "http://" not in page
    assert drake_tc(command) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("<?xml") and printed.out.rstrip().endswith("</robot>")
    assert "your file (Drake's plant)" in printed.err
    assert drake_tc([*command[:3], "isaaclab", "--rig", *command[7:10]]) == 2
