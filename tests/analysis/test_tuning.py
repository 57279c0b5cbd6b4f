from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from drake_tc.analysis.torque_loop.tuned import joint_tasks
from drake_tc.analysis.tracking_error import JointTask, filtered_task, predicted_error, predicted_noise, sticking_error
from drake_tc.analysis.tuning import (
    Goal,
    SearchSpace,
    Setting,
    assess,
    default_goals,
    draw_fronts,
    pareto_front,
    present,
    quick_margins,
    setting_of,
    tune,
    with_setting,
)
from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.registry import diagram_entry

from .one_joint import DT, simulate, smooth_step

LOOP = JointLoop.with_equivalent_gains(
    1.0, 0.01, inertia=1.1, link_inertia=0.4, k_tau=1.2e-4, k_v=7e-3, k_tau_model=1.1e-4, k_v_model=6.5e-3
)
SMALL = SearchSpace(windows=(20, 50), kp=(1.0, 2.0), ki=(0.0, 10.0), k7=(0.8, 1.5), rounds=1)


def moved(loop=LOOP, ticks=1200):
    """(task, motion, load, dry) of one joint."""
    motion = smooth_step(ticks, 0.3, 0.5, 0.6)
    load = 6.0 * np.sin(motion[:, 0])
    dry = 3.0 * np.tanh(motion[:, 1] / 0.01)
    torque = loop.link_inertia * motion[:, 2] + load
    speed = np.diff(motion[:, 0], prepend=0.0, append=motion[-1, 0]) / DT  # of the step that ends at a tick
    needed = loop.k_tau * (loop.inertia * np.diff(speed) / DT + load + dry) + loop.k_v * speed[1:]
    rows = (*motion.T.copy(), torque, needed, np.zeros(ticks), np.zeros(ticks), np.ones(ticks))
    return JointTask("joint", (loop,), *rows, begin=280), motion, load, dry


@pytest.mark.parametrize(
    "changes", [{}, {"window": 31, "ki": 15.0}, {"window": 24, "kp": 0.5, "kd": 40.0, "ki": 5.0}, {"order": 3}]
)
def test_the_predicted_error_is_that_of_the_loop_run_tick_by_tick(changes):
    loop = replace(LOOP, **changes)
    task, motion, load, dry = moved(loop)
    found = predicted_error(filtered_task(task, loop.window, loop.order), loop)
    wanted, _ = simulate(loop, motion, load=load, dry=dry)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-7 * np.abs(wanted).max())


@pytest.mark.parametrize("changes", [{}, {"window": 31, "ki": 15.0}, {"kp": 0.5, "kd": 40.0, "k_v_model": 2e-3}])
def test_dry_friction_holds_the_joint_in_the_prediction_as_tick_by_tick(changes):
    """Friction that the controller compensates by a quarter too much; the joint sags before the law has taken over."""
    loop = replace(LOOP, **changes)
    task, motion, load, dry = moved(loop)
    load = load + 4.0
    friction, ticks = np.full(load.size, 3.0), load.size
    way = np.tanh(motion[:, 1] / 0.01)
    sliding = loop.k_tau * friction
    needed = task.needed + loop.k_tau * (4.0 - dry) + sliding * np.sign(motion[:, 1])
    share = np.minimum(np.arange(1.0, ticks + 1.0) / 200.0, 1.0)
    extra, torque = 1.25 * loop.k_tau_model * friction * way, task.torque + 4.0
    task = replace(task, torque=torque, needed=needed, extra=extra, dry=sliding, share=share)
    found = sticking_error(filtered_task(task, loop.window, loop.order), loop)
    given = -1.25 * loop.k_tau_model / loop.k_tau * friction * way * share  # what the law adds, at the motor
    wanted, _ = simulate(loop, motion, load=load, dry=given, friction=friction, share=share)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6 * np.abs(wanted).max())
    still = replace(task, dry=np.full(ticks, 1e3), needed=task.needed + (1e3 - sliding) * np.sign(motion[:, 1]))
    held = sticking_error(filtered_task(still, loop.window, loop.order), loop)
    np.testing.assert_allclose(held, motion[:, 0] - motion[0, 0], atol=1e-9)
    smooth = replace(task, dry=np.zeros(ticks), share=np.ones(ticks))
    filtered = filtered_task(smooth, loop.window, loop.order)
    linear = predicted_error(filtered, loop)
    np.testing.assert_allclose(sticking_error(filtered, loop), linear, atol=1e-9 * np.abs(linear).max())


