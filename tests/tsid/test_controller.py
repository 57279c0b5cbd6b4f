"""`RobustTsid`: ports and prerequisites, one tick's kernel, what it holds, and that nothing gets it off its feet."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

import drake_tc.models
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import file_rotors, joint_limits, make_plant
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.rows import LimitRows, Parts
from drake_tc.tsid.tick import TickInput, solve_tick

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
OUTPUTS = ("torque", "acceleration", "contact_force", "status")
BOTH = (True, True)
ACCURACY = 1e-2
"""Of torques [N m]: a program ends where no more than 1e-6 of its weight w is to be gained, and R is flat there."""


@pytest.fixture(scope="module")
def law():
    return load_law(FILE)


@pytest.fixture(scope="module")
def system(law):
    return RobustTsid(law)


def state_of(law, rng=None, size=0.02):
    """At rest in the posture, or near it and moving with both soles still."""
    model = law.model
    q, v = model.start.copy(), np.zeros(model.nv)
    if rng is not None:
        q[model.positions] += size * rng.uniform(0.1, 1.0, model.n) * np.where(model.start[model.positions] < 0, 1, -1)
        v = size * rng.uniform(-1, 1, model.nv)
        jacobian = model.terms(model.create_scratch(), q, v).contact_jacobian
        v -= np.linalg.pinv(jacobian) @ (jacobian @ v)
    return np.concatenate([q, v])


def references_of(law):
    return [task.rest(law.starting_terms()) for task in law.tasks]


def at(system, state, time=0.0):
    context = system.CreateDefaultContext()
    context.SetTime(time)
    system.GetInputPort("estimated_state").FixValue(context, state)
    return context


def outputs(system, context):
    return {name: system.GetOutputPort(name).Eval(context).copy() for name in OUTPUTS}


def tick(system, context):
    """Evaluate, update, and move on by one period."""
    found = outputs(system, context)
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    context.SetTime(context.get_time() + system.law.period)
    return found


def test_ports_have_their_names_and_sizes(system, law):
    inputs = {system.get_input_port(i).get_name(): system.get_input_port(i).size() for i in range(5)}
    assert inputs == {
        "estimated_state": 73,
        "active_contacts": 2,
        "com_reference": 9,
        "posture_reference": 90,
        "force_reference": 12,
    }
    assert system.num_input_ports() == 5
    sizes = {system.get_output_port(i).get_name(): system.get_output_port(i).size() for i in range(4)}
    assert sizes == {"torque": 30, "acceleration": 36, "contact_force": 12, "status": len(Status)}
    assert all(system.HasDirectFeedthrough(i, o) for i in range(5) for o in range(4))


def test_output_is_the_kernel(system, law):
    state = state_of(law, np.random.default_rng(1))
    before = PreviousTick(np.zeros(30), None)
    wanted = solve_tick(law, law.model.create_scratch(), TickInput(state, references_of(law), BOTH), before)
    found = outputs(system, at(system, state))
    for name, value in zip(OUTPUTS, wanted[:4], strict=True):
        assert_array_equal(found[name], value)
    assert wanted.status[Status.OUTCOME] == 0.0
    assert wanted.status[Status.FALLBACK] == 0.0


def test_dynamics_hold_by_another_route(law):
    """M vdot + h - tau - contacts = 0 by Drake's inverse dynamics of its own plant, contacts as forces on the feet."""
    rng = np.random.default_rng(2)
    state = state_of(law, rng)
    model, plant = law.model, make_plant(law.model.robot, 0.0)
    for joint, inertia in file_rotors(law.model.robot).items():
        plant.GetJointActuatorByName(joint).set_default_rotor_inertia(inertia)
    context = plant.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, state)
    references = references_of(law)
    references[0] = references[0] + 0.01 * rng.uniform(-1, 1, 9)
    found = solve_tick(
        law, model.create_scratch(), TickInput(state, references, BOTH), PreviousTick(np.zeros(30), None)
    )
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    for contact, force in zip(model.contacts, found.force.reshape(2, 6), strict=True):
        frame = plant.GetFrameByName(contact.frame.link)
        body, place = frame.CalcPoseInWorld(context).rotation(), contact.frame.pose.transform
        turn = (body @ place.rotation()).matrix()
        wrench = SpatialForce(turn @ force[3:], turn @ force[:3])
        frame.body().AddInForce(context, body @ place.translation(), wrench, plant.world_frame(), forces)
    needed = plant.CalcInverseDynamics(context, found.acceleration, forces)
    assert_allclose(needed[:6], 0.0, atol=1e-8)
    assert_allclose(needed[model.actuated], found.torque, rtol=1e-9, atol=1e-8)


