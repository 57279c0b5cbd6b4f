"""Joint damping, position loops and the largest pushes of Faraji et al. (2015)'s whole loop."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import models_of_joints
from drake_tc.control.series_elastic import MotorPositionControl
from drake_tc.control.stability_margins import margins
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015 import pushes
from drake_tc.diagrams.papers.faraji2015.motions import vibration
from drake_tc.errors import ParamsError
from drake_tc.loops.plant import Pushes
from drake_tc.loops.whole_body.running import build_tsid, simulate_tsid
from drake_tc.loops.whole_body.scenario import BaseEstimationSpec, SpringDrivesSpec, TsidScenario
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

FILE = Path(__file__).resolve().parents[4] / "diagrams" / "coman.scenario.yaml"
MODELS = FILE.parents[1] / "models" / "coman_like" / "coman_like_actuators.yaml"


def scenario(name, text=None):
    return TsidScenario.load(FILE, name, text)


def knee():
    """Jm N^2, F_v, volts a newton metre, Coulomb, supply: of the model file, by hand."""
    return models_of_joints(MODELS, ("r_knee",))["r_knee"], 0.12, 28.1667, 0.15, 24.0


# --- joint damping


def test_damping_takes_the_joints_velocities_off_the_torques():
    given = scenario("stand")
    drives = replace(given.series_elastic, joint_damping=3.0, damped_joints=("r_knee", "waist_yaw"))
    loop = build_tsid(replace(given, state="plant", estimator=BaseEstimationSpec(), series_elastic=drives))
    context = loop.diagram.CreateDefaultContext()
    plant, mine = loop.plant, loop.plant.GetMyMutableContextFromRoot(context)
    plant.SetVelocities(mine, np.random.default_rng(0).normal(size=plant.num_velocities()))
    control = loop.diagram.GetSubsystemByName("torque_control")
    wanted = control.GetInputPort("reference_torque").Eval(control.GetMyContextFromRoot(context))
    asked = loop.controller.GetOutputPort("torque").Eval(loop.controller.GetMyContextFromRoot(context))
    speeds = {joint: plant.GetJointByName(joint).get_angular_rate(mine) for joint in loop.robot.joints}
    taken = [3.0 * v if joint in ("r_knee", "waist_yaw") else 0.0 for joint, v in speeds.items()]
    assert np.abs(taken).max() > 0.1
    assert_allclose(asked - wanted, taken, atol=1e-12)


def test_damping_of_all_joints_goes_by_the_velocities_that_the_controller_has():
    loop = build_tsid(scenario("stand", "{series_elastic: {joint_damping: 1.5}}"))
    estimator, gain = (loop.diagram.GetSubsystemByName(name) for name in ("base_estimator", "joint_damping"))
    wires = loop.diagram.connection_map().items()
    sources = [source for target, source in wires if target[0].get_name() == "joint_damping"]
    assert [(source[0].get_name(), source[1]) for source in sources] == [
        ("base_estimator", estimator.GetOutputPort("estimated_state").get_index())
    ]
    wanted = np.zeros((loop.law.model.n, loop.plant.num_multibody_states()))
    for row, joint in enumerate(loop.robot.joints):
        wanted[row, loop.plant.num_positions() + loop.plant.GetJointByName(joint).velocity_start()] = -1.5
    assert_allclose(gain.D(), wanted)


# --- position loops


def test_the_voltage_is_the_gains_and_within_the_supply():
    model, _, _, gain, supply = knee()
    control = MotorPositionControl(100.0, [model, model, model])
    context = control.CreateDefaultContext()
    control.GetInputPort("motor_angle").FixValue(context, [0.1, 0.0, np.nan])
    control.GetInputPort("reference_angle").FixValue(context, [0.3, -9.0, 0.0])
    voltage = control.GetOutputPort("voltage").Eval(context)
    assert_allclose(voltage, [gain * 100.0 * 0.2, -supply, 0.0], rtol=1e-12)


def position_loop(kp):
    """Margins of one motor on its board: J theta'' + F_v theta' = kp (theta_ref - theta), the torque held for 1 ms."""
    _, inertia, damping, _, _ = knee()
    dt = 1e-3
    pole = np.exp(-damping / inertia * dt)
    lag = inertia / damping * (1.0 - pole)

    def response(omega):
        z = np.exp(1j * omega * dt)  # of the integrator's and the lag's steps, in partial fractions
        return kp / damping * (dt / (z - 1.0) - lag / (z - pole))

    return margins(response, dt)


def test_the_position_gain_is_what_the_rule_gives():
    """As much as leaves a delay margin of 5 ms and a sensitivity peak of 2, to 100 N m/rad: diagrams/sea_joint.md."""
    gain = scenario("pushed_held").series_elastic.position_gain
    chosen, more = position_loop(gain), position_loop(gain + 200.0)
    assert chosen.delay_margin >= 5e-3
    assert chosen.sensitivity_peak <= 2.0
    assert more.delay_margin < 5e-3


def test_held_motors_carry_the_robot_where_it_starts():
    run = simulate_tsid(scenario("pushed_held", "{duration: 0.06}"))
    joints = run["state"][:, run.law.model.positions]
    assert run.fell is None
    assert np.abs(joints - joints[0]).max() < 0.02  # links move on springs while the soles are loaded
    assert np.abs(run["applied_torque"]).max() > 8.0
    assert 0.5 < np.abs(run["voltage"]).max() < 24.0


# --- the largest push


