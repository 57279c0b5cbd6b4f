"""A motor's data sheet against its actuator model, and what ActuatorPlant shows of a motor behind a spring."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.joint_effects import CONTACT_DAMPING, gear_of
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant, VoltageMotor
from drake_tc.actuation.recorded_run import Link
from drake_tc.actuation.wiring import add_actuators
from drake_tc.errors import ParamsError
from drake_tc.loops.joint_bench import make_plant

MOTOR = VoltageMotor(0.04, 0.05, 0.6, 1.2e-5, 100.0, 3.0, 1.5, 200.0, 24.0)


def test_the_model_says_what_the_circuit_and_the_rotor_say():
    """(v - ke N w) kt N/Rm - tau_co - tau_v w - Jm N^2 a, for some v, w, a: circuit, torque, rotor, one by one."""
    model = MOTOR.actuator_model("knee")
    values = {value.key: value.parameters for value in model.effects}
    for volts, speed, acceleration in ((5.0, 1.2, 3.0), (-8.0, -0.4, -20.0), (0.0, 2.0, 0.0)):
        current = (volts - 0.05 * 100.0 * speed) / 0.6
        rotor = 0.04 * current - 1.2e-5 * 100.0 * acceleration
        wanted = 100.0 * rotor - 1.5 * speed - 3.0 * np.sign(speed)
        found = volts / model.drive.gain - values["viscous"]["viscous"] * speed
        found -= values["rotor_inertia"]["rotor_inertia"] * acceleration + values["coulomb"]["coulomb"] * np.sign(speed)
        assert_allclose(found, wanted, rtol=1e-12)
    assert values["elasticity"]["compliance"] == 1.0 / 200.0
    assert values["saturation"]["limit"] == 24.0


def built(volts, held):
    """(simulator, plant, actuators) of the motor on a link that is heavy, or light."""
    builder = DiagramBuilder()
    plant = make_plant(Link(1e6 if held else 0.1), 1e-3)
    builder.AddNamedSystem("plant", plant)
    actuators = add_actuators(builder, plant, {"joint": MOTOR.actuator_model("joint")}, 1e-3)
    source = builder.AddSystem(ConstantVectorSource(np.array([volts])))
    builder.Connect(source.get_output_port(), actuators.GetInputPort("command"))
    return Simulator(builder.Build()), plant, actuators


def seen(simulator, actuators):
    own = actuators.GetMyContextFromRoot(simulator.get_context())
    return [actuators.GetOutputPort(name).Eval(own) for name in ("motor_state", "transmitted_torque")]


def test_a_held_joint_winds_its_spring_until_motor_and_spring_agree():
    """tau = v kt N/Rm - tau_co at rest, theta = tau/Ks."""
    simulator, _, actuators = built(2.0, held=True)
    simulator.AdvanceTo(2.0)
    motor, torque = seen(simulator, actuators)
    assert_allclose(torque, [2.0 * 4.0 / 0.6 - 3.0], rtol=2e-3)
    assert_allclose(motor[0], torque[0] / 200.0, rtol=1e-3)
    assert_allclose(motor[1], 0.0, atol=1e-4)


def test_a_free_joint_turns_as_fast_as_its_back_emf_lets_it():
    """v = ke N w + Rm/(kt N) (tau_co + tau_v w)."""
    simulator, plant, actuators = built(6.0, held=False)
    simulator.AdvanceTo(1.0)
    speed = (6.0 - 0.15 * 3.0) / (5.0 + 0.15 * 1.5)
    motor, torque = seen(simulator, actuators)
    assert_allclose(motor[1], speed, rtol=1e-3)
    assert_allclose(torque, [0.0], atol=0.05)
    assert_allclose(plant.GetVelocities(plant.GetMyContextFromRoot(simulator.get_context())), [speed], rtol=0.02)


def test_the_spring_damps_from_rest_on():
    """tau = Ks (theta - q) + D (theta' - q'), also where the spring is not wound: no kink at zero."""
    gear = gear_of(MOTOR.actuator_model("joint"), 0.1, 1e-3)
    reduced = MOTOR.inertia * 0.1 / (MOTOR.inertia + 0.1)
    damping = 2.0 * CONTACT_DAMPING * np.sqrt(200.0 * reduced)
    for twist in (0.0, 1e-12, -1e-12, 0.02):
        assert_allclose(gear.torque(twist, 0.3), 200.0 * twist + damping * 0.3, rtol=1e-6)


def test_play_passes_nothing_inside_its_gap_and_never_pulls():
    play = EffectValue("backlash", {"backlash": 0.02})
    model = MOTOR.actuator_model("joint")
    gear = gear_of(ActuatorModel("joint", model.drive, (*model.effects, play)), 0.1, 1e-3)
    assert gear.torque(0.009, 5.0) == 0.0
    assert gear.torque(0.0101, -50.0) == 0.0
    assert gear.torque(0.02, 0.0) > 0.0


def test_without_a_spring_the_motor_is_the_joint():
    system = ActuatorPlant([ActuatorModel("a", Drive("voltage", 0.1))], 1e-3, np.array([0.3]))
    context = system.CreateDefaultContext()
    system.GetInputPort("command").FixValue(context, [1.0])
    system.GetInputPort("state").FixValue(context, [0.4, -0.7])
    assert_allclose(system.GetOutputPort("motor_state").Eval(context), [0.4, -0.7])
    assert_allclose(system.GetOutputPort("transmitted_torque").Eval(context), [0.0])
    assert not system.HasDirectFeedthrough(
        system.GetInputPort("command").get_index(), system.GetOutputPort("motor_state").get_index()
    )


@pytest.mark.parametrize(
    ("field", "value"), [("torque_constant", 0.0), ("resistance", np.nan), ("coulomb", -1.0), ("voltage_limit", 0.0)]
)
def test_impossible_numbers_are_refused_by_name(field, value):
    with pytest.raises(ParamsError, match=f"^{field}"):
        VoltageMotor(**{**vars(MOTOR), field: value})


def test_factors_for_what_is_not_there_are_refused():
    assert MOTOR.scaled(resistance=2.0).resistance == 1.2
    with pytest.raises(ParamsError, match="motor: no field 'inductance'; fields: torque_constant"):
        MOTOR.scaled(inductance=1.1)
