"""Output error: the simulation against another integrator, and a stick-slip joint identified back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.position_loop import PositionLoop
from drake_tc.errors import IdentificationError
from drake_tc.identification.output_error import (
    OutputErrorOptions,
    Trial,
    free_parameters,
    refine_on_free_runs,
    simulate,
)

INERTIA, MOMENT = 0.0049, 0.48


def motor(gain: float, viscous: float, load_friction: float, inertia: float = 0.002) -> ActuatorModel:
    return ActuatorModel(
        "servo",
        Drive("voltage", gain),
        (
            EffectValue("rotor_inertia", {"rotor_inertia": inertia}),
            EffectValue("viscous", {"viscous": viscous}),
            EffectValue("load_dependent_friction", {"load_friction": load_friction}),
        ),
    )


def trial(command: np.ndarray, position: np.ndarray, period: float, gain: float = 8.0) -> Trial:
    return Trial("run", period, command, position, 0.0, INERTIA, MOMENT, loop=PositionLoop(gain, 7.3))


def test_simulation_agrees_with_an_adaptive_integrator_where_there_is_no_dry_friction():
    period = 5e-4
    t = np.arange(4000) * period
    command = 0.8 * np.sin(3.0 * t)
    run = trial(command, np.zeros_like(t), period)
    model = motor(10.0, 0.03, 0.0)

    def slope(time: float, x: np.ndarray) -> list[float]:
        volts = np.clip(8.0 * (0.8 * np.sin(3.0 * time) - x[0]), -7.3, 7.3)
        return [x[1], (volts / 10.0 - 0.03 * x[1] - MOMENT * np.sin(x[0])) / (INERTIA + 0.002)]

    reference = solve_ivp(slope, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    assert_allclose(simulate(model, run, period), reference, atol=2e-3)  # first order in the step of 0.5 ms


def test_a_joint_that_sticks_is_identified_back():
    period = 4e-3
    t = np.arange(750) * period
    truth = motor(9.0, 0.04, 0.4)
    commands = [1.5 * np.sin(2.0 * t), np.sin(1.5 * t**2), 0.9 * t / 3.0]
    trials = []
    for command in commands:
        blank = trial(command, np.zeros_like(t), period)
        trials.append(trial(command, simulate(truth, blank, 1e-3), period))
    found = refine_on_free_runs(motor(11.0, 0.03, 0.25, 0.003), trials, OutputErrorOptions(step=2e-3))
    values = {v.key: next(iter(v.parameters.values())) for v in found.model.effects}
    assert found.after.max() < 0.1 * found.before.max()
    assert_allclose(found.model.drive.gain, 9.0, rtol=0.02)  # the fit steps twice as far as the truth
    assert_allclose(values["load_dependent_friction"], 0.4, rtol=0.05)
    assert_allclose(values["viscous"], 0.04, rtol=0.05)


def test_fixed_parameters_keep_their_value():
    t = np.arange(300) * 4e-3
    run = trial(np.sin(2.0 * t), 0.3 * np.sin(2.0 * t), 4e-3)
    start = motor(10.0, 0.03, 0.3)
    fixed = frozenset({"drive.gain", "rotor_inertia.rotor_inertia"})
    assert free_parameters(start, fixed) == ("viscous.viscous", "load_dependent_friction.load_friction")
    found = refine_on_free_runs(start, [run], OutputErrorOptions(fixed=fixed, evaluations=2))
    assert found.model.drive.gain == 10.0
    assert found.model.inertia == 0.002


def test_nothing_to_follow_is_refused():
    with pytest.raises(IdentificationError, match="wanted a trial"):
        refine_on_free_runs(motor(10.0, 0.03, 0.3), [])


def test_a_prior_decides_what_the_runs_leave_open():
    """A joint that never moves says nothing of its viscous friction: with a prior, its value; without, the start's."""
    t = np.arange(200) * 4e-3
    command = 0.02 * np.sin(2.0 * t)
    still = trial(command, np.zeros_like(t), 4e-3)
    load = EffectValue("coulomb", {"coulomb": 0.2})
    models = [motor(10.0, viscous, 0.3) for viscous in (0.03, 0.06)]
    start, prior = (ActuatorModel(m.joint, m.drive, (*m.effects, load)) for m in models)
    with_prior = refine_on_free_runs(start, [still], OutputErrorOptions(prior=prior))
    without = refine_on_free_runs(start, [still], OutputErrorOptions())
    viscous = [fitted.model.effects[1].parameters["viscous"] for fitted in (with_prior, without)]
    assert_allclose(viscous, [0.06, 0.03], rtol=0.02)  # held by the bristle: the motion of microradians is no evidence


def test_a_prior_of_other_effects_is_refused():
    t = np.arange(100) * 4e-3
    run = trial(np.sin(t), np.sin(t), 4e-3)
    other = ActuatorModel("servo", Drive("voltage", 10.0))
    with pytest.raises(IdentificationError, match="prior with the effects"):
        refine_on_free_runs(motor(10.0, 0.03, 0.3), [run], OutputErrorOptions(prior=other))
