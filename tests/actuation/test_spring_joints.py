"""Joints at once are their programs one by one, to the bit: sub-steps that differ, stops, lost inputs, first ticks."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.actuation.joint_program import JointInput, JointProgram
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.spring_joints import LEAST_JOINTS, spring_joints

TICK = 1e-3
N = 9
INERTIAS = np.linspace(0.005, 2.0, N)


def model(j, **changed):
    effects = {
        "rotor_inertia": {"rotor_inertia": 0.02 + 0.03 * j},
        "viscous": {"viscous": 4.0 * j},
        "coulomb": {"coulomb": 0.0 if j == 2 else 0.7 * j},
        "elasticity": {"compliance": [1e-5, 5e-3, 8e-3][j % 3]},
        "saturation": {"limit": 3.0 + j},
    } | changed
    kept = {key: value for key, value in effects.items() if value is not None}
    if j == 4:
        kept.pop("saturation", None)
    return ActuatorModel(f"joint_{j}", Drive("voltage", 0.1 + 0.02 * j), tuple(EffectValue(*x) for x in kept.items()))


MODELS = [model(j) for j in range(N)]


def test_every_output_and_memory_is_that_of_the_programs():
    """300 ticks of voltages beyond the limits and links that stop; commands and states lost now and then."""
    system = ActuatorPlant(MODELS, TICK, INERTIAS)
    programs = [JointProgram(m, TICK, inertia) for m, inertia in zip(MODELS, INERTIAS.tolist(), strict=True)]
    memories = [program.initial() for program in programs]
    assert len({program._gear.sub_steps for program in programs}) > 2
    context, rng = system.CreateDefaultContext(), np.random.default_rng(5)
    assert system._springs is not None
    slid = 0
    for tick in range(300):
        now = 0.3 + TICK * tick
        command = rng.normal(0.0, 6.0, N)
        q, v = 0.02 * np.sin(9.0 * now + np.arange(N)), 0.18 * np.cos(9.0 * now + np.arange(N))
        if tick % 50 == 31:
            command[3] = np.nan
        if tick % 50 == 41:
            v[5] = np.inf
        if tick % 90 > 60:
            v[:] = 0.0
        context.SetTime(tick * TICK)
        system.GetInputPort("command").FixValue(context, command)
        system.GetInputPort("state").FixValue(context, np.concatenate([q, v]))
        plain = [list(values) for values in zip(command.tolist(), q.tolist(), v.tolist(), strict=True)]
        motor = np.array([p.motor(m, x[1], x[2]) for p, m, x in zip(programs, memories, plain, strict=True)])
        assert_array_equal(system.GetOutputPort("motor_state").Eval(context), motor[:, :2].T.ravel())
        assert_array_equal(system.GetOutputPort("transmitted_torque").Eval(context), motor[:, 2])
        outputs = [
            program.step(memory, JointInput(*x, None, 25.0), at_tick=True)
            for program, memory, x in zip(programs, memories, plain, strict=True)
        ]
        expected = np.concatenate([np.ravel(outputs), np.ravel(memories), [tick * TICK]])
        assert_array_equal(system.GetOutputPort("step").Eval(context), expected)
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
        slid += int(np.sum(np.abs(np.array(memories)[:, 1]) == 1.0))
    assert 100 < slid < 300 * N - 100  # bristles that slide and bristles that hold


def test_between_ticks_the_load_stays():
    system = ActuatorPlant(MODELS, TICK, INERTIAS)
    programs = [JointProgram(m, TICK, inertia) for m, inertia in zip(MODELS, INERTIAS.tolist(), strict=True)]
    memories = [program.initial() for program in programs]
    context = system.CreateDefaultContext()
    for port, size in (("command", N), ("state", 2 * N)):
        system.GetInputPort(port).FixValue(context, np.linspace(-0.1, 0.2, size))
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    state = np.linspace(-0.1, 0.2, 2 * N).tolist()
    rows = list(zip(np.linspace(-0.1, 0.2, N).tolist(), state[:N], state[N:], strict=True))
    for program, memory, x in zip(programs, memories, rows, strict=True):
        program.step(memory, JointInput(*x, None, 25.0), at_tick=True)
    context.SetTime(0.4 * TICK)
    outputs = [
        program.step(memory, JointInput(*x, None, 25.0), at_tick=False)
        for program, memory, x in zip(programs, memories, rows, strict=True)
    ]
    step = system.GetOutputPort("step").Eval(context)
    assert_array_equal(step[:-1], np.concatenate([np.ravel(outputs), np.ravel(memories)]))


@pytest.mark.parametrize(
    "strange",
    [
        {"backlash": {"backlash": 0.01}},
        {"stribeck": {"stribeck": 1.0, "stribeck_velocity": 0.1}},
        {"elasticity": None},
        {"deadzone": {"deadzone": 0.1}},
    ],
)
def test_one_joint_of_another_kind_leaves_all_to_their_programs(strange):
    assert spring_joints(MODELS, INERTIAS.tolist(), TICK) is not None
    assert spring_joints([*MODELS[:-1], model(N - 1, **strange)], INERTIAS.tolist(), TICK) is None
    few = LEAST_JOINTS - 1
    assert spring_joints(MODELS[:few], INERTIAS[:few].tolist(), TICK) is None
