import numpy as np
import pytest

from drake_tc.control.joint_loop import JointLoop, parameters, value_of, with_values
from drake_tc.errors import ParamsError

LOOP = JointLoop.with_equivalent_gains(
    1.0, 0.01, inertia=1.1, link_inertia=0.4, k_tau=1.2e-4, k_v=7e-3, k_tau_model=1.1e-4, k_v_model=6.5e-3
)


def test_stiffness_stays_unless_it_is_what_changes():
    changed = with_values(LOOP, {"kp": 5.0, "k_tau_model": 2e-4})
    np.testing.assert_allclose([value_of(changed, "k6"), value_of(changed, "k7")], [1.0, 0.01], rtol=1e-12)
    np.testing.assert_allclose(value_of(with_values(LOOP, {"k6": 0.25, "kp": 1.0}), "k6"), 0.25, rtol=1e-12)
    assert with_values(LOOP, {"ks": 7.0, "kp": 1.0}).ks == 7.0
    np.testing.assert_allclose(with_values(LOOP, {"friction": 1.2}).k_v_model, 1.2 * 7e-3, rtol=1e-12)
    assert {"window", "kf", "environment_stiffness", "k6", "friction"} < set(parameters())


def test_every_parameter_can_be_read_and_set():
    for name in set(parameters()) - {"at"}:
        value = 2.0 * value_of(LOOP, name) + 1.0
        np.testing.assert_allclose(value_of(with_values(LOOP, {name: value}), name), value, rtol=1e-12, err_msg=name)
    assert np.isnan(value_of(LOOP, "at")) and value_of(with_values(LOOP, {"at": 20.0}), "at") == 20.0


def test_half_a_sample_is_refused():
    with pytest.raises(ParamsError, match=r"JointLoop.window: expected a whole number, got 20.5"):
        with_values(LOOP, {"window": 20.5})
