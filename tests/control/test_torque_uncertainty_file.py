"""The torque uncertainty's file: read back exactly, refused in one line that names file and key."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty, load_torque_uncertainty, save_torque_uncertainty
from drake_tc.errors import ParamsError

GOOD = {"schema": 1, "unit": "N*m", "joints": ["hip", "knee"], "covariance": [[4.0, 1.0], [1.0, 1.0]]}


def written(folder, text):
    path = folder / "sigma.yaml"
    path.write_text(text if isinstance(text, str) else yaml.safe_dump(text))
    return path


def test_it_is_read_back_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3)) * [1e-3, 1.0, 30.0]
    made = TorqueUncertainty(
        ("a", "b", "c: d"),
        root.T @ root,
        rng.normal(size=3),
        np.sort(rng.uniform(size=(3, 2))),
        rng.uniform(size=3),
        rng.uniform(10, 100, size=3),
        np.array([100.0, 200.0, 300.0]),
        37.5,
        0.25,
        {"rig": "rig.yaml", "holdout": ["x.npz"]},
    )
    loaded = load_torque_uncertainty(save_torque_uncertainty(made, tmp_path / "u.yaml"))
    for name in ("covariance", "mean", "ci95", "correlation_time", "effective_samples", "samples"):
        assert_allclose(getattr(loaded, name), getattr(made, name), rtol=0, atol=0, err_msg=name)
    assert (loaded.joints, loaded.provenance) == (made.joints, made.provenance)
    assert (loaded.common_effective_samples, loaded.shrinkage) == (37.5, 0.25)


def test_a_controller_takes_its_own_joints_in_its_own_order(tmp_path):
    loaded = load_torque_uncertainty(written(tmp_path, GOOD))
    assert_allclose(loaded.of(["knee", "hip"]), [[1.0, 1.0], [1.0, 4.0]])
    assert_allclose(loaded.of(["knee"]), [[1.0]])
    assert_allclose(loaded.sigma, [2.0, 1.0])
    assert_allclose(loaded.correlation, [[1.0, 0.5], [0.5, 1.0]])
    assert np.isnan(loaded.mean).all()
    with pytest.raises(ParamsError, match="no joint 'ankle'; joints here: hip, knee"):
        loaded.of(["ankle"])


def test_it_cannot_be_changed(tmp_path):
    loaded = load_torque_uncertainty(written(tmp_path, GOOD))
    with pytest.raises(ValueError, match="read-only"):
        loaded.covariance[0, 0] = 0.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"covariance": [[4.0, 1.0], [0.0, 1.0]]}, "symmetric"),
        ({"covariance": [[1.0, 2.0], [2.0, 1.0]]}, "positive semidefinite.*smallest eigenvalue is -1"),
        ({"covariance": [[1.0]]}, r"covariance: expected shape \(2, 2\)"),
        ({"covariance": [[1.0, 0.0], [0.0]]}, "rows of one length"),
        ({"covariance": [[".nan", 0.0], [0.0, 1.0]]}, r"covariance\[0\]\[0\]: expected a finite number, got '.nan'"),
        ({"covariance": [[float("nan"), 0.0], [0.0, 1.0]]}, "finite"),
        ({"covariance": None}, "covariance: expected a list, got null"),
        ({"joints": ["hip", "hip"]}, "'hip' is listed twice"),
        ({"joints": "hip"}, "joints: expected a list, got 'hip'"),
        ({"joints": []}, "joints: expected at least 1 entry"),
        ({"mean": [1.0]}, r"mean: expected shape \(2,\)"),
        ({"sigma_ci95": [1.0, 2.0]}, r"sigma_ci95\[0\]: expected a list, got 1\.0"),
        ({"unit": "mN*m"}, r"unit: expected 'N\*m', got 'mN\*m'"),
        ({"schema": 2}, "schema: expected 1, got 2"),
        ({"shrinkage": 1.5}, "shrinkage: expected 0 to 1"),
        ({"sigma": [1.0, 1.0]}, "unknown key 'sigma'; did you mean 'sigma_ci95'[?]; allowed: schema"),
        ({"provenance": "me"}, "provenance: expected a mapping, got 'me'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, change, said):
    path = written(tmp_path, GOOD | change)
    with pytest.raises(ParamsError, match=said) as refusal:
        load_torque_uncertainty(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- 1\n", "expected a mapping"),
        ("schema: 1\nunit: N*m\njoints: [a]\n", "covariance is missing"),
        ("schema: 1\nschema: 1\n", "given twice"),
        ("{", "not valid YAML"),
    ],
)
def test_what_is_no_such_file_is_refused(tmp_path, text, said):
    with pytest.raises(ParamsError, match=said):
        load_torque_uncertainty(written(tmp_path, text))
    with pytest.raises(ParamsError, match="no such torque uncertainty file"):
        load_torque_uncertainty(tmp_path / "nowhere.yaml")
