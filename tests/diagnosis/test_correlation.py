"""The correlation of reported parameters, against that of repeated logs with other noise."""

import numpy as np

from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.intervals import correlated_parameters
from drake_tc.diagnosis.problem.prepared import prepare_joint
from tests.diagnosis.rigs import Joint, record, rig_of

LOGS = 24


def test_parameters_of_repeated_logs_scatter_with_the_told_correlation() -> None:
    joint = Joint(period=4e-3, torque_noise=0.5)
    rig = rig_of(joint)
    values, told = [], []
    for k in range(LOGS):
        train = [record(joint, "run", 0.0, seed=10 + k)]
        model = joint_model(prepare_joint(train, [record(joint, "held", 2.1, seed=9)], rig, "joint"))
        evidence = Evidence(model).tempered(model.declared)
        found, correlation = correlated_parameters(evidence, evidence.score(model.declared))
        names = [name.split(".") for name in correlation.names]
        values.append([found[effect][name].value for effect, name in names])
        told.append(correlation.matrix)
    i, j = (correlation.names.index(name) for name in ("viscous.viscous", "coulomb.coulomb"))
    matrix = np.mean(told, axis=0)
    np.testing.assert_allclose(matrix, matrix.T)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0
    seen = np.corrcoef(np.array(values).T)
    assert matrix[i, j] < -0.2
    assert np.arctanh(seen[i, j]) == np.clip(
        np.arctanh(seen[i, j]), *(np.arctanh(matrix[i, j]) + np.array([-3.0, 3.0]) / np.sqrt(LOGS - 3))
    )
