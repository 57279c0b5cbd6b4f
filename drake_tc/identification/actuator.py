"""From identified coefficients to an actuator model: gain K, viscous and Coulomb friction in torque, with intervals.

effort = K (tau + b qdot + F sign(qdot)),   K = K_tau,  b = K_v/K_tau,  F = K_c/K_tau

Source: Del Prete et al., 2016, eq. 3 to 6.
"""

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.errors import IdentificationError
from drake_tc.identification.asymmetric import AsymmetricFit, PiecewiseFit
from drake_tc.identification.identify import Identified
from drake_tc.identification.regression import LinearFit
from drake_tc.types import FloatArray

Interval = tuple[float, float]
TORQUE_NAMES = (("viscous", "K_v"), ("coulomb", "K_c"))


def ratio_interval(over: Interval, value: float, under: Interval, gain: float, correlation: float) -> Interval:
    """95 % interval of value/gain by first-order propagation: var(r)/r² = var(x)/x² + var(K)/K² − 2 cov/(x K).

    Args:
        over: Interval of `value`.
        value: x.
        under: Interval of `gain`.
        gain: K, not 0.
        correlation: Of the two estimates, in [-1, 1].
    """
    dx, dk = 0.5 * (over[1] - over[0]), 0.5 * (under[1] - under[0])
    square = dx**2 + (value * dk / gain) ** 2 - 2.0 * correlation * dx * dk * value / gain
    half = float(np.sqrt(max(square, 0.0))) / abs(gain)
    return value / gain - half, value / gain + half


def _covariance(found: Identified) -> FloatArray:
    """(3, 3) of K_tau, K_v, K_c; the two stages' are taken as independent."""
    fit = found.fit
    if isinstance(fit, LinearFit | AsymmetricFit):
        return fit.hac_covariance
    covariance = np.zeros((3, 3))
    if not isinstance(fit, PiecewiseFit):
        covariance[:1, :1], covariance[1:, 1:] = fit.rest.hac_covariance, fit.moving.hac_covariance
    return covariance


def actuator_model(found: Identified, rotor_inertia: float = 0.0) -> ActuatorModel:
    """The identified joint as a model that every diagram loads.

    A friction below 0 is put on its bound and named in `at_bound`. The piecewise method has no viscous term; its
    middle pieces are read as Coulomb friction and a dead zone of the drive (see `piecewise_actuator`).

    Args:
        found: What `identify` returned.
        rotor_inertia: Declared J [kg m^2]; left out of the model where it is 0.

    Raises:
        IdentificationError: a drive gain that is not positive: the torque or the command has the wrong sign.

    Example:
        >>> rig, runs = leg_rig(), leg_runs()
        >>> actuator_model(identify(runs, rig), rotor_inertia=0.05).drive.kind
        'current'
    """
    inertia = (EffectValue("rotor_inertia", {"rotor_inertia": rotor_inertia}),) if rotor_inertia > 0.0 else ()
    if isinstance(found.fit, PiecewiseFit):
        drive, effects = piecewise_actuator(found, found.fit)
        return ActuatorModel(found.joint, drive, inertia + effects)
    gain = _positive(found, found.parameters["K_tau"])
    deviation = np.sqrt(np.maximum(np.diag(covariance := _covariance(found)), 1e-300))
    friction = []
    for i, (name, key) in enumerate(TORQUE_NAMES, start=1):
        value = found.parameters[key]
        interval = ratio_interval(
            found.intervals[key],
            value,
            found.intervals["K_tau"],
            gain,
            float(covariance[0, i] / (deviation[0] * deviation[i])),
        )
        at_bound = (name,) if value < 0.0 else ()
        friction.append(EffectValue(name, {name: max(value / gain, 0.0)}, {name: interval}, at_bound))
    return ActuatorModel(found.joint, _drive(found, gain), inertia + tuple(friction))


def piecewise_actuator(found: Identified, fit: PiecewiseFit) -> tuple[Drive, tuple[EffectValue, ...]]:
    """The drive, Coulomb friction and dead zone that come nearest to two three-piece lines.

    With y = K (tau ± F) + w sign(tau ± F) the outer pieces have slope K, and the middle one, a jump of height 2 w,
    stands at tau = ∓F. So K is the mean of the outer slopes, F half the distance of the two middles, and w half the
    distance of the outer lines there, averaged over both directions; F and w are at least 0.

    Raises:
        IdentificationError: a drive gain that is not positive.
    """
    curves = (fit.forward, fit.backward)
    gain = _positive(found, float(np.mean([slope for c in curves for slope in (c.slopes[0], c.slopes[2])])))
    middles = [0.5 * (c.breaks[0] + c.breaks[1]) for c in curves]
    jumps = []
    for curve, middle in zip(curves, middles, strict=True):
        left, right = (float(v) for v in curve(np.array(curve.breaks)))
        below = left + curve.slopes[0] * (middle - curve.breaks[0])
        above = right - curve.slopes[2] * (curve.breaks[1] - middle)
        jumps.append(0.5 * (above - below))
    friction, width = 0.5 * (middles[1] - middles[0]), float(np.mean(jumps))
    coulomb = EffectValue("coulomb", {"coulomb": max(friction, 0.0)}, {}, ("coulomb",) if friction < 0.0 else ())
    zone = EffectValue("deadzone", {"deadzone": max(width, 0.0)}, {}, ("deadzone",) if width < 0.0 else ())
    return _drive(found, gain), (coulomb, zone)


def _positive(found: Identified, gain: float) -> float:
    if not gain > 0.0:
        raise IdentificationError(
            f"{found.joint}: expected a positive drive gain, got {gain:.4g}: the torque or the command column has the"
            " wrong sign, or the logs hold no load (try another --method, or record pushes)"
        )
    return gain


def _drive(found: Identified, gain: float) -> Drive:
    return Drive(found.drive, gain)  # type: ignore[arg-type]
