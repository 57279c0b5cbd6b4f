"""ActuatorPlant: declared dependence, contexts, and physics in front of a MultibodyPlant."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.recorded_run import Link
from drake_tc.actuation.wiring import (
    actuated_joints,
    add_actuators,
    add_joint_actuators,
    apply_rotor_inertia,
    joint_inertias,
)
from drake_tc.errors import ParamsError
from drake_tc.kernels.equations import PRESLIDING_DISPLACEMENT
from drake_tc.loops.joint_bench import make_plant

RICH = (
    EffectValue("rotor_inertia", {"rotor_inertia": 0.2}),
    EffectValue("coulomb", {"coulomb": 2.0}),
    EffectValue("viscous", {"viscous": 1.0}),
    EffectValue("load_dependent_friction", {"load_friction": 0.1}),
    EffectValue("thermal_friction", {"coulomb_per_kelvin": 0.02, "viscous_per_kelvin": 0.01, "thermal_rate": 0.01}),
    EffectValue("supply_sag", {"supply_sensitivity": 1.0, "nominal_voltage": 24.0}),
    EffectValue("delay.command", {"delay": 0.002}),
)
INPUTS = ("command", "state", "temperature", "load_torque", "supply_voltage")


def rich(kind="position_servo"):
    return ActuatorPlant([ActuatorModel(n, Drive(kind, 0.01), RICH) for n in "ab"], 1e-3, np.array([0.3, 0.3]))


def fixed(system, **values):
    context = system.CreateDefaultContext()
    start = {
        "command": [0.1, 0.2],
        "state": [0.0, 0.0, 1.0, -1.0],
        "temperature": [30.0, 30.0],
        "load_torque": [5.0, 5.0],
        "supply_voltage": [22.0, 22.0],
    }
    for name in INPUTS:
        system.GetInputPort(name).FixValue(context, np.array(values.get(name, start[name])))
    system.set_initial_velocity(context, np.array([1.0, -1.0]))
    return context


@pytest.mark.parametrize("poked", INPUTS)
def test_poking_an_input_moves_the_torque_and_only_what_depends_on_it(poked):
    system = rich("current")
    context = fixed(system)
    before = {n: system.GetOutputPort(n).Eval(context).copy() for n in ("actuation", "effort", "fault")}
    port = system.GetInputPort(poked)
    port.FixValue(context, port.Eval(context) + 0.7)
    after = {n: system.GetOutputPort(n).Eval(context) for n in before}
    if poked == "command":
        assert np.all(after["effort"] != before["effort"])
    else:
        assert np.all(after["actuation"] != before["actuation"])
        assert_allclose(after["effort"], before["effort"], atol=0)
    assert_allclose(after["fault"], 0.0, atol=0)


def test_poking_the_state_moves_the_torque():
    system = rich()
    still = {"command": [0.0, 0.0], "load_torque": [0.0, 0.0]}  # else the bristle turns over in one step
    context = fixed(system, state=[0.0, 0.0, 0.01, -0.01], **still)
    before = system.GetOutputPort("friction_torque").Eval(context).copy()
    system.set_initial_velocity(context, np.array([-1.0, 1.0]))
    assert np.all(system.GetOutputPort("friction_torque").Eval(context) != before)


def test_every_output_depends_on_every_input():
    system = rich()
    of_state = {"motor_state", "transmitted_torque"}
    for port in range(system.num_output_ports()):
        for source in range(system.num_input_ports()):
            named = system.get_output_port(port).get_name() in of_state
            state = system.get_input_port(source).get_name() == "state"
            assert system.HasDirectFeedthrough(source, port) == (state or not named)


def test_two_contexts_do_not_share_anything():
    system = rich()
    alone = fixed(system)
    simulator = Simulator(system, alone)
    simulator.AdvanceTo(0.02)
    reference = system.GetOutputPort("actuation").Eval(alone).copy()
    one = fixed(system)
    two = fixed(system, command=[-4.0, 3.0])
    pair = Simulator(system, one), Simulator(system, two)
    for end in np.arange(1, 21) * 1e-3:
        for each in pair:
            each.AdvanceTo(end)
    assert_allclose(system.GetOutputPort("actuation").Eval(one), reference, atol=0)
    assert np.any(system.GetOutputPort("actuation").Eval(two) != reference)


def test_a_command_that_is_not_finite_is_held_and_flagged():
    system = ActuatorPlant([ActuatorModel("a", Drive("current", 0.5))], 1e-3)
    context = system.CreateDefaultContext()
    system.GetInputPort("command").FixValue(context, np.array([3.0]))
    system.GetInputPort("state").FixValue(context, np.zeros(2))
    Simulator(system, context).AdvanceTo(0.005)
    system.GetInputPort("command").FixValue(context, np.array([np.nan]))
    assert_allclose(system.GetOutputPort("actuation").Eval(context), [6.0], atol=0)
    assert_allclose(system.GetOutputPort("fault").Eval(context), [1.0], atol=0)


def run(model, link, command, *, until, step=1e-3, start=(0.0, 0.0)):
    """(q, v, actuators' z) at the end of a run under a constant command."""
    builder = DiagramBuilder()
    plant = make_plant(link, step)
    builder.AddNamedSystem("plant", plant)
    actuators = add_actuators(builder, plant, {"joint": model}, step)
    source = builder.AddSystem(ConstantVectorSource([command]))
    builder.Connect(source.get_output_port(), actuators.GetInputPort("command"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(context, np.array(start))
    actuators.set_initial_velocity(actuators.GetMyMutableContextFromRoot(simulator.get_mutable_context()), start[1:])
    out = []
    for end in np.linspace(0, until, 9)[1:]:
        simulator.AdvanceTo(end)
        out.append(plant.GetPositionsAndVelocities(context).copy())
    return np.array(out)


def test_drakes_rotor_inertia_gives_the_expected_acceleration():
    model = ActuatorModel("joint", Drive("current", 0.5), (EffectValue("rotor_inertia", {"rotor_inertia": 0.35}),))
    end = run(model, Link(0.05), 1.2, until=0.5)[-1]
    assert_allclose(end[1], 2.4 / 0.4 * 0.5, rtol=1e-9)  # constant torque: v = tau t / (J + M)


@pytest.mark.parametrize(("inertia", "level"), [(0.35, 30.0), (0.005, 0.03)])
def test_stiction_holds_a_load_below_its_level(inertia, level):
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": inertia}), EffectValue("coulomb", {"coulomb": level}))
    model = ActuatorModel("joint", Drive("current", 1.0), effects)
    states = run(model, Link(0.2 * inertia), 0.9 * level, until=4.0)
    assert np.max(np.abs(states[:, 0])) < 1.01 * PRESLIDING_DISPLACEMENT
    assert np.ptp(states[4:, 0]) < 1e-3 * PRESLIDING_DISPLACEMENT  # no drift in the second half
    slipping = run(model, Link(0.2 * inertia), 1.1 * level, until=1.0)[-1]
    assert_allclose(slipping[1], 0.1 * level / (1.2 * inertia), rtol=0.02)  # slides as rigid friction would


def test_stiction_holds_a_pendulum_against_gravity():
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": 0.01}), EffectValue("coulomb", {"coulomb": 1.0}))
    model = ActuatorModel("joint", Drive("current", 1.0), effects)
    states = run(model, Link(0.08, 9.0), 0.0, until=4.0, start=(0.1, 0.0))  # gravity 0.9 N m of 1.0
    assert np.max(np.abs(states[:, 0] - 0.1)) < 3 * PRESLIDING_DISPLACEMENT
    assert np.ptp(states[4:, 0]) < 1e-2 * PRESLIDING_DISPLACEMENT


def test_a_stiff_servo_is_stable_at_one_millisecond():
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": 0.35}), EffectValue("viscous", {"viscous": 31.0}),
               EffectValue("coulomb", {"coulomb": 9.0}))  # fmt: skip
    model = ActuatorModel("joint", Drive("position_servo", 1 / 6500), effects)
    states = run(model, Link(0.01), 0.3, until=2.0)
    assert_allclose(states[-1], [0.3, 0.0], atol=9.0 / 6500 + 1e-9)  # within the friction band, and at rest
    assert abs(states[-1, 1]) < 1e-9


@pytest.mark.parametrize("extra", ["backlash", "elasticity"])
@pytest.mark.parametrize("scale", [0.005, 0.3])
def test_a_gear_with_two_inertias_rests_where_statics_says(extra, scale):
    value = {"backlash": EffectValue("backlash", {"backlash": 0.05}),
             "elasticity": EffectValue("elasticity", {"compliance": 0.02})}[extra]  # fmt: skip
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": scale}), EffectValue("viscous", {"viscous": 30 * scale}))
    model = ActuatorModel("joint", Drive("position_servo", 1 / (2000 * scale)), (*effects, value))
    link = Link(scale, 20 * scale)
    q = run(model, link, 0.8, until=15.0)[-1, 0]
    load = 20 * scale * np.sin(q)  # the gear passes what gravity asks
    motor = 0.8 - load / (2000 * scale)  # servo holds the motor
    twist = motor - q
    expected = 0.02 * load if extra == "elasticity" else 0.025
    assert_allclose(twist, expected, atol=2e-3)  # contact compliance and residual swing of the undamped link


def test_halving_the_step_halves_the_error():
    effects = (EffectValue("rotor_inertia", {"rotor_inertia": 0.1}), EffectValue("viscous", {"viscous": 0.6}),
               EffectValue("coulomb", {"coulomb": 0.8}),
               EffectValue("presliding_hysteresis", {"presliding": 0.5, "presliding_travel": 0.02}))  # fmt: skip
    model = ActuatorModel("joint", Drive("position_servo", 0.05), effects)
    steps = (2e-3, 1e-3, 5e-4)
    ends = [run(model, Link(0.05), 0.5, until=0.16, step=step)[:, 0] for step in (*steps, 2e-5)]
    errors = [np.max(np.abs(end - ends[-1])) for end in ends[:-1]]
    assert errors[1] < 0.65 * errors[0]  # first order
    assert errors[2] < 0.65 * errors[1]


def test_inertias_are_those_of_the_plant():
    assert_allclose(joint_inertias(make_plant(Link(0.07, 3.0), 1e-3)), [0.07], rtol=1e-12)


def test_refusals():
    with pytest.raises(ParamsError, match="rotor_inertia > 0"):
        ActuatorPlant([ActuatorModel("j", Drive("current", 1.0), (EffectValue("backlash", {"backlash": 0.1}),))], 1e-3)
    with pytest.raises(ParamsError, match="positive period"):
        ActuatorPlant([ActuatorModel("j", Drive("current", 1.0))], 0.0)
    with pytest.raises(ParamsError, match="no actuator model for joint 'joint'"):
        add_actuators(
            DiagramBuilder(), make_plant(Link(0.1), 1e-3), {"knee": ActuatorModel("k", Drive("current", 1.0))}
        )


def two_link_arm(builder):
    """Joints `far` (declared first) and `near`, actuators in the other order."""
    plant = MultibodyPlant(1e-3)
    inertia = SpatialInertia(1.0, np.array([0.0, 0.0, -0.2]), UnitInertia(0.06, 0.06, 0.03))
    upper, lower = plant.AddRigidBody("upper", inertia), plant.AddRigidBody("lower", inertia)
    axis = np.array([0.0, 1.0, 0.0])
    hang = RigidTransform(np.array([0.0, 0.0, -0.4]))
    near = plant.AddJoint(RevoluteJoint("near", plant.world_frame(), upper.body_frame(), axis))
    elbow = plant.AddFrame(FixedOffsetFrame("elbow", upper.body_frame(), hang))
    far = plant.AddJoint(RevoluteJoint("far", elbow, lower.body_frame(), axis))
    plant.AddJointActuator("far", far)
    plant.AddJointActuator("near", near)
    plant.Finalize()
    builder.AddNamedSystem("plant", plant)
    return plant


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.3])
def test_an_arm_is_wired_in_actuator_order_and_holds_with_poorly_known_inertias(factor):
    models = {}
    for name, level in (("near", 8.0), ("far", 3.0)):
        friction = (EffectValue("rotor_inertia", {"rotor_inertia": 0.02}), EffectValue("coulomb", {"coulomb": level}))
        models[name] = ActuatorModel(name, Drive("position_servo", 1e-2), friction)
    builder = DiagramBuilder()
    plant = two_link_arm(builder)
    assert actuated_joints(plant) == ["far", "near"]
    apply_rotor_inertia(plant, models)
    actuators = add_actuators(builder, plant, models, 1e-3, factor * joint_inertias(plant))
    source = builder.AddSystem(ConstantVectorSource([0.4, -0.3]))  # far, near
    builder.Connect(source.get_output_port(), actuators.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_context())
    simulator.AdvanceTo(3.0)
    first = plant.GetPositions(context).copy()
    simulator.AdvanceTo(4.0)
    near, far = plant.GetPositions(context)
    assert abs(far - 0.4) < 1e-2 * (3.0 + 2.0)  # friction and at most m g l of the link, over the servo's stiffness
    assert abs(near + 0.3) < 1e-2 * (8.0 + 9.0)
    assert_allclose([near, far], first, atol=PRESLIDING_DISPLACEMENT)