@pytest.mark.parametrize(("window", "ki"), [(12, 20.0), (40, 0.0)])
def test_the_predicted_noise_is_that_of_the_loop_run_tick_by_tick(window, ki):
    loop = replace(LOOP, window=window, ki=ki)
    ticks, still = 8000, np.zeros(8000)
    task = replace(moved(loop)[0], encoder_noise=2e-5, torque_noise=0.3)
    generator = np.random.default_rng(1)
    drawn = {"encoder": 2e-5 * generator.normal(size=ticks), "torque": 0.3 * generator.normal(size=ticks)}
    errors, efforts = simulate(loop, np.zeros((ticks, 3)), load=still, dry=still, **drawn)
    error, effort = predicted_noise(task, loop)
    assert error == pytest.approx(np.std(errors[1000:]), rel=0.2)
    assert effort == pytest.approx(np.std(efforts[1000:]), rel=0.2)


@pytest.mark.slow
def test_the_prediction_holds_in_the_complete_leg():
    scenario = diagram_entry("hrp2_leg").scenario(
        "brisk_swing", text="{duration: 1.2, filters: {window: 40}, gains: {ki: 10.0}}"
    )
    recording = simulate_scenario(scenario)
    for i, task in enumerate(joint_tasks(scenario, begin=0.28)):
        error = predicted_error(filtered_task(task, 40, 2), task.loops[0])[280:]
        simulated = recording.tracking_error[recording.time >= 0.28, i]
        ratio = np.sqrt(np.mean(error**2)) / np.sqrt(np.mean(simulated**2))
        assert 0.75 < ratio < 1.35, task.joint


def random_loops(count):
    generator = np.random.default_rng(5)
    for _ in range(count):
        setting = Setting(
            int(generator.integers(8, 90)), 2, *(generator.uniform(0.0, high) for high in (9.0, 60.0, 0.06))
        )
        yield with_setting(replace(LOOP, k_v_model=LOOP.k_v * generator.uniform(0.5, 1.6)), setting)


def test_quick_margins_are_the_exact_ones_and_find_every_unstable_loop():
    unstable = 0
    for loop in random_loops(40):
        quick, radius = quick_margins(loop), loop.spectral_radius()
        if abs(radius - 1.0) < 2e-4:
            continue  # the border itself
        assert (quick is None) == (radius > 1.0)
        if quick is None:
            unstable += 1
            continue
        exact = loop.margins()
        if exact.sensitivity_peak > 5.0:  # a needle between two points of the grid
            assert quick.sensitivity_peak > 4.5
            continue
        assert quick.sensitivity_peak == pytest.approx(exact.sensitivity_peak, rel=0.01)
        assert quick.delay_margin == pytest.approx(exact.delay_margin, rel=0.01)
        if exact.gain_margin > 10.0:  # of many crossings near the Nyquist frequency each grid misses others
            assert quick.gain_margin > 9.0
            continue
        assert quick.gain_margin == pytest.approx(exact.gain_margin, rel=0.02)
    assert 5 < unstable < 30


