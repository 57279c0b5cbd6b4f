"""Feedforward: the effort it asks for makes the simulated actuator deliver the expected torque."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.compensator import Motion, feedforward_effort
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from tests.joint_program import JointInput, JointProgram

FRICTION = (
    EffectValue("viscous", {"viscous": 3.0}),
    EffectValue("coulomb", {"coulomb": 2.0}),
    EffectValue("stribeck", {"stribeck": 1.0, "stribeck_velocity": 0.5, "stribeck_exponent": 2.0}),
    EffectValue("load_dependent_friction", {"load_friction": 0.1}),
    EffectValue("torque_ripple", {"ripple_cosine": 0.4, "ripple_sine": 0.1, "cycles_per_turn": 5.0}),
)
DRIVES = {
    "plain": (),
    "deadzone": (EffectValue("deadzone", {"deadzone": 0.03}),),
    "switch": (EffectValue("velocity_sign_switch", {"switch": 0.2}),),
}


@pytest.mark.parametrize("name", DRIVES)
@pytest.mark.parametrize("kind", ["position_servo", "current", "voltage"])
@pytest.mark.parametrize("velocity", [-1.3, 0.7])
def test_the_compensated_actuator_delivers_the_wanted_torque(name, kind, velocity):
    model = ActuatorModel("joint", Drive(kind, 0.02), (*FRICTION, *DRIVES[name]))
    q = 0.4
    for tau in (-6.0, 2.0, 9.0):
        motion = Motion(np.array([velocity]), position=np.array([q]))
        effort = float(feedforward_effort(model, np.array([tau]), motion)[0])
        command = q + effort if kind == "position_servo" else effort
        program = JointProgram(model, 1e-3, 0.0)  # no inertia given: friction at the velocity itself
        memory = program.initial(velocity)
        out = program.step(memory, JointInput(command, q, velocity, tau, 25.0), at_tick=True)
        assert_allclose(out.actuation, tau, rtol=1e-9, atol=1e-9)  # the same balance read backwards
        assert_allclose(out.effort, effort, rtol=1e-9)


def test_rotor_inertia_and_wind_up_are_led():
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": 0.3}), EffectValue("elasticity", {"compliance": 0.01}))
    model = ActuatorModel("joint", Drive("position_servo", 0.02), effects)
    tau = np.array([5.0, -1.0])
    motion = Motion(np.zeros(2), acceleration=np.array([2.0, 4.0]))
    assert_allclose(
        feedforward_effort(model, tau, motion), 0.02 * (tau + np.array([0.6, 1.2])) + 0.01 * tau, rtol=1e-12
    )
