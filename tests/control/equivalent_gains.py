"""K6 .. K9 of Del Prete et al. (2016), eq. 13 and 14: gains from tracking errors to effort."""

from typing import NamedTuple

import numpy as np

from drake_tc.control.gains import TorqueGains
from drake_tc.types import FloatArray


class EquivalentGains(NamedTuple):
    """Gains from e (n,), edot (n,), eddot (n, n) and e_f (n, m) to the effort."""

    k6: FloatArray
    k7: FloatArray
    k8: FloatArray
    k9: FloatArray


def to_equivalent(gains: TorqueGains, k_tau: FloatArray, mass: FloatArray, jacobian: FloatArray) -> EquivalentGains:
    """K6 .. K9 of the gains at one configuration, as the module `drake_tc.control.gains` states them.

    Args:
        gains: Kp, Ks, Kd, Kf; Ki has no counterpart.
        k_tau: (n,) drive gains [effort/(N m)].
        mass: M (n, n) [kg m^2], link side.
        jacobian: J (m, n), rows [linear; angular] of each contact frame.
    """
    drive = np.diag(k_tau)
    kp, kf = np.diag(gains.kp), gains.kf
    total = drive @ (np.eye(gains.size) + kp)
    forces = kp @ jacobian.T @ (np.eye(len(kf)) + kf) + jacobian.T @ kf
    diagonal = np.diagonal
    return EquivalentGains(diagonal(total) * gains.ks, diagonal(total) * gains.kd, drive @ kp @ mass, -drive @ forces)
