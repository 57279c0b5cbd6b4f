"""The diagrams around robust TSID: scenarios run, the robot's balances close, contacts switch, errors teach."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from optional import skip_without_robots
from sweeps import slow_but

from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.logs.files.readers import read_table
from drake_tc.loops.whole_body.drives import TorqueNoise
from drake_tc.loops.whole_body.running import (
    build_tsid,
    contact_wrenches,
    run_tsid,
    simulate_tsid,
    summarise_tsid,
    task_errors,
    worst_misses,
    write_tsid,
)
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.registry import diagrams, runnable, tsid_entry
from drake_tc.robot.plant import file_rotors, joint_limits, make_plant
from drake_tc.tsid.law import Status
from drake_tc.tsid.robust.scaled import TorqueError
from tests.benchmarks.__main__ import run as benchmark
from tests.benchmarks.floor_contact import cone_miss
from tests.benchmarks.tsid_timing import FORMS

ROOT = Path(__file__).resolve().parents[2]
OTHERS = ROOT / "diagrams" / "humanoid_tsid_other_robots.scenario.yaml"
OTHER_ROBOTS = ("talos", "icub", "solo12")
BRISK = (
    "{duration: 1.0, motion: {com: {times: [0.1, 0.8], offsets: [[0.0, 0.0, 0.0], [0.02, 0.04, -0.02]]}},"
    " torque_error: {hold: 5.0e-3}}"
)


@pytest.fixture(scope="module")
def moved():
    """The centre of mass moved within a second, its torques erring: nothing at rest, nothing at a limit."""
    return simulate_tsid(tsid_entry().scenario("com_move", text=BRISK))


@pytest.fixture(scope="module")
def truth(moved):
    """The plant's own robot, and a context of it."""
    plant = make_plant(moved.law.model.robot, 0.0)
    for joint, inertia in file_rotors(moved.law.model.robot).items():
        plant.GetJointActuatorByName(joint).set_default_rotor_inertia(inertia)
    return plant, plant.CreateDefaultContext()


def of_other_robot(name, text):
    skip_without_robots()
    return simulate_tsid(TsidScenario.load(OTHERS, name, text))


@pytest.mark.parametrize("name", slow_but(tsid_entry().scenarios(), "far_reach", "whole_chain_one_foot"))
def test_every_committed_scenario_runs_and_stays_finite(name):
    recording = simulate_tsid(tsid_entry().scenario(name, text="{duration: 0.06}"))
    assert recording.time.size == 61
    assert all(np.isfinite(values).all() for values in recording.signals.values())
    assert recording.fell is None
    assert recording.status(Status.FALLBACK).max() == 0.0


@pytest.mark.parametrize("name", slow_but(OTHER_ROBOTS, "solo12"))
def test_other_robots_stand_from_their_files_alone(name):
    recording = of_other_robot(name, "{duration: 0.2}")
    assert recording.fell is None
    assert recording.status(Status.FALLBACK).max() == 0.0
    assert max(np.abs(error).max() for error in task_errors(recording).values()) < 2e-3


def test_the_tasks_are_followed(moved):
    assert moved.status(Status.FALLBACK).max() == 0.0
    distance = np.linalg.norm(task_errors(moved)["com"], axis=1)
    assert distance.max() < 1e-3
    effort = joint_limits(moved.law.model.robot).effort
    assert (np.abs(moved["torque"]) <= effort).all()


def test_linear_and_angular_momentum_change_by_weight_and_contacts_alone(moved, truth):
    """P(t) - P(0) = sum h (m g + f),  L_O(t) - L_O(0) = sum h (c x m g + n_O), by Drake's momentum of the links."""
    plant, context = truth
    h, nq = 1e-3, 37
    momentum, rates = [], []
    for state, contact in zip(moved["state"], moved["contact"], strict=True):
        plant.SetPositionsAndVelocities(context, state)
        now = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3))
        weight = plant.CalcTotalMass(context) * np.array([0.0, 0.0, -9.81])
        com = plant.CalcCenterOfMassPositionInWorld(context)
        force, moment = contact[3:6], contact[:3]
        momentum.append(np.concatenate([now.rotational(), now.translational()]))
        about = np.cross(com, weight) + moment + np.cross(state[4:7], force)
        rates.append(np.concatenate([about, weight + force]))
    assert nq + 36 == moved["state"].shape[1]
    gained, given = np.array(momentum) - momentum[0], h * np.cumsum([np.zeros(6), *rates[:-1]], axis=0)
    size = np.abs(gained).max(axis=0)
    assert size[3:].max() > 3.0  # 58 kg at 0.06 m/s: something happened
    assert_allclose(given, gained, atol=0.01 * size.max())


