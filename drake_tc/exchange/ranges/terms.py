"""The posterior in a simulator's terms: every draw is projected, so that a refit acts on whole models."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.stats import rankdata

from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.exchange.dc_motor import with_torque_constant
from drake_tc.exchange.projection import Projection, project
from drake_tc.exchange.ranges.distribution import Distribution
from drake_tc.exchange.ranges.posterior import Posterior, central_model, drawn_models, draws, fitted
from drake_tc.exchange.targets import vocabulary
from drake_tc.simulator_files.terms import Terms
from drake_tc.types import FloatArray

UNITS: Mapping[str, str] = MappingProxyType(
    {
        "kp": "N m/rad",
        "armature": "kg m^2",
        "damping": "N m s/rad",
        "quadratic": "N m s^2/rad^2",
        "frictionloss": "N m",
        "load_friction": "-",
        "delay": "s",
        "torque_limit": "N m",
        "backlash": "rad",
        "stiffness": "N m/rad",
        "preload": "N m",
        "lag": "s",
        "integral_rate": "1/s",
        "derivative_gain": "N m s/rad",
        "compliance": "rad/(N m)",
    }
)
"""Term to its unit for a joint that turns."""
SIGNED = ("preload",)
VARIES = 1e-6
"""A term whose deviation is below this share of its value is a constant."""


@dataclass(frozen=True)
class TermRanges:
    """The terms of one joint that vary.

    Attributes:
        joint: Its name.
        projection: Of the model at the medians.
        distributions: By term. "damping" is what is left to the joint: not the servo's own damping, nor the back-EMF of
            a motor.
        correlation: (t, t) of the normal scores of the terms, in their order (Gaussian copula).
    """

    joint: str
    projection: Projection
    distributions: Mapping[str, Distribution]
    correlation: FloatArray

    @property
    def joint_type(self) -> JointType:
        """Whether the joint turns or slides."""
        return self.projection.joint_type

    def unit(self, term: str) -> str:
        """Unit of a term."""
        return in_units_of(self.joint_type, UNITS[term])


Recorded = Mapping[str, tuple[FloatArray | None, FloatArray | None]]
"""By joint, the velocities and loads at which friction counts (`project`)."""


def term_ranges(
    posterior: Posterior,
    target: str,
    count: int,
    seed: int,
    recorded: Recorded | None = None,
    torque_constant: float | None = None,
) -> list[TermRanges]:
    """The terms of each joint with their distributions.

    Args:
        posterior: Of the parameters.
        target: Name of the simulator on the command line.
        count: Number of draws that are projected.
        seed: Of the generator.
        recorded: Velocities and loads that weight a refit of friction; None: all speeds count alike.
        torque_constant: Of a data sheet [N m/A], for drives on a voltage; None: not known.

    Raises:
        ParamsError: a torque constant whose back-EMF exceeds the viscous friction.
    """
    drawn = draws(posterior, count, seed)
    out = []
    for joint in posterior.unit.models:
        at = (recorded or {}).get(joint, (None, None))
        words = vocabulary(target, posterior.unit.models[joint].drive.kind, torque_constant)
        central = project(central_model(posterior, joint), words, *at)
        if torque_constant is not None:
            central = with_torque_constant(central, torque_constant, words)
        kt = central.terms.torque_constant
        all_terms = [
            _joint_terms(project(model, words, *at).terms, kt) for model in drawn_models(posterior, joint, drawn[joint])
        ]
        found: dict[str, FloatArray] = {}
        for name in UNITS:
            values = np.array([getattr(terms, name) or 0.0 for terms in all_terms])
            if values.size and np.std(values) > VARIES * max(abs(float(np.median(values))), 1e-300):
                found[name] = values
        at_medians = _joint_terms(central.terms, kt)
        distributions = {
            name: fitted(values, getattr(at_medians, name) or 0.0, -np.inf if name in SIGNED else 0.0)
            for name, values in found.items()
        }
        out.append(TermRanges(joint, central, distributions, _correlation(list(found.values()))))
    return out


def _joint_terms(terms: Terms, torque_constant: float | None) -> Terms:
    """The terms with the damping that is left to the joint."""
    elsewhere = terms.derivative_gain + (0.0 if torque_constant is None else torque_constant * terms.kp)
    return replace(terms, damping=max(terms.damping - elsewhere, 0.0))


def _correlation(columns: list[FloatArray]) -> FloatArray:
    """(t, t) 2 sin(pi/6 rho) of the rank correlations rho of columns (N,): that of the normal scores of a copula."""
    if not columns:
        return np.zeros((0, 0))
    ranks = np.column_stack([rankdata(each) for each in columns])
    rho = np.atleast_2d(np.corrcoef(ranks, rowvar=False))
    return np.asarray(2.0 * np.sin(np.pi / 6.0 * rho))
