"""The fast free run against an adaptive integrator, and against the Drake diagram."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from drake_tc.actuation.free_run import simulate
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.recorded_run import Link, PositionLoop, Recording, in_plant
from drake_tc.errors import ParamsError
from drake_tc.loops.joint_bench import free_run

PERIOD = 4e-3
TIME = np.arange(500) * PERIOD
COMMAND = 0.8 * np.sin(3.0 * TIME)


def servo(**effects: dict[str, float]) -> ActuatorModel:
    known = {"rotor_inertia": {"rotor_inertia": 0.01}, "viscous": {"viscous": 0.05}} | effects
    return ActuatorModel("j", Drive("position_servo", 0.2), tuple(EffectValue(k, v) for k, v in known.items()))


def test_it_agrees_with_an_adaptive_integrator_where_there_is_no_dry_friction():
    link = Link(0.005, 0.48, 0.1)
    run = Recording(TIME, COMMAND, 0.2, 0.0, (-1.0, 1.0), pendulum=link)

    def slope(time: float, x: np.ndarray) -> list[float]:
        held = COMMAND[min(int(time / PERIOD + 1e-9), COMMAND.size - 1)]
        torque = (held - x[0]) / 0.2 - 0.05 * x[1] - 0.48 * np.sin(x[0] - 0.1)
        return [x[1], torque / 0.015]

    reference = solve_ivp(slope, (0.0, TIME[-1]), [0.2, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-11, max_step=PERIOD).y[0]
    # first order in the step of 0.1 ms; the loop's damping ratio is 0.09, so phase errors last
    assert_allclose(simulate(servo(), run, 1e-4), reference, atol=3e-3)


@pytest.mark.parametrize(
    "effects",
    [
        {"coulomb": {"coulomb": 0.3}},
        {"coulomb": {"coulomb": 0.2}, "load_dependent_friction": {"load_friction": 0.2}, "delay": {"delay": 0.006}},
        {"torque_sensor_bias": {"bias": 0.1}, "encoder_offset": {"offset": 0.02}},
    ],
)
@pytest.mark.parametrize("load", ["pendulum", "torque"])
def test_it_is_the_drake_diagram(effects: dict[str, dict[str, float]], load: str):
    run = Recording(TIME, COMMAND, 0.0, 0.0, (-1.0, 1.0), pendulum=Link(0.005, 0.48))
    if load == "torque":
        run = replace(run, pendulum=None, load_torque=0.4 * np.sin(2.0 * TIME))
    model = servo(**effects)
    drake = free_run(model, run, substeps=4)
    # both step by symplectic Euler at 1 ms; the diagram reads its tables a quarter of a step early
    assert_allclose(simulate(model, run, 1e-3), drake, atol=2e-3)


def test_a_drive_in_its_position_loop_is_the_servo_that_the_loop_makes_of_it():
    link = Link(0.005, 0.48)
    loop = PositionLoop(4.0, 100.0)
    run = Recording(TIME, COMMAND, 0.0, 0.0, (-1.0, 1.0), pendulum=link, loop=loop)
    voltage = replace(servo(coulomb={"coulomb": 0.1}), drive=Drive("voltage", 0.8))
    placed = in_plant(voltage, run)
    assert placed is not None
    alone = simulate(servo(coulomb={"coulomb": 0.1}), replace(run, loop=None), 1e-3)
    assert_allclose(simulate(*placed, 1e-3), alone, rtol=0.0, atol=1e-12)  # the same arithmetic up to rounding


def test_a_rotor_without_inertia_cannot_run():
    model = ActuatorModel("j", Drive("current", 0.1), (EffectValue("viscous", {"viscous": 0.1}),))
    run = Recording(TIME, COMMAND, 0.0, 0.0, (-1.0, 1.0), load_torque=np.zeros(TIME.size))
    with pytest.raises(ParamsError, match="no inertia"):
        simulate(model, run, 1e-3)


def test_an_unknown_pendulum_without_inertia_has_no_plant():
    """A fit may rest on an inertia of 0, where the drive is limited for instance."""
    pendulum = {"moment": 0.4, "zero": 0.1, "constant": 0.0, "inertia": 0.0}
    run = Recording(TIME, COMMAND, 0.0, 0.0, (-1.0, 1.0))
    load = EffectValue("unknown_load.pendulum", pendulum)
    assert in_plant(ActuatorModel("j", Drive("current", 0.1), (load,)), run) is None
    rotor = EffectValue("rotor_inertia", {"rotor_inertia": 0.01})
    assert in_plant(ActuatorModel("j", Drive("current", 0.1), (load, rotor)), run) is not None


@pytest.mark.parametrize("scale", [1e-5, 1e-7])
def test_the_motor_of_a_finger_moves_as_one_with_larger_torques(scale):
    """With all torques and inertias in proportion the motion stays the same."""

    def run(by: float) -> np.ndarray:
        known = {"rotor_inertia": {"rotor_inertia": 0.01 * by}, "viscous": {"viscous": 0.05 * by}}
        effects = tuple(EffectValue(k, v) for k, v in known.items())
        model = ActuatorModel("j", Drive("current", 0.2 / by), effects)
        load = 0.1 * by * np.sin(2.0 * TIME)
        return free_run(model, Recording(TIME, COMMAND, 0.0, 0.0, (-100.0, 100.0), load_torque=load), substeps=4)

    assert_allclose(run(scale), run(1.0), rtol=0.0, atol=1e-6 * np.ptp(run(1.0)))