def test_the_torque_of_a_tick_sees_the_state_of_that_tick_and_is_held_until_the_next(system, law):
    one, two = state_of(law), state_of(law, np.random.default_rng(3))
    context = at(system, one)
    first = tick(system, context)
    context.SetTime(0.4e-3)
    system.GetInputPort("estimated_state").FixValue(context, two)
    for name, held in outputs(system, context).items():
        assert_array_equal(held, first[name])
    context.SetTime(1e-3)
    fresh = outputs(system, at(system, two))
    assert_allclose(outputs(system, context)["torque"], fresh["torque"], atol=ACCURACY)
    assert np.abs(fresh["torque"] - first["torque"]).max() > 0.1


@pytest.mark.parametrize("measure", ["classic", "individual", "box"])
def test_a_warm_start_changes_the_work_not_the_answer(measure):
    law = load_law(FILE, {"formulation": {"measure": measure}})
    system, rng = RobustTsid(law), np.random.default_rng(5)
    warm = at(system, state_of(law))
    for _ in range(5):
        state = state_of(law, rng, 0.01)
        system.GetInputPort("estimated_state").FixValue(warm, state)
        cold = outputs(system, at(system, state))["torque"]
        assert_allclose(tick(system, warm)["torque"], cold, atol=ACCURACY)


def test_outputs_follow_every_input_and_no_cache_is_stale(system, law):
    """A random walk over all inputs, against a fresh context each time."""
    rng = np.random.default_rng(6)
    values = {
        "estimated_state": lambda: state_of(law, rng),
        "com_reference": lambda: references_of(law)[0] + 0.02 * rng.uniform(-1, 1, 9),
        "posture_reference": lambda: references_of(law)[1] + 0.1 * rng.uniform(-1, 1, 90),
        "force_reference": lambda: 10.0 * rng.uniform(-1, 1, 12),
        "active_contacts": lambda: np.array([1.0, float(rng.uniform() > 0.5)]),
    }
    given = {name: draw() for name, draw in values.items()}
    context = system.CreateDefaultContext()
    for name, value in given.items():
        system.GetInputPort(name).FixValue(context, value)
    last = outputs(system, context)
    for name in (*values, *values):
        given[name] = 1.0 - given[name] if name == "active_contacts" else values[name]()
        if name == "active_contacts":
            given[name][0] = 1.0
        system.GetInputPort(name).FixValue(context, given[name])
        fresh = system.CreateDefaultContext()
        for other, value in given.items():
            system.GetInputPort(other).FixValue(fresh, value)
        now = outputs(system, context)
        for output, value in outputs(system, fresh).items():
            assert_array_equal(now[output], value, err_msg=f"{output} after {name}")
        assert np.abs(now["torque"] - last["torque"]).max() > 1e-6, name
        last = now


def test_a_diagram_runs_in_two_contexts_at_once(system, law):
    rng = np.random.default_rng(7)
    walks = [[state_of(law, rng) for _ in range(4)] for _ in range(2)]
    alone = []
    for walk in walks:
        context = at(system, walk[0])
        alone.append([])
        for state in walk:
            system.GetInputPort("estimated_state").FixValue(context, state)
            alone[-1].append(tick(system, context)["torque"])
    contexts = [at(system, walk[0]) for walk in walks]
    for step in range(4):
        for which, context in enumerate(contexts):
            system.GetInputPort("estimated_state").FixValue(context, walks[which][step])
            assert_array_equal(tick(system, context)["torque"], alone[which][step])