def test_energy_changes_by_the_work_of_torques_and_contacts_alone(moved, truth):
    """T + U, rotors in T, against sum h (tau qdot + contact v), v the mean over a step."""
    plant, context = truth
    model, energy = moved.law.model, []
    for state in moved["state"]:
        plant.SetPositionsAndVelocities(context, state)
        v = state[37:]
        energy.append(0.5 * v @ plant.CalcMassMatrix(context) @ v + plant.CalcPotentialEnergy(context))
    v = moved["state"][:, 37:]
    mean = 0.5 * (v[1:] + v[:-1])
    power = (moved["contact"][:-1] * mean).sum(axis=1)
    power += (moved["applied_torque"][:-1] * mean[:, model.actuated]).sum(axis=1)
    work, gained = 1e-3 * np.cumsum(power), np.array(energy[1:]) - energy[0]
    assert np.ptp(gained) > 5.0  # J
    assert_allclose(work, gained, atol=0.01 * np.ptp(gained))


def test_the_controller_knows_its_contact_forces_and_their_centre(moved):
    """Sum of fz = m (g + zdd); centre of pressure by the closed form of a point mass, but for angular momentum."""
    model = moved.law.model
    scratch = model.create_scratch()
    for state, acceleration, force in zip(
        moved["state"][::50], moved["acceleration"][::50], moved["contact_force"][::50], strict=True
    ):
        terms = model.terms(scratch, state[:37], state[37:])
        com = terms.com_jacobian @ acceleration + terms.com_bias
        f = force.reshape(2, 6)
        turns = [terms.pose(contact.name)[0] for contact in model.contacts]
        total = sum(turn @ wrench[:3] for turn, wrench in zip(turns, f, strict=True))
        assert_allclose(total, terms.mass * (com + np.array([0.0, 0.0, 9.81])), atol=1e-6)
    assert_allclose(moved["contact_force"].reshape(-1, 2, 6)[-1, :, 2].sum(), terms.mass * 9.81, rtol=0.02)


def test_true_contacts_carry_what_the_controller_expects(moved):
    total = moved["contact_force"].reshape(-1, 2, 6)[:, :, 2].sum(axis=1)
    settled = moved.time > 0.3
    difference = moved["contact"][settled, 5] - total[settled]
    assert np.sqrt(np.mean(difference**2)) < 0.05 * 569.0  # torques err by 0.003 of their limits


def test_true_wrenches_are_those_of_the_plants_contacts(moved, truth):
    """Rebuilt from generalized forces; against their sum about the base, and nothing missed in a calm motion."""
    plant, context = truth
    wrenches = contact_wrenches(moved, every=100)
    for state, contact, wrench in zip(moved["state"][::100], moved["contact"][::100], wrenches, strict=True):
        plant.SetPositionsAndVelocities(context, state)
        total, about = np.zeros(3), np.zeros(3)
        for place, f in zip(moved.law.model.contacts, wrench.reshape(2, 6), strict=True):
            pose = plant.GetFrameByName(place.frame.link).CalcPoseInWorld(context) @ place.frame.pose.transform
            force, moment = pose.rotation().matrix() @ f[:3], pose.rotation().matrix() @ f[3:]
            total += force
            about += moment + np.cross(pose.translation() - state[4:7], force)
        assert_allclose(np.concatenate([about, total]), contact[:6], atol=1e-6)
    misses = worst_misses(moved, every=10)
    assert set(misses) == {"contact", "torque", "position", "velocity"}
    assert max(misses["torque"], misses["position"], misses["velocity"]) <= 0.0


def test_same_seed_same_numbers_and_another_seed_other_errors():
    runs = [tsid_entry().scenario("noisy_torques", text="{duration: 0.05}").changed(seed=seed) for seed in (3, 3, 4)]
    one, same, other = (simulate_tsid(scenario) for scenario in runs)
    for name, values in one.signals.items():
        assert_array_equal(values, same[name], err_msg=name)
    assert np.ptp(one["applied_torque"] - other["applied_torque"], axis=0).min() > 0.0


def test_one_diagram_runs_twice_alike():
    loop = build_tsid(tsid_entry().scenario("noisy_torques", text="{duration: 0.03}"))
    first, second = run_tsid(loop), run_tsid(loop)
    for name, values in first.signals.items():
        assert_array_equal(values, second[name], err_msg=name)


