"""A law with tasks and limits of one's own: what is checked when it is built, and what happens when one fails later."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import drake_tc.models
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
from drake_tc.tsid.law import Status
from drake_tc.tsid.priorities import Priorities
from drake_tc.tsid.rows import LimitRows, Parts, TaskRows
from drake_tc.tsid.tasks import ComTask

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"


class Still:
    """All accelerations are zero; every piece can be replaced by one that is wrong."""

    reference_size = 0

    def __init__(self, name="still", **wrong):
        self.name, self.wrong = name, wrong
        self.weight = np.ones(36)
        self.ticks = 0

    def rest(self, terms):
        return self.wrong.get("rest", np.zeros(0))

    def rows(self, terms, reference):
        given = {"vdot": np.eye(36), "target": np.zeros(36), "weight": self.weight, **self.wrong}
        return TaskRows(self.name, Parts(vdot=given["vdot"]), given["target"], given["weight"])


class FailsInMotion(Still):
    def rows(self, terms, reference):
        if np.abs(terms.v).max() > 0.0:
            raise KeyError("no knee")
        return super().rows(terms, reference)


class Weak:
    name, group = "weak", "torque"

    def __init__(self, **wrong):
        self.wrong = wrong

    def rows(self, terms):
        given = {"torque": np.eye(30), "lower": np.full(30, -50.0), "upper": np.full(30, 50.0), **self.wrong}
        labels = tuple(f"joint {i}" for i in range(30))
        return LimitRows(self.name, self.group, Parts(torque=given["torque"]), given["lower"], given["upper"], labels)


@pytest.fixture(scope="module")
def law():
    return load_law(FILE)


@pytest.fixture(scope="module")
def failing(law):
    return law.with_tasks(FailsInMotion())


WRONG_TASKS = [
    ({"vdot": np.eye(35)}, r"task 'still': matrix.vdot: expected an array of shape \(36, 36\), got shape \(35, 35\)"),
    ({"target": np.zeros(35)}, r"task 'still': weight: expected an array of shape \(35,\)"),
    ({"target": np.zeros((36, 1))}, "task 'still': target must be an array of one dimension"),
    ({"target": np.full(36, np.nan)}, "task 'still': target is not finite"),
    ({"vdot": np.full((36, 36), np.inf)}, "task 'still': matrix.vdot is not finite"),
    ({"weight": 1.0}, r"task 'still': weight: expected an array of shape \(36,\), got shape \(\)"),
    ({"rest": np.zeros(3)}, r"task 'still': rest: expected an array of shape \(0,\), got shape \(3,\)"),
    ({"rest": None}, "task 'still': rest: expected an array"),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG_TASKS)
def test_a_task_of_a_wrong_shape_is_an_error_with_its_name_when_the_law_is_built(law, wrong, message):
    with pytest.raises(ParamsError, match=message):
        law.with_tasks(Still(**wrong))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"torque": np.eye(29)}, r"limit 'weak': matrix.torque: expected an array of shape \(30, 30\)"),
        ({"upper": np.zeros(3)}, r"limit 'weak': upper: expected an array of shape \(30,\)"),
        ({"lower": np.full(30, np.nan)}, "limit 'weak': lower or upper is NaN"),
    ],
)
def test_so_is_a_limit(law, wrong, message):
    with pytest.raises(ParamsError, match=message):
        law.with_limits(Weak(**wrong))


def test_an_exception_in_rows_names_the_task_and_keeps_its_cause(law):
    task = Still()
    task.rows = lambda terms, reference: reference["com"]
    with pytest.raises(ParamsError, match="task 'still': rows failed at the robot's starting posture: IndexError") as e:
        law.with_tasks(task)
    assert isinstance(e.value.__cause__, IndexError)


def test_rows_of_another_type_are_refused(law):
    task = Still()
    task.rows = lambda terms, reference: np.zeros(36)
    with pytest.raises(ParamsError, match="task 'still': rows must return TaskRows, got ndarray"):
        law.with_tasks(task)


def test_with_tasks_adds_and_replaces_by_name(law):
    stiff = ComTask(1000.0, 60.0)
    other = law.with_tasks(Still(), stiff)
    assert [task.name for task in other.tasks] == [*(task.name for task in law.tasks), "still"]
    assert other.tasks[[t.name for t in law.tasks].index("com")] is stiff
    assert "still" not in [task.name for task in law.tasks]


def test_an_added_task_pulls_the_solution_towards_itself(law):
    system, heavy = RobustTsid(law), RobustTsid(law.with_tasks(Still()))
    found = []
    for each in (system, heavy):
        context = each.CreateDefaultContext()
        state = np.concatenate((law.model.start, np.zeros(36)))
        each.GetInputPort("estimated_state").FixValue(context, state)
        goal = law.tasks[0].rest(law.starting_terms()) + np.array([0.02, *np.zeros(8)])
        each.GetInputPort("com_reference").FixValue(context, goal)
        found.append(np.linalg.norm(each.GetOutputPort("acceleration").Eval(context)))
    assert found[1] < 0.9 * found[0]


def test_with_limits_adds_rows_that_the_torque_keeps(law):
    other = law.with_limits(Weak(lower=np.full(30, -29.5), upper=np.full(30, 29.5)))
    assert "weak: joint 3" in other.constraints
    system = RobustTsid(other)
    context = system.CreateDefaultContext()
    system.GetInputPort("estimated_state").FixValue(context, np.concatenate((law.model.start, np.zeros(36))))
    unlimited = RobustTsid(law)
    free = unlimited.CreateDefaultContext()
    unlimited.GetInputPort("estimated_state").FixValue(free, np.concatenate((law.model.start, np.zeros(36))))
    assert np.abs(unlimited.GetOutputPort("torque").Eval(free)).max() > 29.7
    assert np.abs(system.GetOutputPort("torque").Eval(context)).max() <= 29.5 + 1e-6
    replaced = other.with_limits(Weak())
    assert len(replaced.limits) == len(other.limits) and replaced.limits[-1] is not other.limits[-1]


def test_strict_priorities_want_a_level_for_a_new_task(law):
    ordered = replace(
        law,
        formulation=replace(law.formulation, measure="classic"),
        priorities=Priorities(tuple(range(1, len(law.tasks) + 1))),
    )
    with pytest.raises(ParamsError, match="priority: task 'still' needs one"):
        ordered.with_tasks(Still())
    assert ordered.with_tasks(Still(), priority=2).priorities.tasks[-1] == 2
    with pytest.raises(ParamsError, match="has no strict priorities"):
        law.with_tasks(Still(), priority=2)


def moving(system):
    context = system.CreateDefaultContext()
    state = np.concatenate((system.law.model.start, np.zeros(36)))
    system.GetInputPort("estimated_state").FixValue(context, state)
    resting = system.GetOutputPort("torque").Eval(context).copy()
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    state[-1] = 0.01
    system.GetInputPort("estimated_state").FixValue(context, state)
    context.SetTime(system.law.period)
    return context, resting


def test_an_exception_in_the_loop_fades_the_torque_is_kept_and_logged_once(failing, caplog):
    system = RobustTsid(failing)
    context, resting = moving(system)
    faded = np.exp(-failing.period / failing.fade) * resting
    with caplog.at_level(logging.ERROR, logger="drake_tc.tsid"):
        for number in range(1, 4):
            context.SetTime(number * failing.period)
            torque = system.GetOutputPort("torque").Eval(context)
            assert_allclose(torque, faded, rtol=1e-12)
            faded = np.exp(-failing.period / failing.fade) * faded
            assert system.GetOutputPort("status").Eval(context)[Status.OUTCOME] == 2.0
            context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    assert isinstance(system.last_error(context), KeyError)
    assert [record.getMessage().count("KeyError: 'no knee'") for record in caplog.records] == [1]
    assert caplog.records[0].exc_info is not None


def test_contexts_have_their_own_last_error_and_a_clone_keeps_it(failing):
    system = RobustTsid(failing)
    context, _ = moving(system)
    assert isinstance(system.last_error(context), KeyError)
    assert isinstance(system.last_error(context.Clone()), KeyError)
    resting = system.CreateDefaultContext()
    state = np.concatenate((failing.model.start, np.zeros(36)))
    system.GetInputPort("estimated_state").FixValue(resting, state)
    assert system.last_error(resting) is None


def test_strict_raises_what_happened(failing):
    system = RobustTsid(failing, strict=True)
    context, _ = moving(system)
    with pytest.raises(SimulationError, match=r"a task or limit failed at t = 0\.001 s: KeyError: 'no knee'") as caught:
        system.GetOutputPort("torque").Eval(context)
    assert isinstance(caught.value.__cause__, KeyError)


def test_a_lost_state_is_no_exception(law):
    system = RobustTsid(law, strict=True)
    context = system.CreateDefaultContext()
    system.GetInputPort("estimated_state").FixValue(context, np.full(73, np.nan))
    assert_array_equal(system.GetOutputPort("torque").Eval(context), np.zeros(30))
    assert system.last_error(context) is None


class NotANumberInMotion(Still):
    def rows(self, terms, reference):
        rows = super().rows(terms, reference)
        return replace(rows, target=np.full_like(rows.target, np.nan)) if np.abs(terms.v).max() > 0.0 else rows


@pytest.mark.parametrize("priorities", [None, Priorities((1, 1, 2), robustness=3)])
def test_a_task_that_gives_no_number_is_named_and_kept_as_an_error(law, caplog, priorities):
    """The solver alone would say that it failed, and nobody why."""
    odd = replace(law, tasks=(*law.tasks[:2], NotANumberInMotion()), priorities=priorities)
    controller = RobustTsid(odd)
    context = controller.CreateDefaultContext()
    state = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    controller.GetInputPort("estimated_state").FixValue(context, state)
    assert controller.last_error(context) is None
    state[-1] = 0.1
    controller.GetInputPort("estimated_state").FixValue(context, state)
    with caplog.at_level(logging.ERROR):
        torque = controller.GetOutputPort("torque").Eval(context)
    assert np.isfinite(torque).all()
    assert "task 'still': its rows are not finite" in str(controller.last_error(context))
    assert "task 'still': its rows are not finite" in caplog.text