BAD_STATES = {
    "nan": lambda state: np.where(np.arange(state.size) == 20, np.nan, state),
    "infinite": lambda state: np.where(np.arange(state.size) == 40, np.inf, state),
    "all nan": lambda state: np.full_like(state, np.nan),
    "huge": lambda state: state * 1e200,
    "no attitude": lambda state: np.where(np.arange(state.size) < 4, 0.0, state),
    "fast": lambda state: np.where(np.arange(state.size) > 40, 1e5, state),
    "far beyond its stops": lambda state: np.where(
        (np.arange(state.size) > 7) & (np.arange(state.size) < 37), 9.0, state
    ),
}


@pytest.mark.parametrize("kind", BAD_STATES)
def test_no_state_raises_or_lets_a_nan_out(system, law, kind):
    context = at(system, state_of(law))
    good = tick(system, context)
    system.GetInputPort("estimated_state").FixValue(context, BAD_STATES[kind](state_of(law)))
    bad = tick(system, context)
    assert all(np.isfinite(value).all() for value in bad.values())
    assert bad["status"][Status.FALLBACK] == 1.0
    assert bad["status"][Status.OUTCOME] > 0.0
    limit = law.limits[0].rows(law.starting_terms()).upper
    assert (np.abs(bad["torque"]) <= limit + 1e-9).all()
    system.GetInputPort("estimated_state").FixValue(context, state_of(law))
    assert_allclose(tick(system, context)["torque"], good["torque"], atol=ACCURACY)


@pytest.mark.parametrize("measure", ["individual", "box"])
def test_torques_that_do_not_err_make_robust_tsid_classic(measure):
    found = {}
    for each in ("classic", measure):
        law = load_law(FILE, {"sigma": 0.0, "formulation": {"measure": each}})
        state = state_of(law, np.random.default_rng(9))
        found[each] = solve_tick(
            law,
            law.model.create_scratch(),
            TickInput(state, references_of(law), BOTH),
            PreviousTick(np.zeros(30), None),
        )
    assert_allclose(found[measure].torque, found["classic"].torque, atol=1e-3)
    assert found[measure].status[Status.P_IND] == 1.0
    assert found[measure].status[Status.ITERATIONS] <= found["classic"].status[Status.ITERATIONS] + 1


def test_stretched_legs_are_no_end(system, law):
    """Knees, hips and ankles straight: both feet's J loses rank as a pair, and the robot still stands by it."""
    state = state_of(law)
    state[law.model.positions[:12]] = 0.0
    found = outputs(system, at(system, state))
    assert all(np.isfinite(value).all() for value in found.values())
    assert found["status"][Status.OUTCOME] == 0.0
    assert_allclose(found["contact_force"][[2, 8]].sum(), 569.0, rtol=0.2)


@pytest.mark.parametrize("port", ["com_reference", "posture_reference", "force_reference"])
def test_a_lost_reference_is_no_answer_either(system, law, port):
    context = at(system, state_of(law))
    system.GetInputPort(port).FixValue(context, np.full(system.GetInputPort(port).size(), np.nan))
    found = outputs(system, context)
    assert all(np.isfinite(value).all() for value in found.values())
    assert found["status"][Status.FALLBACK] == 1.0


def test_without_any_contact_the_robot_falls_freely(system, law):
    context = at(system, state_of(law))
    system.GetInputPort("active_contacts").FixValue(context, np.zeros(2))
    found = outputs(system, context)
    assert found["status"][Status.OUTCOME] == 0.0
    assert_array_equal(found["contact_force"], np.zeros(12))
    terms = law.starting_terms()
    falling = terms.com_jacobian @ found["acceleration"] + terms.com_bias
    assert_allclose(falling, [0.0, 0.0, -9.81], atol=1e-9)


class Demand:
    """A limit of one joint's acceleration."""

    group = "acceleration"

    def __init__(self, name, model, joint, lower, upper):
        self.name = name
        matrix = np.zeros((1, model.nv))
        matrix[0, model.actuated[model.robot.joints.index(joint)]] = 1.0
        self._rows = LimitRows(name, self.group, Parts(vdot=matrix), np.array([lower]), np.array([upper]), (joint,))

    def rows(self, terms):
        return self._rows


