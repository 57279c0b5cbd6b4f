"""What the exported terms mean is settled in MuJoCo itself, against closed forms and Drake's free run."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link
from drake_tc.exchange.mujoco_run import simulate_in_mujoco
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.target_run import RunInput, target_free_run
from drake_tc.exchange.trial import RUNS, Exported, run_errors
from drake_tc.logs.rig import parse_rig
from drake_tc.loops.joint_bench import rig_free_run
from drake_tc.simulator_files.terms import Ripple, StribeckPeak, Terms

pytest.importorskip("mujoco")

H = 1e-3
T = np.arange(3000) * H
NONE = np.zeros(T.size)


def simulate(terms: Terms, pendulum: Link | None, command, load, start, period) -> np.ndarray:
    return simulate_in_mujoco(terms, pendulum, RunInput(command, load, start, period))


def test_the_second_number_of_damping_is_quadratic_friction():
    terms = Terms("torque", 1.0, armature=0.3, quadratic=2.0)
    released = simulate(terms, None, NONE, NONE, (0.0, 1.0), H)
    assert released[-1] == pytest.approx(0.15 * np.log(1.0 + T[-1] / 0.15), rel=2e-3)


def test_before_a_run_the_command_was_its_first_one():
    servo = Terms("position_servo", 5000.0, armature=0.3, damping=60.0, delay=0.01)
    found = simulate(servo, None, np.full(T.size, 0.5), NONE, (0.5, 0.0), H)
    np.testing.assert_allclose(found, 0.5, rtol=0, atol=1e-9)


def model(*more: EffectValue) -> ActuatorModel:
    effects = (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.3}),
        EffectValue("viscous", {"viscous": 20.0}),
        EffectValue("coulomb", {"coulomb": 1.5}),
    )
    return ActuatorModel("joint", Drive("position_servo", 2e-3), (*effects, *more))


@pytest.fixture(scope="module")
def recorded():
    """A rig and a run of the simulated bench with that model."""
    from drake_tc.diagrams.joint_bench import BenchScenario, record_bench
    from drake_tc.loops.joint_bench import Table

    time = np.arange(4000) * 1e-3
    command = 0.6 * np.sin(2.0 * time) + 0.1 * np.sin(5.0 * time)
    run = record_bench(model(), Table(time, command), BenchScenario(duration=4.0, link_inertia=0.5))
    return parse_rig({"joint": "joint", "drive": "position_servo"}, "rig.yaml"), run


def rms(a, b) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


def test_where_mujoco_has_all_effects_it_is_as_good_as_drake(recorded):
    rig, run = recorded
    _, measured, drake = rig_free_run(model(), rig, "joint", run)
    measured, exported = target_free_run(RUNS["mjcf"], model(), project(model(), TARGETS["mjcf"]).terms, rig, run)
    assert rms(measured, exported) < 1e-3 * np.std(measured)
    assert rms(drake, exported) < 1e-3 * np.std(measured)


def test_dry_friction_holds_a_joint_that_is_pushed_by_less():
    """A soft constraint would let it creep: with MuJoCo's own time constant of 20 ms, by 3.5 mrad/s."""
    load = np.full(T.size, -1.0)
    held = simulate(Terms("torque", 1.0, armature=0.3, frictionloss=1.5), None, NONE, load, (0.0, 0.0), H)
    assert np.abs(np.diff(held)).max() / H < 5e-4


@pytest.mark.parametrize("period", [1e-3, pytest.param(5e-4, marks=pytest.mark.slow)], ids=["1kHz", "2kHz"])
def test_on_the_demos_held_out_run_it_is_as_good_as_the_model(period):
    """All effects that MJCF has, on the demo's bench with its noise, load and pushes; ten seconds of its motion."""
    from drake_tc.cli.demo import DemoLength, demo_run

    quick = model(
        EffectValue("quadratic_viscous", {"quadratic_viscous": 3.0}),
        EffectValue("delay.command", {"delay": 0.004}),
        EffectValue("saturation", {"limit": 0.03}),
    )
    stiff = replace(quick, drive=Drive("position_servo", 2e-4))
    run = demo_run(stiff, "multisine_held_out", 0, DemoLength(duration=10.0, period=period), np.random.default_rng(0))
    rig = parse_rig({"joint": "joint", "drive": "position_servo"}, "rig.yaml")
    projection = project(stiff, TARGETS["mjcf"])
    assert projection.losses == () and projection.refit is None
    (row,) = run_errors({"joint": stiff}, Exported([projection], "mjcf"), rig, [run])
    print(f"RMS error of the position: {row.model:.3g} rad, {row.export:.3g} rad in MuJoCo")
    assert row.export <= 1.2 * row.model


