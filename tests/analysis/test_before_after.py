"""The closed loop before and after: a better model tracks better, margins are the closed form's, refusals are notes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.analysis.before_after import case, comparison
from drake_tc.analysis.before_after.case import (
    KNOT,
    RAMP,
    HeldOutMotion,
    LoopCase,
    Swing,
    eased,
    fitted_swing,
    held_out_motion,
    write_pendulum_robot,
    write_welded_robot,
)
from drake_tc.analysis.before_after.comparison import K7, SOUND, Trace, chosen_gains, compare_loops, run_case
from drake_tc.control.joint_loop import JointLoop
from drake_tc.control.stability_margins import margins
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import MotionSpec
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

SWING = Swing(inertia=0.9, weight=18.0, zero=0.1)
MOTION = HeldOutMotion(MotionSpec(times=(0.6, 0.9, 1.2), knots={"arm": (0.0, 0.2, 0.05)}), "run", 0.0, 0.6, 0.6, 1.2)


def a_model(*, gain=2e-4, viscous=32.0, coulomb=6.0, deadzone=0.0, kind="position_servo"):
    effects = [
        EffectValue("rotor_inertia", {"rotor_inertia": 0.31}),
        EffectValue("viscous", {"viscous": viscous}),
        EffectValue("coulomb", {"coulomb": coulomb}),
    ]
    if deadzone:
        effects.append(EffectValue("deadzone", {"deadzone": deadzone}))
    return ActuatorModel("arm", Drive(kind, gain), tuple(effects))


def a_case(folder, before, after, motion=MOTION):
    robot = write_pendulum_robot({"arm": SWING}, folder)
    return LoopCase(robot, "a pendulum", {"arm": before}, {"arm": after}, motion)


@pytest.fixture
def no_simulation(monkeypatch):
    """Traces of zeros in place of simulations; counts them."""
    seen = []

    def still(scenarios, progress, executor):
        seen.extend(scenarios)
        n = len(load_robot(scenarios["after"].path(scenarios["after"].robot)).joints)
        nil = np.zeros((10, n))
        return {side: Trace(np.arange(10) * 1e-3, nil, nil, ran_away=False, held=False) for side in scenarios}

    monkeypatch.setattr(comparison, "simulated", still)
    return seen


def test_the_loop_that_knows_friction_and_dead_zone_tracks_better(tmp_path):
    after = a_model(deadzone=1.5e-3)
    found = run_case(a_case(tmp_path, a_model(coulomb=0.0), after), tmp_path)
    arm = found.joints["arm"]
    assert found.changed and arm.changed
    assert found.notes == ()
    assert arm.after.rms_error < 0.5 * arm.before.rms_error
    assert_allclose(arm.after.rms_error, np.sqrt(np.mean(arm.error_after**2)), rtol=1e-2)  # thinned
    assert_allclose(arm.reference[[0, -1]], [0.0, 0.05], atol=1e-9)
    assert arm.before.spectral_radius == arm.after.spectral_radius  # neither enters the linear loop


def test_figures_of_the_linear_loop_are_those_of_the_closed_form(tmp_path, no_simulation):
    before, after = a_model(gain=1.5e-4, viscous=20.0), a_model()
    found = run_case(a_case(tmp_path, before, after), tmp_path).joints["arm"]
    assert no_simulation == ["before", "after"]
    kp, stiff = found.gains["kp"], 1.0 + found.gains["kp"]
    for model, figures in ((before, found.before), (after, found.after)):
        k_tau = model.drive.gain
        viscous = next(v.parameters["viscous"] for v in model.effects if v.key == "viscous")
        loop = JointLoop(
            inertia=0.9 + 0.31,
            link_inertia=0.9,
            k_tau=2e-4,
            k_v=2e-4 * 32.0,
            k_tau_model=k_tau,
            k_v_model=k_tau * viscous,
            kp=kp,
            ks=found.gains["k6"] / (k_tau * stiff),
            kd=K7 / (k_tau * stiff),
            gravity_stiffness=18.0 * np.cos(0.1),
        )
        exact = margins(loop.open_loop, loop.dt)
        assert_allclose(figures.spectral_radius, loop.spectral_radius(), rtol=1e-6)
        assert_allclose(figures.gain_margin, exact.gain_margin, rtol=1e-3)  # a grid of 0.77 rad/s, straight between
        assert_allclose(figures.phase_margin, exact.phase_margin, rtol=1e-2)
        assert_allclose(figures.delay_margin, exact.delay_margin, rtol=1e-2)
        assert_allclose(figures.sensitivity_peak, exact.sensitivity_peak, rtol=1e-3)
    assert found.after.sensitivity_peak <= SOUND


def test_gains_are_softened_until_the_loop_is_sound():
    sound = JointLoop(inertia=2.0, link_inertia=1.0, k_tau=1e-4, k_v=0.01, k_tau_model=1e-4, k_v_model=0.01)
    light = replace(sound, inertia=0.05, link_inertia=0.04)
    chosen = chosen_gains({"a": sound, "b": light}).by_joint
    assert chosen["a"]["k6"] >= chosen["b"]["k6"]
    for loop, gains in ((sound, chosen["a"]), (light, chosen["b"])):
        stiff = loop.k_tau_model * (1.0 + gains["kp"])
        used = replace(loop, kp=gains["kp"], ks=gains["k6"] / stiff, kd=gains["k7"] / stiff)
        assert used.spectral_radius() < 1.0
        assert used.margins().sensitivity_peak <= SOUND * 1.01


def test_one_model_means_one_simulation_and_it_is_said(tmp_path, no_simulation):
    found = run_case(a_case(tmp_path, a_model(), a_model()), tmp_path)
    assert not found.changed and not found.joints["arm"].changed
    assert no_simulation == ["after"]
    assert found.joints["arm"].before == found.joints["arm"].after


def test_the_guard_holds_a_loop_that_is_unstable_and_it_errs_widely(tmp_path):
    found = run_case(a_case(tmp_path, a_model(viscous=400.0), a_model()), tmp_path)
    arm = found.joints["arm"]
    assert arm.before.spectral_radius > 1.0 > arm.after.spectral_radius
    assert np.isnan(arm.before.gain_margin)
    assert np.isfinite(arm.after.rms_error)
    assert arm.after.rms_error < 0.01
    assert not any("ran away" in note for note in found.notes)
    assert arm.before.rms_error > 5.0 * arm.after.rms_error


def test_another_drive_has_margins_alone(tmp_path, no_simulation):
    found = run_case(a_case(tmp_path, a_model(kind="current", viscous=20.0), a_model(kind="current")), tmp_path)
    assert no_simulation == []
    assert found.time is None
    assert np.isnan(found.joints["arm"].after.rms_error)
    assert found.joints["arm"].after.spectral_radius < 1.0
    assert "this rig has a current drive" in found.notes[0]


def leg_case(robot, actuators):
    entry = diagram_entry("hrp2_leg").scenario("stairs_swing")
    after = load_models(entry.path("../models/hrp2_like/hrp2_like_leg_actuators.yaml"))
    yaw = after["r_hip_yaw"]
    before = after | {"r_hip_yaw": replace(yaw, effects=tuple(v for v in yaw.effects if v.key != "coulomb"))}
    knots = {joint: positions[:2] for joint, positions in entry.motion.knots.items()}
    motion = replace(entry.motion, times=(0.6, 0.95), knots=knots)
    chosen = ({joint: models[joint] for joint in actuators} for models in (before, after))
    return LoopCase(robot, "leg", *chosen, HeldOutMotion(motion, "r", 0.0, 0.35, 0.6, 0.95))


@pytest.fixture
def leg():
    return diagram_entry("hrp2_leg").scenario("stairs_swing").path("../models/hrp2_like/hrp2_like_leg.yaml")


@pytest.fixture
def changed_leg(leg, tmp_path):
    """changed_leg(old, new): the leg's file elsewhere, with a text in it changed."""

    def change(old, new):
        path = tmp_path / "changed.yaml"
        text = leg.read_text().replace("urdf: ", f"urdf: {leg.resolve().parent}/")
        path.write_text(text.replace("actuators: ", f"actuators: {leg.resolve().parent}/").replace(old, new))
        return path

    return change


