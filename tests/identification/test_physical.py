"""Results that no joint has are refused; those that a joint may have are not."""

import numpy as np
import pytest

from drake_tc.errors import IdentificationError
from drake_tc.identification.free_parameters import require_physical

V = np.linspace(-2.0, 2.0, 401)
S = np.sign(V)


def check(k_tau, k_v, k_c, half=0.01):
    values = {"K_tau": k_tau, "K_v": k_v, "K_c": k_c}
    require_physical("knee", values, {name: (x - half, x + half) for name, x in values.items()}, V, S)


def test_what_joints_have():
    check(1.0, 0.5, 0.2)
    check(1.0, -0.1, 0.5)  # friction that falls with speed
    check(1.0, 0.5, -0.2)  # quadratic friction in a linear model
    check(-0.005, 0.0, 0.0)  # not told from zero


def test_a_drive_gain_below_zero_and_friction_that_drives():
    with pytest.raises(IdentificationError, match=r"knee: K_tau is -0.5 \[-0.51, -0.49\], and expected above 0"):
        check(-0.5, 0.5, 0.2)
    # mean(v^2) = 1.34, mean(|v|) = 1: -0.19 * 1.34 + 0.21 < 0
    with pytest.raises(IdentificationError, match="knee: friction would drive the joint"):
        check(1.0, -0.2, 0.2)
    check(1.0, -0.16, 0.2)


def test_results_without_intervals_pass():
    require_physical("knee", {"forward.k_1": -1.0}, {}, V, S)