def test_a_push_has_its_impulse():
    given = pushes.pushed(scenario("stand"), "sideways", 7.0)
    system = Pushes(make_plant(load_robot(MODELS.parent / "coman_like.yaml"), 0.0), given.pushes)
    context = system.CreateDefaultContext()
    total, dt = np.zeros(3), 1e-4
    for now in np.arange(0.0, given.duration, dt)[4000:7000]:
        context.SetTime(now)
        for force in system.get_output_port().Eval(context):
            total += dt * force.F_Bq_W.translational()
    assert_allclose(total, [0.0, 7.0, 0.0], atol=1e-3)
    assert given.duration == pytest.approx(3.1)


@pytest.mark.parametrize("first", [2.0, 12.0])
@pytest.mark.parametrize("truth", [0.7, 3.1, 6.0, 6.01, 11.9, 38.0])
def test_the_border_is_found_within_a_twentieth(truth, first):
    asked = []
    low, high = pushes.largest(lambda impulse: asked.append(impulse) or impulse <= truth, first)
    assert low <= truth < high <= 1.05 * low
    assert len(asked) == len(set(asked)) <= 13


def test_a_good_guess_costs_four_runs():
    asked = []
    pushes.largest(lambda impulse: asked.append(impulse) or impulse <= 6.3, 6.0)
    assert len(asked) == 4


def test_no_border_is_said_to_be_none():
    assert pushes.largest(lambda impulse: False, 6.0) == (0.0, pushes.LEAST)
    assert pushes.largest(lambda impulse: True, 6.0) == (pushes.MOST, np.inf)


@pytest.mark.parametrize(
    ("speed", "fell", "ends", "stands"),
    [(0.0, None, 3.1, True), (0.3, None, 3.1, False), (0.0, 2.0, 3.1, False), (0.0, None, 2.0, False)],
)
def test_what_counts_as_survived(speed, fell, ends, stands):
    time = np.arange(0.0, ends + 5e-4, 1e-3)
    state = np.zeros((time.size, 4 + 3 + 6))
    state[time < ends - 1.0, -1] = 5.0  # how fast it was earlier is another matter
    state[-1, -2] = speed
    model = SimpleNamespace(nq=7)

    class Run(SimpleNamespace):
        def __getitem__(self, name):
            return {"state": state}[name]

    run = Run(time=time, law=SimpleNamespace(model=model), fell=fell, scenario=SimpleNamespace(duration=3.1))
    assert pushes.stands(run) is stands


def known(ours, damped, stiff):
    time = np.linspace(0.0, 1.0, 5)
    run = pushes.Survived(time, 0.01 * time, 0.1 * time, 0.02)
    of = {pushes.OURS: ours, pushes.DAMPED: damped, pushes.STIFF: stiff}
    return {
        (loop, direction): pushes.Border(of[loop], 1.05 * of[loop], run if of[loop] else None)
        for loop in pushes.LOOPS
        for direction in pushes.DIRECTIONS
    }


def test_rows_from_known_borders():
    from matplotlib.figure import Figure

    result = pushes.reproduction(known(8.0, 4.0, 0.0))
    values = {row.name: row.value for row in result.rows}
    assert values[f"forward: {pushes.OURS} over {pushes.DAMPED}"] == 2.0
    assert values[f"forward: {pushes.OURS} over {pushes.STIFF}"] == 16.0  # nothing survived: over the least tried
    assert set(expectations("c_pushes")) <= set(values)
    assert result.tables[0].rows[0][1] == "8.0 / 8.4"
    assert result.tables[0].rows[2][-1] == "-"
    figure = Figure()
    result.figures["c_pushes"](figure)
    assert [len(axis.lines) for axis in figure.axes] == [2, 2, 2]


def test_a_controller_that_survives_less_is_reported_as_missed():
    result = pushes.reproduction(known(4.0, 8.0, 8.0))
    missed = {row.name for row in result.rows if row.met is False}
    assert {f"{direction}: {pushes.OURS} over {pushes.STIFF}" for direction in pushes.DIRECTIONS} <= missed


# --- whole runs


@pytest.mark.slow
def test_a_push_backwards_that_stiff_positions_do_not_survive():
    runs = [simulate_tsid(pushes.pushed(scenario(name), "backward", 4.5)) for name in ("pushed", "pushed_held")]
    assert [pushes.stands(run) for run in runs] == [True, False]


@pytest.mark.slow
def test_damping_of_all_joints_shakes_the_arms():
    """15 ms of delay are long for the inertia of an arm."""
    shaking = [
        vibration(simulate_tsid(scenario("stand", f"{{duration: 1.5, series_elastic: {{joint_damping: {d}}}}}")))
        for d in (0.0, 4.0)
    ]
    assert shaking[1] > 10.0 * shaking[0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SpringDrivesSpec(joint_damping=-1.0), "joint_damping: expected a number >= 0"),
        (lambda: SpringDrivesSpec(position_gain=np.nan), "position_gain: expected a number >= 0"),
        (
            lambda: SpringDrivesSpec(damped_joints=("r_knee",)),
            "series_elastic.damped_joints: expected a joint_damping > 0 beside it",
        ),
        (
            lambda: SpringDrivesSpec(position_gain=1.0, joint_damping=1.0),
            "series_elastic.joint_damping: expected 0 beside a position_gain",
        ),
        (
            lambda: SpringDrivesSpec(position_gain=1.0, acceleration_bandwidth=1.0),
            "series_elastic.acceleration_bandwidth: expected 0 beside a position_gain",
        ),
        (
            lambda: build_tsid(scenario("stand", "{series_elastic: {joint_damping: 1.0, damped_joints: [tail]}}")),
            "series_elastic.damped_joints: no joint 'tail'; there: r_hip_pitch",
        ),
        (lambda: MotorPositionControl(0.0, [knee()[0]]), "position_gain: expected a positive number"),
    ],
)
def test_what_is_refused(make, message):
    with pytest.raises(ParamsError, match=message):
        make()
