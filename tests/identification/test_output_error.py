"""Output error: a stick-slip joint identified back, the prior, divergence, and what is free to change."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.free_run import simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link, PositionLoop, Recording, in_plant
from drake_tc.errors import IdentificationError
from drake_tc.identification.free_parameters import free_parameters
from drake_tc.identification.output_error import (
    FreeRunErrors,
    OutputErrorOptions,
    Trial,
    refine_on_free_runs,
    trial_error,
)

INERTIA, MOMENT = 0.0049, 0.48


def motor(gain: float, viscous: float, load_friction: float, inertia: float = 0.002, **more: float) -> ActuatorModel:
    """A voltage drive; every number has an interval of half its size."""
    numbers = {
        "rotor_inertia": ("rotor_inertia", inertia),
        "viscous": ("viscous", viscous),
        "load_dependent_friction": ("load_friction", load_friction),
        **{key: (key, value) for key, value in more.items()},
    }
    effects = (
        EffectValue(key, {name: x}, {name: (0.5 * x, 1.5 * x)} if x else {}) for key, (name, x) in numbers.items()
    )
    return ActuatorModel("servo", Drive("voltage", gain), tuple(effects))


def trial(command: np.ndarray, position: np.ndarray, period: float, run: int = 0) -> Trial:
    span = (float(position.min()), float(position.max()))
    time = np.arange(command.size) * period
    loop = PositionLoop(8.0, 7.3)
    recording = Recording(time, command, float(position[0]), 0.0, span, pendulum=Link(INERTIA, MOMENT), loop=loop)
    return Trial("run", run, recording, position)


def errors_of(model: ActuatorModel, trials: list[Trial], step: float = 2e-3) -> FreeRunErrors:
    gain = {("drive", "gain"): (0.9 * model.drive.gain, 1.1 * model.drive.gain)}
    return FreeRunErrors(free_parameters(model, gain), trials, step)


def followed(truth: ActuatorModel, command: np.ndarray, period: float, run: int = 0) -> Trial:
    """The trial that the true model records, simulated at half a millisecond."""
    blank = trial(command, np.array([0.0, 1.0]).repeat(command.size // 2), period)
    placed = in_plant(truth, replace(blank.recording, initial_position=0.0))
    assert placed is not None
    return trial(command, simulate(*placed, 5e-4), period, run)


def test_a_joint_that_sticks_is_identified_back():
    period = 4e-3
    t = np.arange(750) * period
    truth = motor(9.0, 0.04, 0.4)
    commands = [1.5 * np.sin(2.0 * t), np.sin(1.5 * t**2), 0.9 * t / 3.0]
    trials = [followed(truth, command, period, k) for k, command in enumerate(commands)]
    start = motor(11.0, 0.03, 0.25, 0.003)
    errors = errors_of(start, trials, 1e-3)
    found = refine_on_free_runs(errors, range(3), OutputErrorOptions(step=1e-3, evaluations=12)).model
    before, after = (max(np.abs(trial_error(m, t, 1e-3)).mean() for t in trials) for m in (start, found))
    assert after < 0.1 * before
    values = {v.key: next(iter(v.parameters.values())) for v in found.effects}
    assert_allclose(found.drive.gain, 9.0, rtol=0.03)  # the fit steps twice as far as the truth, and the prior pulls
    assert_allclose(values["load_dependent_friction"], 0.4, rtol=0.05)
    assert_allclose(values["viscous"], 0.04, rtol=0.05)


def test_numbers_without_an_interval_and_a_held_gain_keep_their_value():
    t = np.arange(300) * 4e-3
    run = trial(np.sin(2.0 * t), 0.3 * np.sin(2.0 * t), 4e-3)
    start = motor(10.0, 0.03, 0.3)
    held = replace(start, effects=(EffectValue("rotor_inertia", {"rotor_inertia": 0.002}), *start.effects[1:]))
    free = free_parameters(held, {("drive", "gain"): (10.0, 10.0)})
    assert [(e.key, e.name) for e in free.entries] == [
        ("viscous", "viscous"),
        ("load_dependent_friction", "load_friction"),
    ]
    found = refine_on_free_runs(FreeRunErrors(free, [run], 2e-3), [0], OutputErrorOptions(evaluations=2)).model
    assert found.drive.gain == 10.0
    assert found.inertia == 0.002


def test_nothing_to_follow_is_refused():
    with pytest.raises(IdentificationError, match="expected a trial"):
        refine_on_free_runs(errors_of(motor(10.0, 0.03, 0.3), []), [], OutputErrorOptions())


def test_the_equation_error_decides_what_the_runs_leave_open():
    """A joint that never moves says nothing of its viscous friction."""
    t = np.arange(200) * 4e-3
    still = trial(0.02 * np.sin(2.0 * t), np.zeros_like(t), 4e-3)
    start = motor(10.0, 0.06, 0.3, coulomb=0.2)
    found = refine_on_free_runs(errors_of(start, [still]), [0], OutputErrorOptions()).model
    assert_allclose(found.effects[1].parameters["viscous"], 0.06, rtol=0.02)  # motion of microradians is no evidence


def test_a_run_that_diverges_has_finite_errors_and_the_search_stays_finite():
    """A servo of 50 N m/rad that answers 50 ms late runs away; without the delay it follows."""
    t = np.arange(400) * 5e-3
    servo = ActuatorModel(
        "servo",
        Drive("position_servo", 0.02),
        (
            EffectValue("viscous", {"viscous": 1e-4}, {"viscous": (5e-5, 2e-4)}),
            EffectValue("delay.loop", {"delay": 0.05}, {"delay": (0.03, 0.07)}),
        ),
    )
    command = 0.3 * np.sin(3.0 * t)
    recording = Recording(t, command, 0.0, 0.0, (-0.3, 0.3), pendulum=Link(INERTIA, MOMENT))
    run = Trial("run", 0, recording, command)
    assert not np.isfinite(simulate(servo, recording, 2e-3)).all()
    error = trial_error(servo, run, 2e-3)
    assert np.isfinite(error).all() and np.abs(error).max() <= np.ptp(command)
    free = free_parameters(servo, {("drive", "gain"): (0.01, 0.03)})
    found = refine_on_free_runs(FreeRunErrors(free, [run], 2e-3), [0], OutputErrorOptions(evaluations=3))
    assert np.isfinite(found.x).all() and np.isfinite(trial_error(found.model, run, 2e-3)).all()


def test_a_point_is_simulated_once_and_in_any_order_alike():
    t = np.arange(200) * 4e-3
    runs = [trial(np.sin(w * t), 0.5 * np.sin(w * t), 4e-3, k) for k, w in enumerate((1.0, 2.0))]
    errors = errors_of(motor(10.0, 0.03, 0.3), runs)
    x = errors.free.start
    both = errors.at([x], [0, 1])[0]
    assert len(errors.known) == 2
    alone = [errors.at([x], [i])[0] for i in (0, 1)]
    assert len(errors.known) == 2
    assert_allclose(np.concatenate(alone), both, rtol=0.0, atol=0.0)  # the same numbers, looked up
