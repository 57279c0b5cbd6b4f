"""All joints of a small arm beside what they share, against one stacked fit, and answers of the whole."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_arm import JOINTS, RIG, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.linear import Prior, Products, posterior
from drake_tc.diagnosis.model import SharedColumns
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.robot.joints import Shared, declared_fit
from drake_tc.diagnosis.robot.runs import RobotRuns
from drake_tc.diagnosis.shared.columns_of_runs import columns_over
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.robot.robot import load_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The runs of an arm whose links are fitted."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    paths = [record(folder, robot, f"run_{number}", number) for number in range(2)]
    rig = load_rig(rig_file(folder, **RIG))
    runs = load_runs(paths, rig)
    logs = robot_logs(rig, runs)
    train, held = (with_robot_loads(logs, [run], rig.joints) for run in runs)
    return RobotRuns(train, held, rig, columns_over(logs, [*train, *held], rig), DiagnosisOptions())


def test_links_by_messages_are_those_of_one_stacked_fit(arm):
    shared = Shared.within_tolerance(arm.every_cause)
    fit = declared_fit(arm, shared, np.zeros(arm.width))
    blocks, priors, targets = [], [], []
    for joint in fit.joints.values():
        model = replace(joint.evidence.model, shared=None)
        alone = Evidence(model, joint.evidence.noise, joint.evidence.spread)
        design, prior = alone.design(model.train, joint.best.terms)
        common = -model.train.gain * joint.columns[0][:, shared.places]
        white = model.train.rows.whitened(common, alone.noise)[0]
        weight = np.sqrt(alone.noise.share / joint.best.posterior.variance)
        held = prior.positive[: joint.best.coefficients] & (joint.best.b == 0.0)
        free = np.concatenate([~held, np.ones(prior.mean.size - held.size, dtype=bool)])
        blocks.append((weight * design[:, free], weight * white))
        priors.append(Prior(prior.mean[free], prior.deviation[free], np.zeros(free.sum(), dtype=bool)))
        targets.append(weight * alone.target(model.train, joint.best.terms))
    width, at, rows = sum(own.shape[1] for own, _ in blocks), 0, []
    for own, common in blocks:
        wide = np.zeros((len(own), width))
        wide[:, at : at + own.shape[1]] = own
        rows.append(np.concatenate([wide, common], axis=1))
        at += own.shape[1]
    links = Prior(np.zeros(shared.places.size), shared.deviation, np.zeros(shared.places.size, dtype=bool))
    products = Products.of(np.concatenate(rows), np.concatenate(targets))
    whole = posterior(products, Prior.stacked([*priors, links]), 1.0)
    told = fit.belief()
    size = shared.places.size
    assert_allclose(
        told.mean / shared.deviation, whole.beta[-size:] / shared.deviation, rtol=1e-4, atol=1e-6
    )  # jitter of the solver
    spread = np.sqrt(np.diag(told.covariance)), np.sqrt(np.diag(whole.covariance)[-size:])
    assert_allclose(spread[0], spread[1], rtol=1e-3)  # the wider covariance has eigenvalues near its rounding


def test_a_delay_moves_no_load_and_a_mass_moves_the_loads_of_the_joints_below(arm):
    delta = np.zeros(arm.width)
    delta[-1] = 0.01
    for one, other in zip(arm.at(delta)[0], arm.train, strict=True):
        assert all(np.array_equal(one.columns[f"{j}/torque"], other.columns[f"{j}/torque"]) for j in JOINTS)
    delta[:] = 0.0
    delta[next(c for c in arm.every_cause if c.where == "fore").columns.start + 1] = 0.1
    moved = arm.at(delta)[0][0]
    change = [np.ptp(moved.columns[f"{j}/torque"] - arm.train[0].columns[f"{j}/torque"]) for j in JOINTS]
    assert change[1] > 0.01 and change[2] > 0.01


def test_the_predictive_density_of_one_joint_is_that_of_its_own_model(arm):
    shared = Shared.within_tolerance(arm.every_cause)
    fit = declared_fit(arm, shared, np.zeros(arm.width))
    joint = fit.joints["lift"]
    alone = replace(fit, joints={"lift": joint})
    variance, terms = float(joint.best.posterior.variance), joint.best.terms
    free = replace(joint.evidence.model, shared=None)
    own = SharedColumns(
        *(columns[:, shared.places] for columns in joint.columns),
        Prior(np.zeros(shared.places.size), shared.deviation, np.zeros(shared.places.size, dtype=bool)),
    )
    models = (replace(free, shared=own), free)
    evidences = [Evidence(model, joint.evidence.noise, joint.evidence.spread) for model in models]
    expected = [evidence.predictive(terms, variance, evidence, variance) for evidence in evidences]
    none = Shared(np.zeros(0, dtype=np.int64), np.zeros(0))
    found = alone.predictive(shared) - alone.predictive(none)
    assert abs(expected[0] - expected[1]) > 1.0
    assert_allclose(found, expected[0] - expected[1], rtol=1e-3)  # jitter of the solver
