"""Identification of geared joints from logs: excitation, regressions and their confidence intervals."""

from drake_tc.identification.asymmetric import AsymmetricFit, asymmetric_least_squares
from drake_tc.identification.excitation import (
    Motion,
    MotionLimits,
    growing_sinusoid,
    multisine,
    postures_with_pushes,
    trapezoids,
)
from drake_tc.identification.identify import Identified, JointSamples, identify, identify_arrays
from drake_tc.identification.linear_fit import LinearFit
from drake_tc.identification.piecewise import PiecewiseFit, ThreePieces, fit_piecewise, fit_three_pieces
from drake_tc.identification.regression import least_squares
from drake_tc.identification.two_stage import TwoStageFit, fit_two_stage

__all__ = [
    "AsymmetricFit",
    "Identified",
    "JointSamples",
    "LinearFit",
    "Motion",
    "MotionLimits",
    "PiecewiseFit",
    "ThreePieces",
    "TwoStageFit",
    "asymmetric_least_squares",
    "fit_piecewise",
    "fit_three_pieces",
    "fit_two_stage",
    "growing_sinusoid",
    "identify",
    "identify_arrays",
    "least_squares",
    "multisine",
    "postures_with_pushes",
    "trapezoids",
]