LEG = ("r_hip_yaw", "r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch", "r_ankle_roll")


def test_a_leg_with_sensors_runs_and_its_joints_are_its_own(leg, tmp_path):
    found = run_case(leg_case(leg, LEG), tmp_path)
    assert tuple(found.joints) == LEG
    ratios = {joint: loop.before.rms_error / loop.after.rms_error for joint, loop in found.joints.items()}
    assert [joint for joint, loop in found.joints.items() if loop.changed] == ["r_hip_yaw"]
    assert ratios.pop("r_hip_yaw") > 1.3
    assert_allclose(list(ratios.values()), 1.0, atol=0.1)  # the others feel it through the links alone
    ends = {joint: loop.reference[-1] for joint, loop in found.joints.items()}
    assert_allclose([ends["r_knee"], ends["r_hip_pitch"]], [1.65, -0.95], atol=1e-6)


def test_a_base_that_floats_is_held_and_it_is_said(changed_leg, tmp_path, no_simulation):
    found = run_case(leg_case(changed_leg("fixed_base: true", "fixed_base: false"), LEG), tmp_path)
    assert "held still" in found.notes[0]
    assert all(np.isfinite(j.after.spectral_radius) for j in found.joints.values())


def test_a_welded_file_is_the_same_robot(changed_leg, tmp_path):
    robot = load_robot(changed_leg("fixed_base: true", "fixed_base: false"))
    welded = load_robot(write_welded_robot(robot, tmp_path))
    assert welded.fixed_base and not robot.fixed_base
    assert (welded.joints, welded.urdf, welded.base) == (robot.joints, robot.urdf, robot.base)
    assert welded.actuators == robot.actuators
    assert_allclose(welded.posture, robot.posture)