def test_torque_noise_has_the_covariance_it_is_given():
    root = np.random.default_rng(0).normal(size=(3, 3))
    covariance = root @ root.T
    noise = TorqueNoise(TorqueError(covariance), 1e-3, seed=5, scale=2.0)
    context = noise.CreateDefaultContext()
    drawn = []
    for _ in range(4000):
        drawn.append(noise.get_output_port().Eval(context).copy())
        assert_array_equal(noise.get_output_port().Eval(context), drawn[-1])  # held, not drawn anew
        context.SetDiscreteState(noise.EvalUniquePeriodicDiscreteUpdate(context))
    found = np.cov(np.array(drawn).T)
    spread = 4.0 * np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)) / 4000.0) * 2.0
    assert (np.abs(found - 4.0 * covariance) < 4.0 * spread).all()
    assert_allclose(np.mean(drawn, axis=0), 0.0, atol=5.0 * 2.0 * np.sqrt(covariance.max() / 4000.0))


def test_an_estimated_state_is_near_the_true_one():
    recording = simulate_tsid(tsid_entry().scenario("balance", text="{state: estimated, duration: 0.3}"))
    error = (recording["estimated_state"] - recording["state"])[50:]
    assert np.abs(error[:, :4]).max() < 2e-3
    assert np.abs(error[:, 4:7]).max() < 2e-3
    assert np.abs(error[:, 7:37]).max() < 1e-4
    assert recording.fell is None


def test_through_drives_the_torques_arrive():
    recording = simulate_tsid(tsid_entry().scenario("balance", text="{torque: drives, duration: 0.6, pushes: []}"))
    legs = slice(0, 12)
    late = recording.time > 0.5
    wanted, given = recording["torque"][late, legs], recording["applied_torque"][late, legs]
    assert np.abs(given - wanted).mean() < 3.0  # of 30 N m at the knees; dry friction alone is 2 to 4 N m
    assert recording.fell is None


@pytest.mark.slow
@pytest.mark.parametrize("name", tsid_entry().scenarios())
def test_no_committed_scenario_falls(name):
    recording = simulate_tsid(tsid_entry().scenario(name))
    assert recording.fell is None
    assert recording.time[-1] == pytest.approx(recording.scenario.duration)
    assert recording.status(Status.FALLBACK).max() == 0.0
    assert max(np.linalg.norm(error[-1]) for error in task_errors(recording).values()) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHER_ROBOTS)
def test_no_other_robot_falls(name):
    recording = of_other_robot(name, None)
    assert recording.fell is None
    assert np.linalg.norm(task_errors(recording)["com"][-1]) < 5e-3


@pytest.mark.slow
def test_robust_torques_keep_the_contact_cones_where_classic_ones_miss_them():
    """Test 3 of Del Prete and Mansard (2015): contact forces of the robust form stay in the controller's cones."""
    robust, classic = (
        simulate_tsid(tsid_entry().scenario("far_reach", text=f"{{changes: {{formulation: {{measure: {measure}}}}}}}"))
        for measure in ("individual", "classic")
    )
    assert robust.fell is None
    assert np.median(robust.status(Status.P_IND)[1000:]) > 0.98
    off = {
        name: np.linalg.norm(task_errors(run)["reach"], axis=1).max() for name, run in (("r", robust), ("c", classic))
    }
    assert off["r"] < min(1.1 * off["c"], 0.02)  # robustness costs the hand little
    assert cone_miss(robust) == 0.0
    assert np.median(classic.status(Status.P_IND)[1000:]) < 0.1
    assert cone_miss(classic) > 30.0


