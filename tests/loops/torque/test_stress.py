"""Steps, periods, gains and surroundings that nobody would choose: converging, bounded, or one clean line."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from sweeps import slow_but

from drake_tc.cli.main import run as run_command
from drake_tc.errors import SimulationError
from drake_tc.loops.torque.running import RUNAWAY_SPEED, simulate_scenario
from drake_tc.registry import diagram_entry
from drake_tc.robot.plant import joint_limits

SWING, CONTACT = ("hrp2_leg", "brisk_swing"), ("hrp2_leg_contact", "brisk_force_sine")


@cache
def run(which, text):
    diagram, name = which
    return simulate_scenario(diagram_entry(diagram).scenario(name, text=text))


def sane(recording):
    """Finite throughout; commands close to the joints, joints bounded by their drives."""
    assert all(np.isfinite(recording[name]).all() for name in ("command", "joint_state", "actuation", "mode"))
    limits = joint_limits(recording.robot)
    assert np.abs(recording.velocity).max() < 2.0 * limits.velocity.max()
    assert np.abs(recording.tracking_error).max() < 1.5
    assert np.abs(recording["command"] - recording["encoder"]).max() < 0.25  # the guard's 0.2 and a joint on its way


@pytest.mark.parametrize("controller", ["servo", pytest.param("torque", marks=pytest.mark.slow)])
def test_trajectories_converge_with_the_step_of_the_plant(controller):
    steps = (1e-3, 5e-4, 2.5e-4)
    runs = [run(SWING, f"{{sensors: perfect, controller: {controller}, plant_step: {step}}}") for step in steps]
    coarse, fine = (np.abs(a.position - b.position).max(axis=0) for a, b in pairwise(runs))
    assert coarse.max() < 1.5e-3  # of a swing of 1 rad
    ratio = coarse / fine
    assert np.all((ratio > 1.7) & (ratio < 2.3))  # first order: half the step, half the error


@pytest.mark.slow
def test_contact_forces_agree_for_all_steps_of_the_plant():
    runs = [run(CONTACT, f"{{sensors: perfect, plant_step: {step}}}") for step in (1e-3, 5e-4, 2.5e-4)]
    for a, b in pairwise(runs):
        np.testing.assert_allclose(a.position, b.position, atol=1e-5)
        np.testing.assert_allclose(a["contact_wrench"], b["contact_wrench"], atol=0.5)  # of 150 N


@pytest.mark.parametrize(
    ("which", "period", "plant"),
    [
        (SWING, 0.005, 0.005),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in [
                (SWING, 0.002, 0.002),
                (SWING, 0.002, 0.001),
                (SWING, 0.005, 0.001),
                (CONTACT, 0.002, 0.002),
                (CONTACT, 0.005, 0.001),
            ]
        ),
    ],
)
def test_slower_control_with_the_same_filter_time(which, period, plant):
    window = round(0.08 / period)
    recording = run(which, f"{{dt: {period}, plant_step: {plant}, filters: {{window: {window}}}}}")
    sane(recording)
    assert not recording["flags"].any()
    assert np.abs(recording.tracking_error).max() < 6e-3


@pytest.mark.slow
@pytest.mark.parametrize("plant", [0.005, 0.001])
@pytest.mark.parametrize("which", [SWING, CONTACT])
def test_slow_control_with_a_filter_of_half_a_second(which, plant):
    sane(run(which, f"{{dt: 0.005, plant_step: {plant}}}"))


GAINS = ("k6: 50", "kp: 50", "k6: 50, kp: 50", "k7: 50", "ki: 1000", "kf: 50")


@pytest.mark.parametrize(
    ("which", "gains"), slow_but([(w, g) for w in (SWING, CONTACT) for g in GAINS], (SWING, "k6: 50, kp: 50"))
)
def test_absurd_gains_are_caught_by_monitor_and_guard(which, gains):
    sane(run(which, f"{{gains: {{{gains}}}}}"))


@pytest.mark.slow
@pytest.mark.parametrize("gains", ["kp: 50", "k7: 50"])
def test_absurd_gains_without_a_monitor_are_still_bounded_by_the_guard(gains):
    off = ", ".join(f"{name}: .inf" for name in ("force_jump", "moment_jump", "unexpected_force", "unexpected_moment"))
    recording = run(SWING, f"{{gains: {{{gains}}}, monitor: {{{off}}}}}")
    assert not recording["flags"].any()
    assert np.isfinite(recording["command"]).all()
    assert np.abs(recording["command"] - recording["encoder"]).max() < 0.25
    assert np.abs(recording.velocity).max() < RUNAWAY_SPEED


@pytest.mark.slow
@pytest.mark.parametrize(
    "box",
    [
        "size: [0.5, 0.4, 0.2], xyz: [0.0, -0.1, 0.37]",
        "size: [0.5, 0.4, 0.2], xyz: [0.0, -0.1, 0.6]",
        "size: [0.5, 0.4, 2.0], xyz: [0.0, -0.1, 1.0]",
        "size: [0.5, 0.4, 0.2], xyz: [0.0, -0.1, 0.27345], friction: 0.0",
    ],
    ids=["sole 10 cm deep", "shin inside", "whole leg inside", "ice"],
)
def test_deep_overlap_and_no_friction(box):
    sane(run(CONTACT, f"{{objects: [{{{box}}}]}}"))


BLOW = "{pushes: [{link: r_foot, begin: 0.3, duration: 0.5, force: [1.0e+7, 0.0, 0.0]}]}"


def test_a_runaway_names_system_and_time():
    diagram, name = SWING
    with pytest.raises(SimulationError, match=r"system 'plant' ran away by t = 0\.3\d* s: \w*r_\w+ is "):
        simulate_scenario(diagram_entry(diagram).scenario(name, text=BLOW))
    kept = simulate_scenario(diagram_entry(diagram).scenario(name, text=BLOW), allow_runaway=True)
    assert 0.3 < kept.time[-1] < 0.45
    assert np.isfinite(kept["command"]).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [(BLOW, "system 'plant' ran away by t = 0.3"), ("{gains: {k5: 1}}", "unknown key 'k5'; allowed: k6, k7")],
)
def test_the_command_ends_with_one_line_and_exit_2(text, message, capsys):
    arguments = ["simulate", "hrp2_leg", "--scenario-name", "brisk_swing", "--scenario-text", text, "--json"]
    assert run_command(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert message in line