def test_contradictory_limits_are_named_with_what_they_miss(law):
    model = law.model
    two = Demand("up", model, "l_elbow", 5.0, np.inf), Demand("down", model, "l_elbow", -np.inf, -3.0)
    system = RobustTsid(replace(law, limits=(*law.limits, *two)))
    found = outputs(system, at(system, state_of(law)))
    status = found["status"]
    assert status[Status.OUTCOME] == 1.0
    assert status[Status.FALLBACK] == 1.0
    assert system.constraints[int(status[Status.LIMIT])] in ("up: l_elbow", "down: l_elbow")
    assert_allclose(status[Status.MISSED], 4.0, rtol=1e-3)  # the gap of 8 rad/s^2, shared
    elbow = found["acceleration"][model.actuated[model.robot.joints.index("l_elbow")]]
    assert_allclose(elbow, 1.0, atol=5e-3)  # in the middle between 5 and -3


def test_the_status_says_that_limits_of_joints_gave_way(system, law):
    """Elbows beyond their stop or too fast for it; as little as a thousandth inside of it nothing has to give way."""
    model = law.model
    limits, joints = joint_limits(model.robot), [model.robot.joints.index(f"{side}_elbow") for side in "lr"]
    for inside, speed, counted in ((1e-3, 0.0, 0.0), (-0.05, 0.0, 2.0), (1e-3, 3.0, 2.0)):
        state = state_of(law)
        state[model.positions[joints]] = limits.upper[joints] - inside
        state[model.nq + model.actuated[joints]] = speed
        found = outputs(system, at(system, state))
        assert found["status"][Status.RELAXED] == counted
        assert found["status"][Status.FALLBACK] == 0.0
        elbows = found["acceleration"][model.actuated[joints]]
        assert (elbows <= (-99.0 if speed else 1e-6)).all()  # it brakes with all of 100 rad/s^2, or goes no further
    lost = outputs(system, at(system, np.full(73, np.nan)))
    assert lost["status"][Status.RELAXED] == 0.0


def test_a_fallback_tells_of_limits_that_gave_way_as_well(law):
    model = law.model
    two = Demand("up", model, "l_elbow", 5.0, np.inf), Demand("down", model, "l_elbow", -np.inf, -3.0)
    system = RobustTsid(replace(law, limits=(*law.limits, *two)))
    state = state_of(law)
    knee = model.robot.joints.index("r_knee")
    state[model.nq + model.actuated[knee]] = 50.0
    status = outputs(system, at(system, state))["status"]
    assert (status[Status.FALLBACK], status[Status.RELAXED]) == (1.0, 1.0)


def test_one_solve_a_tick_however_many_read_it_and_however_fine_the_plant(law):
    calls = []

    class Counted:
        def __init__(self, task):
            self._task = task
            self.name, self.weight, self.reference_size = task.name, task.weight, task.reference_size

        def rest(self, terms):
            return self._task.rest(terms)

        def rows(self, terms, reference):
            calls.append(terms)
            return self._task.rows(terms, reference)

    system = RobustTsid(replace(law, tasks=(Counted(law.tasks[0]), *law.tasks[1:])))
    calls.clear()  # building the law evaluates each task once
    builder = DiagramBuilder()
    builder.AddSystem(system)
    for name in OUTPUTS:
        LogVectorOutput(system.GetOutputPort(name), builder, 0.25e-3)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    own = system.GetMyContextFromRoot(simulator.get_mutable_context())
    system.GetInputPort("estimated_state").FixValue(own, state_of(law))
    simulator.AdvanceTo(0.0105)
    assert len(calls) == 11


def test_a_law_refuses_what_cannot_be(law):
    with pytest.raises(ParamsError, match="'com' comes twice"):
        replace(law, tasks=(*law.tasks, law.tasks[0]))
    with pytest.raises(ParamsError, match="period: expected a positive number"):
        replace(law, period=0.0)
    with pytest.raises(ParamsError, match="contact_damping: expected a finite number >= 0"):
        replace(law, contact_damping=-1.0)
    with pytest.raises(ParamsError, match="sigma: expected 30 joints"):
        replace(law, error=type(law.error)(np.ones(4)))