@pytest.mark.slow
def test_a_foot_is_lifted_and_put_down():
    recording = simulate_tsid(tsid_entry().scenario("one_foot"))
    model = recording.law.model
    scratch, up = model.create_scratch(), (recording.time > 1.7) & (recording.time < 2.8)
    heights = [
        model.terms(scratch, state[:37], state[37:]).pose("right_sole")[1][2] for state in recording["state"][::10]
    ]
    assert max(heights) == pytest.approx(0.04, abs=2e-3)
    assert_array_equal(recording["contact_force"][up, :6], 0.0)
    assert recording["contact_force"][-1, 2] > 20.0
    assert recording.status(Status.FALLBACK).max() == 0.0
    assert recording.fell is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{motion: {hand: {times: [0, 1], offsets: [[0, 0, 0], [0, 0, 0]]}}}", "motion: expected one of the tasks com"),
        ("{motion: {com: {times: [1, 0], offsets: [[0, 0, 0], [0, 0, 0]]}}}", "motion.com: times: expected at least 2"),
        ("{motion: {com: {times: [0.2, 1.8], offsets: [[0, 0], [0, 0]]}}}", "offsets of three numbers"),
        ("{lifted: {tail: [{begin: 1.0}]}}", "lifted: no contact 'tail'; contacts: right_sole, left_sole"),
        ("{lifted: {left_sole: [{begin: 1.0, end: 0.5}]}}", "expected begin < end"),
        ("{masses: {tail: 1.1}}", "masses: no link 'tail' in hrp2_like"),
        ("{state: guessed}", "state: expected one of plant, estimated, base_estimator, got 'guessed'"),
        ("{torque: by hand}", "torque: expected one of direct, drives, series_elastic, got 'by hand'"),
        ("{ground: {approximation: hard}}", "ground.approximation: expected one of lagged, sap, similar"),
        ("{ground: {stiffness: 0.0}}", "ground.stiffness: expected a positive number"),
        ("{torque_error: {hold: 0.0}}", "torque_error.hold: expected a positive number"),
        ("{controller: nowhere.yaml}", "nowhere.yaml: no such controller file"),
        ("{changes: {contacts: null, tasks: {force: null}}}", "contacts: expected at least one to stand on, got none"),
        ("{changes: {formulation: {measure: best}}}", "hrp2_like_tsid.yaml: formulation.measure: expected one of"),
        ("{gains: 1.0}", "unknown key 'gains'; allowed: controller, seed"),
    ],
)
def test_what_cannot_be_simulated_is_refused(text, message):
    with pytest.raises(ParamsError, match=message):
        build_tsid(tsid_entry().scenario("com_move", text=text))


def test_registry_knows_which_diagram_is_which():
    assert runnable("humanoid_tsid") is tsid_entry("humanoid_tsid")
    assert runnable("hrp2_leg") is diagrams()["hrp2_leg"]
    with pytest.raises(ParamsError, match="no diagram 'dog'; diagrams: hrp2_leg, hrp2_leg_contact, humanoid_tsid"):
        runnable("dog")


def test_summary_and_log(moved, tmp_path):
    summary = summarise_tsid(moved)
    json.dumps(summary)
    assert [row["task"] for row in summary["tasks"]] == ["com"]
    assert summary["fell"] is None
    assert summary["faults"] == []
    assert 0.0 < summary["p_ind"]["min"] <= summary["p_ind"]["median"] <= 1.0
    (log,) = write_tsid(moved, tmp_path, "csv")
    table = read_table(log)
    assert len(table) == 1001
    assert {"time", "r_knee/torque", "left_sole/fz_desired", "status/p_ind"} <= set(table.columns)


def test_the_page_lists_every_scenario():
    page = (ROOT / "diagrams" / "humanoid_tsid.md").read_text("utf-8")
    assert [name for name in tsid_entry().scenarios() if f"`{name}`" not in page] == []


def test_simulate_prints_what_a_run_comes_to(capsys):
    assert run(["simulate", "humanoid_tsid", "--scenario-name", "noisy_torques", "--duration", "0.02", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["diagram"], told["robot"], told["fell"], told["faults"]) == ("humanoid_tsid", "hrp2_like", None, [])
    assert len(told["joints"]) == 30
    assert run(["simulate", "humanoid_tsid", "--duration", "0.02"]) == 0
    shown = capsys.readouterr().out
    assert "task com: rms error" in shown
    assert "x real time" in shown
    assert "p_ind: median" in shown


@pytest.mark.slow
def test_bench_tick_has_a_row_for_every_measure(capsys):
    assert benchmark(["tick", "--duration", "0.04", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["name"] == "tick"
    names = [row["name"] for row in told["rows"]]
    wanted = [measure if use == "trade_off" else f"{measure}, {use}" for measure, use in FORMS]
    assert all(any(name.endswith(f": {form}") for name in names) for form in wanted)
    assert all(0.0 < row["median"] <= row["p99"] for row in told["rows"])


def test_the_graph_of_the_whole_chain_has_its_stages(capsys):
    assert run(["graph", "humanoid_tsid", "--scenario", "whole_chain", "--format", "json"]) == 0
    blocks = {block["name"] for block in json.loads(capsys.readouterr().out)["blocks"]}
    assert {"terms", "task com", "reduction", "program"} <= blocks  # the inner stages of the whole-body controller
    assert {"torque_control", "guard", "actuators", "plant", "standing_state", "torque_estimator"} <= blocks