def test_a_controller_that_does_not_know_a_mass_has_another_plant_than_it_thinks(leg, tmp_path, no_simulation):
    case = leg_case(leg, LEG)
    same = replace(case, before=case.after, shared=({"effect": "link_mass", "where": "r_thigh", "mass": 3.0},))
    found = run_case(same, tmp_path)
    pitch = found.joints["r_hip_pitch"]
    assert found.changed and no_simulation == ["before", "after"]
    assert pitch.before.sensitivity_peak != pitch.after.sensitivity_peak
    assert found.joints["r_ankle_roll"].before.sensitivity_peak == found.joints["r_ankle_roll"].after.sensitivity_peak


def test_joints_beyond_the_rig_take_the_robots_own_actuators(leg, changed_leg, tmp_path, no_simulation):
    found = run_case(leg_case(leg, LEG[:2]), tmp_path)
    assert tuple(found.joints) == LEG[:2]
    with pytest.raises(ParamsError, match=r"'r_ankle_pitch' of changed\.yaml is neither in the rig nor"):
        run_case(leg_case(changed_leg("actuators: ", "# "), LEG[:2]), tmp_path)


def test_what_cannot_be_made_is_one_note(monkeypatch):
    def refuse(*arguments):
        raise ParamsError("the load of arm is unknown, so there is no plant to simulate")

    monkeypatch.setattr(comparison, "loop_case", refuse)
    found = compare_loops(None)
    assert found.joints == {}
    assert found.notes == ("No closed loop was made: the load of arm is unknown, so there is no plant to simulate.",)


def test_causes_that_no_joint_owns_are_in_the_plant_or_named():
    def cause(key, title, where, value):
        return SimpleNamespace(id=key, title=title, where=where, parameters={"mass": estimate(value)})

    def estimate(value):
        return SimpleNamespace(value=value, ci95=(0.0, 1.0))

    causes = [
        cause("link_mass", "mass of a link", "thigh", 0.8),
        cause("ft_bias", "bias of an F/T sensor", "ankle", 3.0),
    ]
    (entry,), notes = case._shared(causes)
    assert (entry["effect"], entry["where"], entry["mass"]) == ("link_mass", "thigh", 0.8)
    assert "mass of a link (thigh)" in notes[0]
    assert notes[1].endswith("neither before nor after: bias of an F/T sensor (ankle).")
    assert case._shared([]) == ((), ())