def test_a_refit_of_stribeck_friction_is_better_than_leaving_it_out():
    stribeck = EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.2, "stribeck_exponent": 1.0})
    found = project(model(stribeck), TARGETS["mjcf"])
    assert found.refit is not None and found.refit.effects == ("stribeck",)
    assert found.refit.refitted < 0.7 * found.refit.dropped
    assert found.terms.frictionloss > 1.5 and found.losses == ()


def test_mujoco_writes_no_log_and_what_is_unstable_is_nan(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = simulate(Terms("torque", 1e12, armature=1e-6), None, np.full(T.size, 1e9), NONE, (0.0, 0.0), H)
    assert np.isnan(found[-1]) and found[0] == 0.0
    assert not list(tmp_path.iterdir())


def held_by_friction(terms, link, command, step=2e-5):
    """A servo with a Stribeck peak by small steps: friction takes at most what stops the joint."""
    inertia, q, v, out = terms.armature + link.inertia, 0.0, 0.0, np.empty(command.size)
    for i, wanted in enumerate(command):
        out[i] = q
        for _ in range(round(H / step)):
            torque = terms.kp * (wanted - q) - link.gravity_moment * np.sin(q) - terms.damping * v
            most = terms.frictionloss + terms.stribeck.height * np.exp(-((v / terms.stribeck.velocity) ** 2))
            stop = inertia / step * v + torque
            v += step * (torque - np.sign(stop) * min(abs(stop), most)) / inertia
            q += step * v
    return out


@pytest.mark.parametrize(
    ("armature", "dry", "peak", "kp", "damping"), [(0.3, 1.5, 1.0, 80.0, 10.0), (6e-3, 0.12, 0.1, 6.0, 0.1)]
)
def test_a_stribeck_peak_moves_as_by_small_steps(armature, dry, peak, kp, damping):
    require_version("3.12")
    link = Link(1.6 * armature, 0.3 * kp / 50.0, 0.0)
    terms = Terms("position_servo", kp, armature, damping, frictionloss=dry, stribeck=StribeckPeak(peak, 0.2, 2.0))
    command = 0.6 * np.sin(2.0 * T[:3000]) + 0.1 * np.sin(5.0 * T[:3000])
    expected = held_by_friction(terms, link, command)
    found, without = (
        simulate(each, link, command, NONE[:3000], (0.0, 0.0), H) for each in (terms, replace(terms, stribeck=None))
    )
    assert rms(found, expected) < 0.01 * np.std(expected)
    assert rms(without, expected) > 1.5 * rms(found, expected)


SMOOTH = {
    "spring": {"stiffness": 8.0, "preload": -1.5},
    "filter": {"lag": 0.05},
    "integral action": {"integral_rate": 3.0},
    "ripple": {"ripple": Ripple(0.7, -1.1, 6.0)},
    "limit of a damped servo": {"torque_limit": 4.0, "derivative_gain": 2.0},
    "elasticity": {"compliance": 0.004},
}


@pytest.mark.parametrize("kind", SMOOTH)
def test_terms_of_a_servo_move_as_their_equations(kind):
    """The equations of `terms`, integrated by SciPy."""
    from scipy.integrate import solve_ivp

    require_version("3.12")
    terms = replace(Terms("position_servo", 40.0, armature=0.1, damping=3.0), **SMOOTH[kind])
    link, size = Link(0.05, 2.0, 0.0), 2000
    command = 0.4 * np.sin(4.0 * T[:size])

    def rate(t, y):
        q, v, act, integral, far, speed = y
        wanted = command[min(int(t / H + 1e-9), size - 1)]
        effort = (act if terms.lag else wanted) - q
        drive = terms.kp * (effort + terms.integral_rate * integral) - terms.derivative_gain * v
        drive = np.clip(drive, -terms.torque_limit, terms.torque_limit) if terms.torque_limit else drive
        torque = drive - (terms.damping - terms.derivative_gain) * v - terms.stiffness * q - terms.preload
        if terms.ripple:
            angle = terms.ripple.cycles * q
            torque -= terms.ripple.cosine * np.cos(angle) + terms.ripple.sine * np.sin(angle)
        lag = (wanted - act) / terms.lag if terms.lag else 0.0
        if terms.compliance:
            gear = (q - far) / terms.compliance
            return [v, (torque - gear) / 0.1, lag, effort, speed, (gear - 2.0 * np.sin(far)) / 0.05]
        acceleration = (torque - 2.0 * np.sin(q)) / 0.15
        return [v, acceleration, lag, effort, v, acceleration]

    solved = solve_ivp(rate, (0.0, size * H), np.zeros(6), t_eval=T[:size], max_step=H, rtol=1e-7, atol=1e-9)
    expected = solved.y[4] if terms.compliance else solved.y[0]
    given = RunInput(command, NONE[:size], (0.0, 0.0), H, substeps=4)
    found = simulate_in_mujoco(terms, link, given)
    assert rms(found, expected) < 0.01 * np.std(expected)


def require_version(least: str) -> None:
    pytest.importorskip("mujoco", minversion=least)
