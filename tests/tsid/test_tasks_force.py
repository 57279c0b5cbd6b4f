"""Tasks on contact forces and torques: what they measure, and which contacts they read."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.robot.fields import Mount
from drake_tc.tsid.contacts import Contact
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.tasks import CopTask, ForceTask, TorqueTask

from .machines import arm, machine, random_state


@pytest.fixture
def model(tmp_path):
    return machine("floating arm", tmp_path)


def terms_of(model, mask=None):
    return model.terms(model.create_scratch(), *random_state(model, 1), mask)


def test_forces_follow_the_reference_of_the_contacts_that_are_active(model):
    components = [1, 2, 3, 4, 5, 6]
    task = ForceTask(model, weight=0.1, components=components)
    assert task.reference_size == 9  # a sole and a point
    reference, force = np.random.default_rng(0).normal(size=(2, 9))
    weight = 0.1 * np.array([*components, 1, 2, 3])
    for mask, places in (
        (None, np.arange(9)),
        ((True, False), np.arange(6)),
        ((False, True), np.arange(6, 9)),
        ((False, False), np.arange(0)),
    ):
        rows = task.rows(terms_of(model, mask), reference)
        assert rows.matrix.force.shape == (places.size, places.size)
        missed = rows.weight * (rows.matrix.force @ force[places] - rows.target)
        assert_allclose(missed, (weight * (force - reference))[places], atol=1e-14)


def test_torques_follow_their_reference(model):
    task, n = TorqueTask(model, weight=2.0), model.n
    assert_allclose(task.rest(terms_of(model)), np.zeros(n), atol=0)
    wanted, torque = np.random.default_rng(2).normal(size=(2, n))
    rows = task.rows(terms_of(model), wanted)
    assert rows.matrix.vdot is None and rows.matrix.force is None
    assert_allclose(rows.weight * (rows.matrix.torque @ torque - rows.target), 2.0 * (torque - wanted), atol=1e-14)
    with pytest.raises(ParamsError, match="torque"):
        TorqueTask(model, weight=-1.0)


def test_six_components_of_two_points_are_one_a_force(tmp_path):
    robot, mounts = machine("floating arm", tmp_path).robot, [Mount(name, name) for name in ("hand", "slider", "base")]
    tips = [Contact(f"{mount.link}_tip", replace(mount, name=f"{mount.link}_tip"), "point") for mount in mounts]
    components = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert_allclose(ForceTask(TsidModel(robot, tips[:2]), components=components).weight, components, rtol=0)
    three = ForceTask(TsidModel(robot, tips), components=components)
    assert_allclose(three.weight, [1.0, 2.0, 3.0] * 3, rtol=0)  # the pattern of every contact
    sole = Contact("sole", Mount("sole", "hand"), half_length=0.1, half_width=0.1)
    assert_allclose(ForceTask(TsidModel(robot, [sole]), components=components).weight, components, rtol=0)


def pressure(force):
    """Where a force pushes on the plane z = 0: the moment about that point has no part in the plane."""
    x, y = np.linalg.lstsq(np.array([[0.0, force[2]], [-force[2], 0.0]]), force[3:5], rcond=None)[0]
    assert_allclose(np.cross([x, y, 0.0], force[:3])[:2], force[3:5], atol=1e-12)
    return np.array([x, y])


def test_pressure_is_the_distance_times_the_normal_force(model):
    task, rng = CopTask(model, "sole", weight=[2.0, 3.0]), np.random.default_rng(1)
    terms = terms_of(model)
    for _ in range(20):
        force, wanted = rng.normal(size=9), rng.normal(size=2)
        force[2] += 50.0
        rows = task.rows(terms, wanted)
        missed = rows.matrix.force @ force - rows.target
        assert_allclose(missed, force[2] * (wanted - pressure(force[:6])), atol=1e-12)
        at = task.rows(terms, pressure(force[:6]))
        assert_allclose(at.matrix.force @ force, at.target, atol=1e-12)
    assert_allclose(rows.weight, [2, 3], atol=0)
    assert task.rows(terms_of(model, (False, True)), np.zeros(2)).target.size == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda m: ForceTask(m, weight=-1.0), r"task 'force': weight: expected finite numbers >= 0"),
        (lambda m: ForceTask(m, components=[1, 2]), r"task 'force': components: expected a number or 9 of them"),
        (lambda m: ForceTask(m, components=[np.nan] * 6), r"task 'force': components: expected finite numbers"),
        (lambda m: CopTask(m, "heel"), r"task 'heel pressure': no surface contact 'heel'; possible: sole"),
        (lambda m: CopTask(m, "tip"), r"task 'tip pressure': no surface contact 'tip'; possible: sole"),
        (lambda m: CopTask(m, "sole", weight=[1, -1]), r"task 'sole pressure': weight: expected finite numbers >= 0"),
    ],
)
def test_what_is_refused(model, make, message):
    with pytest.raises(ParamsError, match=message):
        make(model)


def test_a_robot_without_contacts_is_told_so(tmp_path):
    model = TsidModel(arm(tmp_path))
    with pytest.raises(ParamsError, match=r"task 'force': expected a model with contacts; robot 'arm' has none here"):
        ForceTask(model)
    with pytest.raises(ParamsError, match=r"no surface contact 'sole'; possible: none"):
        CopTask(model, "sole")