def test_the_port_step_holds_all_outputs_and_the_next_memory():
    system = rich()
    context = fixed(system)
    names = ("actuation", "motor_torque", "friction_torque", "effort", "fault")
    outputs = np.array([system.GetOutputPort(name).Eval(context) for name in names])
    step = np.array(system.GetOutputPort("step").Eval(context))
    assert_allclose(step[: outputs.size].reshape(-1, len(names)).T, outputs, atol=0)
    assert_allclose(step[system.actuation_places], outputs[0], atol=0)
    after = system.EvalUniquePeriodicDiscreteUpdate(context)
    assert_allclose(after.value(), step[outputs.size :], atol=0)


PENDULUM = """
<robot name="pendulum">
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.4"/><mass value="2.0"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="20" velocity="5"/></joint>
</robot>
"""


def parsed_pendulum():
    """As a plain Parser reads a URDF without transmissions."""
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModelsFromString(PENDULUM, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    return plant


def test_a_plant_without_actuators_is_refused_with_what_to_do():
    builder = DiagramBuilder()
    plant = builder.AddSystem(parsed_pendulum())
    models = {"hinge": ActuatorModel("hinge", Drive("current", 0.01), RICH)}
    with pytest.raises(ParamsError, match=r"call plant\.Finalize\(\) first"):
        add_actuators(builder, plant, models)
    plant.Finalize()
    with pytest.raises(ParamsError, match=r"no joint actuators, .*<transmission>.*add_joint_actuators\(plant, m"):
        add_actuators(builder, plant, models)
    with pytest.raises(ParamsError, match="finalized already; call this before"):
        add_joint_actuators(plant, models)


@pytest.mark.parametrize("listed", [True, False])
def test_joint_actuators_make_such_a_plant_one_that_can_be_driven(listed):
    model = ActuatorModel("hinge", Drive("current", 0.01), RICH[:1])
    models = [model] if listed else {"hinge": model}
    builder = DiagramBuilder()
    plant = builder.AddSystem(parsed_pendulum())
    add_joint_actuators(plant, models, effort_limit=20.0)
    add_joint_actuators(plant, models)  # those that are there are kept
    plant.Finalize()
    assert plant.GetJointActuatorByName("hinge").effort_limit() == 20.0
    actuators = add_actuators(builder, plant, models)
    current = builder.AddSystem(ConstantVectorSource([0.02]))
    builder.Connect(current.get_output_port(), actuators.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2e-3)
    speed = plant.GetVelocities(plant.GetMyContextFromRoot(simulator.get_context()))
    torque, inertia = 0.02 / 0.01, 0.2 + 0.01 + 2.0 * 0.4**2
    assert_allclose(speed, 2e-3 * torque / inertia, rtol=1e-3)  # gravity's moment is still next to nothing


def test_joint_actuators_of_joints_that_are_not_there():
    model = ActuatorModel("knee", Drive("current", 0.01))
    with pytest.raises(ParamsError, match="the plant has no joint 'knee'; joints: "):
        add_joint_actuators(parsed_pendulum(), [model])


def test_two_models_of_one_joint_are_refused():
    model = ActuatorModel("hinge", Drive("current", 0.01))
    with pytest.raises(ParamsError, match="expected one model per joint, got joints hinge, hinge"):
        add_joint_actuators(parsed_pendulum(), [model, model])
