"""Scatter of the sampling instants where a robot's links are fitted: it acts on the loads by the links' momentum."""

import numpy as np
import pytest
from fitted_arm import JOINTS, PERIOD, URDF, record, rig_file
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.shared.timing import momenta_over
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot

SCATTER = 3e-4
NONE = (np.zeros(0, dtype=np.int64), np.zeros(0))


def scattered(path, seed):
    """The same log with positions at t_k + delta_k, to first order."""
    rng, columns = np.random.default_rng(seed), dict(np.load(path))
    delta = SCATTER * rng.standard_normal(columns["time"].size)  # all joints are read at once
    for joint in JOINTS:
        position = columns[f"{joint}/position"]
        columns[f"{joint}/position"] = position + delta * np.gradient(position, PERIOD)
    out = path.with_name(f"scattered_{path.stem}.npz")
    np.savez(out, **columns)
    return out


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    robot = load_robot(write_robot(folder, URDF, JOINTS))
    clean = [record(folder, robot, f"run_{k}", k) for k in range(3)]
    rig = load_rig(rig_file(folder))
    made = {}
    for name, paths in (("clean", clean), ("scattered", [scattered(path, k) for k, path in enumerate(clean)])):
        runs = load_runs(paths, rig)
        logs = robot_logs(rig, runs)
        made[name] = (logs, with_robot_loads(logs, runs, rig.joints))
    return rig, robot, made


def test_momenta_are_those_of_the_mass_matrix(arm):
    rig, robot, made = arm
    logs, runs = made["scattered"]
    momenta = momenta_over(logs, logs.links, (runs, runs[:0]), rig)
    lighter = np.arange(10, 20)  # the second link weighs half
    found = momenta.added(runs, JOINTS, lighter, 0.5 * logs.links.nominal[lighter])[0]
    whole = momenta.added(runs, JOINTS, *NONE)[0]
    plant = make_plant(robot, 0.0)
    context, run = plant.CreateDefaultContext(), runs[0]
    q = np.stack([run.columns[f"{joint}/position"] for joint in JOINTS], axis=1)
    v = np.gradient(q, PERIOD, axis=0)
    at = np.arange(100, len(run) - 100)
    expected = np.zeros((at.size, 3))
    for row, place in enumerate(at):
        plant.SetPositions(context, q[place])
        expected[row] = plant.CalcMassMatrix(context) @ v[place]
    told = np.stack([whole.columns[f"{joint}/momentum"][at] for joint in JOINTS], axis=1)
    # the speed that is differentiated here has the noise of the scatter, the told one that of a smoothing window
    error = np.sqrt(np.mean((told - expected) ** 2, axis=0)) / np.sqrt(np.mean(expected**2, axis=0))
    assert np.all(error < 0.1), error
    halved = found.columns["turn/momentum"][at]
    assert np.mean(np.abs(halved)) < 0.95 * np.mean(np.abs(told[:, 0]))


def test_a_robot_without_scatter_has_no_momenta(arm):
    rig, _, made = arm
    logs, runs = made["clean"]
    assert momenta_over(logs, logs.links, (runs, runs[:0]), rig) is None


@pytest.mark.parametrize("joint", JOINTS)
def test_the_moments_of_the_links_are_what_the_scatter_leaves_in_the_load(arm, joint):
    rig, _, made = arm
    logs, runs = made["scattered"]
    momenta = momenta_over(logs, logs.links, (runs, runs[:0]), rig)
    noisy = build_samples(momenta.added(runs, JOINTS, *NONE), rig, joint)
    assert noisy.resolution.timing.time == pytest.approx(SCATTER, rel=0.1)
    width, final = noisy.light.width_s, noisy.kernel.width_s
    still = build_samples(made["clean"][1], rig, joint, width_s=width, final_s=final)
    common = np.intersect1d(noisy.rows, still.rows)
    one, other = (s.reduce(s.signals.load_torque)[np.isin(s.rows, common)] for s in (noisy, still))
    expected = np.sqrt(np.mean(noisy.timing[np.isin(noisy.rows, common), 2, 2]))
    # some hundred independent values in 45 s of so wide filters; the windows of both logs differ a little
    assert_allclose(np.sqrt(np.mean((one - other) ** 2)), expected, rtol=0.25)
