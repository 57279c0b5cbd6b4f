"""Two-stage identification: the drive gain from samples at rest, then friction from moving ones.

Source: Del Prete et al., 2016, section 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import critical_value_95
from drake_tc.identification.regression import LinearFit, least_squares
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True)
class TwoStageFit:
    """Δq = Kτ τ + Kv q̇ + Kc sign(q̇), Kτ first.

    Attributes:
        rest: Stage 1, of Kτ, on the samples at rest.
        moving: Stage 2, of Kv and Kc, on the moving samples; covariance and intervals include stage 1's.
        still: (T,) the samples of stage 1.
        residual: (T,) of the whole model on every sample [effort].
    """

    rest: LinearFit
    moving: LinearFit
    still: BoolArray
    residual: FloatArray

    @property
    def parameters(self) -> dict[str, float]:
        """K_tau, K_v and, where fitted, K_c."""
        return self.rest.parameters | self.moving.parameters

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by name."""
        return self.rest.intervals | self.moving.intervals


def fit_two_stage(
    torque: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
    *,
    still_below: float,
    lengths: Sequence[int] | None = None,
) -> TwoStageFit:
    """Kτ from |q̇| < v0, then Kv and Kc from the rest with Kτ held.

    At rest friction hides anywhere in its band, so stage 1 needs torques well beyond it, of both signs.
    Stage 2's covariance adds what the error of Kτ does to it: g gᵀ var(Kτ), g = (ZᵀZ)⁻¹ Zᵀ τ.

    Args:
        torque: Transmitted torque τ (+ J q̈) (T,) [N·m].
        velocity: q̇ (T,) [rad/s].
        effort: Δq (T,) [effort].
        still_below: v0 [rad/s].
        lengths: Lengths of the contiguous stretches, for the intervals.

    Raises:
        IdentificationError: A threshold that leaves one of the stages without samples, or poor excitation.

    Source: Del Prete et al., 2016, section 3.3.

    Example:
        >>> time = np.linspace(0.0, 20.0, 2001)
        >>> velocity, torque = np.sin(time), 5.0 * np.cos(3.0 * time)
        >>> effort = 2e-3 * torque + 4e-3 * velocity + 5e-3 * np.sign(velocity) * (np.abs(velocity) > 0.05)
        >>> fit = fit_two_stage(torque, velocity, effort, still_below=0.05)
        >>> {name: round(value, 4) for name, value in fit.parameters.items()}
        {'K_tau': 0.002, 'K_v': 0.004, 'K_c': 0.005}
    """
    tau, v, y = (np.asarray(s, dtype=np.float64) for s in (torque, velocity, effort))
    still = np.abs(v) < still_below
    if still.sum() < 3 or (~still).sum() < 4:
        raise IdentificationError(
            f"two stages need samples at rest and in motion; |velocity| < {still_below:g} rad/s leaves "
            f"{int(still.sum())} and {int((~still).sum())}"
        )
    rest_lengths, moving_lengths = _split(still, lengths)
    rest = least_squares(tau[still, None], y[still], names=["K_tau"], lengths=rest_lengths)
    gain = float(rest.coefficients[0])
    z, names = np.stack([v, np.sign(v)], axis=1), ["K_v", "K_c"]
    on = ~still
    moving = least_squares(z[on], y[on] - gain * tau[on], names=names, lengths=moving_lengths)
    moving = _propagate(moving, z[on], tau[on], float(rest.hac_covariance[0, 0]))
    return TwoStageFit(rest, moving, still, y - gain * tau - z @ moving.coefficients)


def _propagate(moving: LinearFit, z: FloatArray, tau: FloatArray, variance: float) -> LinearFit:
    g = np.linalg.lstsq(z, tau, rcond=None)[0]
    covariance = moving.hac_covariance + variance * np.outer(g, g)
    half = critical_value_95(moving.bandwidth, tau.size) * np.sqrt(np.diag(covariance))
    x = moving.coefficients
    return replace(moving, hac_covariance=covariance, ci95=np.stack([x - half, x + half], axis=1))


def _split(still: BoolArray, lengths: Sequence[int] | None) -> tuple[list[int], list[int]]:
    """Samples at rest and in motion of each stretch; time runs on across what the other stage took."""
    edges = np.concatenate([[0], np.cumsum([still.size] if lengths is None else list(lengths))])
    at_rest = [int(still[a:b].sum()) for a, b in pairwise(edges)]
    in_motion = [int(b - a) - n for a, b, n in zip(edges[:-1], edges[1:], at_rest, strict=True)]
    return at_rest, in_motion
