"""JointProgram: the recorded numbers of every effect, the system beside it, and what its memory may hold."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.joint_step import JointOutput
from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.effects.base import SensorEffect
from drake_tc.effects.library import LIBRARY, UNCOMMON, effect
from tests.joint_program import JointInput, JointProgram

TICK = 1e-3
INPUTS = ("command", "position", "velocity", "load_torque", "temperature", "supply_voltage")
RECORD = np.load(Path(__file__).with_name("recorded_torques.npz"))
CASES = json.loads(str(RECORD["cases"]))


def model_of(case) -> ActuatorModel:
    values = tuple(EffectValue(key, parameters) for key, parameters in case["effects"])
    return ActuatorModel("joint", Drive(case["kind"], case["gain"]), values)


def name(case) -> str:
    keys = [key for key, _ in case["effects"] if key not in ("viscous", "coulomb", "rotor_inertia")]
    return "+".join(keys) or "friction"


@pytest.mark.parametrize("index", range(len(CASES)), ids=[f"{i}-{name(case)}" for i, case in enumerate(CASES)])
def test_torques_are_those_of_the_record(index):
    """32 ticks with reversals, lost commands and states, and evaluations between ticks."""
    case = CASES[index]
    program = JointProgram(model_of(case), TICK, case["inertia"])
    memory = program.initial(float(index % 2))
    rows = []
    for k in range(RECORD["command"].size):
        command, q, v, load, celsius, supply = (float(RECORD[signal][k]) for signal in INPUTS)
        now = JointInput(command, q, v, load if case["load"] else None, celsius, supply)
        rows.append(program.step(memory, now, at_tick=bool(RECORD["at_tick"][k])))
    expected = RECORD["outputs"][index]
    # the same operations in another order: rounding, of differences of large terms
    assert_allclose(rows, expected, rtol=1e-11, atol=1e-12 * (1.0 + np.max(np.abs(expected))))


def test_the_record_has_every_effect_that_acts():
    keys = {effect(key).key for case in CASES for key, _ in case["effects"]}
    # simulated in tests/effects/test_identify_back.py
    elsewhere = {"effort_bias", "payload.pendulum", "payload.own_arm", "position_dependent_friction.linear"}
    elsewhere |= {"payload.sliding", "presliding_hysteresis.sliding", "cable_spring.beside_weight", "gain_ripple"}
    assert {e.key for e in (*LIBRARY, *UNCOMMON) if not isinstance(e, SensorEffect)} <= keys | elsewhere
    torques = RECORD["outputs"][..., 0]
    assert np.all(np.ptp(torques, axis=1) > 0.05)  # no case that rests
    assert np.isfinite(RECORD["outputs"]).all()


def test_the_plant_is_its_programs_side_by_side():
    """Joints of different memory in one state vector, three ticks: each port is its joint's program."""
    chosen = CASES[8:24]
    models = [model_of(case) for case in chosen]
    inertias = np.array([case["inertia"] for case in chosen])
    system = ActuatorPlant(models, TICK, inertias)
    programs = [JointProgram(model, TICK, inertia) for model, inertia in zip(models, inertias.tolist(), strict=True)]
    assert len({program.size for program in programs}) > 2
    memories = [program.initial(0.5) for program in programs]
    context = system.CreateDefaultContext()
    system.set_initial_velocity(context, np.full(len(models), 0.5))
    rng = np.random.default_rng(3)
    for tick in range(3):
        u = {port: rng.normal(0, 0.1, len(models)) for port in INPUTS}
        context.SetTime(tick * TICK)
        system.GetInputPort("state").FixValue(context, np.concatenate([u["position"], u["velocity"]]))
        for port in ("command", "load_torque", "temperature", "supply_voltage"):
            system.GetInputPort(port).FixValue(context, u[port])
        rows = [
            program.step(memory, JointInput(*(float(u[port][j]) for port in INPUTS)), at_tick=True)
            for j, (program, memory) in enumerate(zip(programs, memories, strict=True))
        ]
        for column, port in enumerate(JointOutput._fields):
            assert_allclose(system.GetOutputPort(port).Eval(context), [row[column] for row in rows], atol=0)
        context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
        state = context.get_discrete_state_vector().value()
        assert_allclose(state, [*np.concatenate(memories), tick * TICK], atol=0)