def test_pareto_front_by_its_definition():
    costs = np.random.default_rng(2).integers(0, 6, size=(200, 3)).astype(float)
    costs[7] = np.nan
    front = pareto_front(costs)

    def beaten(row):
        return any(np.all(o <= row) and np.any(o < row) for o in costs)

    assert {tuple(costs[i]) for i in front} == {
        tuple(row) for row in costs if np.isfinite(row).all() and not beaten(row)
    }
    assert len({tuple(costs[i]) for i in front}) == front.size
    assert np.all(np.diff(costs[front, 0]) >= 0.0)
    assert pareto_front(np.zeros((0, 2))).size == 0
    with pytest.raises(ParamsError, match="shape"):
        pareto_front(np.zeros(3))


def test_a_setting_changes_the_gains_and_not_the_stiffness():
    setting = Setting(33, 3, 1.5, 7.0, 0.02)
    changed = with_setting(LOOP, setting)
    found = setting_of(changed)
    assert (found.window, found.order) == (33, 3)
    np.testing.assert_allclose([found.kp, found.ki, found.k7], [1.5, 7.0, 0.02], rtol=1e-12)
    k6 = [loop.ks * loop.k_tau_model * (1.0 + loop.kp) for loop in (LOOP, changed)]
    np.testing.assert_allclose(k6, 1.0, rtol=1e-12)


def test_tuning_beats_the_present_setting_at_equal_or_better_margins_wherever_it_runs():
    task, motion, load, dry = moved()
    heavy = replace(LOOP, inertia=1.3, link_inertia=0.6)
    task = replace(task, loops=(LOOP, heavy), encoder_noise=1e-5, torque_noise=0.05)
    here = tune([task], space=SMALL)
    (joint,) = here.joints
    assert here.tried == 2 * 8 + 125
    for loop in task.loops:
        after, before = with_setting(loop, joint.after.setting), loop
        assert after.spectral_radius() < 1.0
        assert after.margins().sensitivity_peak <= joint.goal.sensitivity_peak * 1.002
        assert after.margins().delay_margin >= joint.goal.delay_margin * 0.998
        assert before.spectral_radius() < 1.0
    old, _ = simulate(LOOP, motion, load=load, dry=dry)
    new, _ = simulate(with_setting(LOOP, joint.after.setting), motion, load=load, dry=dry)
    assert np.std(new[280:]) < 0.7 * np.std(old[280:])
    assert joint.after.noise <= joint.goal.noise
    with ThreadPoolExecutor(2) as executor:
        assert tune([task], space=SMALL, executor=executor) == here


def test_the_front_holds_the_best_and_is_drawn(tmp_path):
    task = replace(moved()[0], encoder_noise=1e-5)
    found = tune([task, replace(task, joint="other")], space=replace(SMALL, rounds=0))
    errors = [each.error for each in found.joints[0].front]
    assert errors == sorted(errors)
    assert min(errors) <= found.joints[0].after.error * (1.0 + 1e-9)  # without friction both are the linear error
    figure = Figure()
    draw_fronts(figure, found)
    figure.savefig(tmp_path / "front.png")
    assert [axis.get_title() for axis in figure.axes[:2]] == ["joint", "other"]


def test_what_cannot_be_tuned_is_refused_in_one_line():
    task = moved()[0]
    with pytest.raises(ParamsError, match="no window and gains keep the goal on joint; allow"):
        tune([task], [Goal(sensitivity_peak=1.0001)], SMALL)
    with pytest.raises(ParamsError, match="at least one joint"):
        tune([])
    with pytest.raises(ParamsError, match="sensitivity peak > 1"):
        Goal(sensitivity_peak=0.9)
    with pytest.raises(ParamsError, match="expected at least one value of kp"):
        SearchSpace(kp=())
    wild = replace(task, loops=(replace(LOOP, ks=0.0, k_v_model=5.0 * LOOP.k_v),))
    assert present(wild) is None and assess(wild, setting_of(wild.loops[0])) is None
    with pytest.raises(ParamsError, match="present setting of joint is unstable"):
        default_goals([wild])
    with pytest.raises(ParamsError, match=r"expected velocity of shape \(1200,\)"):
        replace(task, velocity=np.zeros(3))