def test_a_pendulum_robot_weighs_what_it_should(tmp_path):
    swings = {"<a> & b": SWING, "light": Swing(0.02, 0.0), "heavy": Swing(5.0, 400.0, -2.0), "slow": Swing(40.0, 1.0)}
    plant = make_plant(load_robot(write_pendulum_robot(swings, tmp_path)), 0.0)
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(0)
    q, vdot = rng.uniform(-3, 3, 4), rng.normal(size=4)
    order = [plant.GetJointByName(name).position_start() for name in swings]
    placed, moved = np.zeros(4), np.zeros(4)
    placed[order], moved[order] = q, vdot
    plant.SetPositions(context, placed)
    nothing = np.zeros(4)
    gravity = plant.CalcGravityGeneralizedForces(context)
    torque = plant.CalcMassMatrix(context) @ moved + plant.CalcBiasTerm(context) - gravity + nothing
    wanted = [s.inertia * a + s.weight * np.sin(p - s.zero) for s, a, p in zip(swings.values(), vdot, q, strict=True)]
    assert_allclose(torque[order], wanted, rtol=1e-9, atol=1e-9)


def test_a_measured_load_is_a_pendulum_or_none():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 10.0, 0.01)
    q = 0.8 * np.sin(2.0 * time) + 0.3 * np.sin(5.1 * time)
    v, a = np.gradient(q, time), np.gradient(np.gradient(q, time), time)
    load = 0.9 * a + 18.0 * np.sin(q - 0.2) + 1.5 * v + rng.normal(0.0, 0.3, q.size)
    found = fitted_swing(q, v, a, load)
    assert found is not None
    swing, share = found
    assert_allclose([swing.inertia, swing.weight, swing.zero], [0.9, 18.0, 0.2], rtol=0.05)
    assert share > 0.98
    assert fitted_swing(q, v, a, load + 20.0 * np.sin(1.3 * time)) is None
    assert fitted_swing(q, v, a, -0.9 * a) is None


def a_side(position, segments, period=5e-3):
    time = np.arange(position.size) * period
    velocity = np.gradient(position, period)
    signals = SimpleNamespace(position=position, velocity=velocity, time=time, period=period)

    class Sized(SimpleNamespace):
        def __len__(self):
            return position.size

    return SimpleNamespace(
        signals=Sized(**vars(signals)),
        segments=segments,
        light=SimpleNamespace(margin=4),
        runs=("quiet", "lively"),
        run_of_sample=(np.arange(position.size) >= 2000).astype(int),
    )


def test_the_liveliest_stretch_is_followed_from_rest_to_rest():
    time = np.arange(4000) * 5e-3
    size = np.where(time < 10.0, 0.05, 0.3) * np.where((time > 14.0) & (time < 17.0), 1.5, 1.0)
    q = size * np.sin(3.0 * time)
    side = a_side(q, (slice(0, 2000), slice(2000, 4000)))
    found = held_out_motion({"arm": side}, 2.0, 0.7)
    assert found is not None
    assert found.run == "lively"
    assert 13.0 < found.start < found.end < 18.0
    assert_allclose(found.end - found.start, 2.0, atol=0.01)
    assert_allclose([found.begin, found.finish], [0.7, 2.7 + RAMP], atol=0.01)
    path = knot_trajectory(np.array(found.spec.times), np.array(found.spec.knots["arm"])[:, None])
    fine = np.linspace(found.begin, found.finish, 500)
    rate = path.MakeDerivative(1)
    speed = np.array([rate.value(t)[0, 0] for t in fine])
    assert np.abs(speed).max() < 1.1 * np.abs(side.signals.velocity).max()
    assert found.spec.posture["arm"] == found.spec.knots["arm"][0]
    assert held_out_motion({"arm": a_side(q[:150], (slice(0, 150),))}, 2.0, 0.7) is None


def test_time_is_eased_in_and_out():
    times, places = eased(3.0)
    assert_allclose([places[0], places[-1], times[-1]], [0.0, 3.0, 3.0 + RAMP], atol=1e-12)
    rate = np.diff(places) / np.diff(times)
    assert np.all(rate > 0.0) and rate.max() < 1.001
    assert rate[0] < 0.05 and rate[-1] < 0.05
    assert_allclose(rate[len(rate) // 2], 1.0, rtol=1e-3)
    assert_allclose(np.diff(times), KNOT, rtol=0.02)
