"""What the sensors' noise leaves in the torque balance after smoothing: the scale for noise and for weak causes.

All channels pass the Gaussian kernel of `oracle` (width sigma, sampling period h). White noise e of a channel leaves
e sqrt(h/(2 sqrt(pi) sigma)) of itself, e sqrt(h/(4 sqrt(pi) sigma^3)) of its derivative and
e sqrt(3 h/(8 sqrt(pi) sigma^5)) of its second derivative; the channel and its second derivative have the covariance
minus the variance of the first.
"""

import numpy as np

from drake_tc.joint_simulator.spec import RigSpec
from tests.benchmarks.blind.oracle import SIGMA_OF_20_MS


def torque_left_by_noise(spec: RigSpec, sigma: float | None = None) -> float:
    """RMS [N m] that white torque noise and encoder steps leave in y/K - tau - J a - B v.

    Args:
        spec: The rig.
        sigma: Width of the kernel [s]; by default 2.5 ms, at least 1.2 sampling periods.
    """
    period = 1.0 / spec.sensors.rate_hz
    width = max(SIGMA_OF_20_MS, 1.2 * period) if sigma is None else sigma
    share = np.sqrt(period / (2.0 * np.sqrt(np.pi) * width))
    encoder = spec.sensors.encoder_step / np.sqrt(12.0) * share
    inertia, stiffness = _inertia(spec), _stiffness(spec)
    slope, curvature = 1.0 / (2.0 * width**2), 3.0 / (4.0 * width**4)
    motion = stiffness**2 + (spec.joint.damping**2 - 2.0 * stiffness * inertia) * slope + inertia**2 * curvature
    torque = spec.sensors.torque_noise * share if spec.pendulum is None else 0.0
    return float(np.sqrt(torque**2 + encoder**2 * motion))


def torque_of_position(spec: RigSpec, low_hz: float, high_hz: float) -> float:
    """Torque [N m/rad] by which the balance errs, RMS over RMS, for position noise that is even over a band.

    sqrt(mean over f of |H|^2), H = -1/K + J w^2 - j w B in a position servo, without 1/K elsewhere; a pendulum's load
    adds its inertia to J and -m g l to H.
    """
    w = 2.0 * np.pi * np.linspace(low_hz, high_hz, 400)
    error = -_stiffness(spec) + _inertia(spec) * w**2 - 1j * w * spec.joint.damping
    return float(np.sqrt(np.mean(np.abs(error) ** 2)))


def _stiffness(spec: RigSpec) -> float:
    """Torque [N m/rad] of the balance for a constant error of position: 1/K of a servo, m g l of a pendulum's load."""
    effort = 1.0 / spec.joint.gain if spec.joint.drive == "position_servo" else 0.0
    return effort + (spec.joint.gravity if spec.pendulum is not None else 0.0)


def _inertia(spec: RigSpec) -> float:
    """Inertia [kg m^2] that multiplies the measured acceleration in the balance."""
    return spec.declared_inertia + (spec.joint.link_inertia if spec.pendulum is not None else 0.0)
