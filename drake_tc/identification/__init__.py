"""Identification of geared joints from logs: excitation, regressions and their confidence intervals."""

from drake_tc.identification.asymmetric import asymmetric_least_squares, fit_piecewise, fit_three_pieces
from drake_tc.identification.excitation import (
    Motion,
    MotionLimits,
    growing_sinusoid,
    multisine,
    postures_with_pushes,
    trapezoids,
)
from drake_tc.identification.identify import identify
from drake_tc.identification.regression import least_squares
from drake_tc.identification.two_stage import fit_two_stage

__all__ = [
    "Motion",
    "MotionLimits",
    "asymmetric_least_squares",
    "fit_piecewise",
    "fit_three_pieces",
    "fit_two_stage",
    "growing_sinusoid",
    "identify",
    "least_squares",
    "multisine",
    "postures_with_pushes",
    "trapezoids",
]
