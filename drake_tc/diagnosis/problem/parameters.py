"""From the coefficients and shapes of a fit to the parameters that reports and model files have."""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.held_gain import HELD_GAIN
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.types import FloatArray


def shape_places(terms: Sequence[Term]) -> tuple[list[tuple[int, str]], FloatArray]:
    """Where the terms' shape parameters are (number of the term, name), and their values (s,)."""
    where = [(i, p.name) for i, t in enumerate(terms) for p in t.effect.shapes]
    return where, np.array([terms[i].shape[name] for i, name in where], dtype=float)


def with_shapes(terms: Sequence[Term], where: Sequence[tuple[int, str]], values: FloatArray) -> list[Term]:
    """The terms with other values (s,) of their shape parameters."""
    shapes = [dict(t.shape) for t in terms]
    for (i, name), value in zip(where, values, strict=True):
        shapes[i][name] = float(value)
    return [Term(t.effect, s) for t, s in zip(terms, shapes, strict=True)]


def physical_parameters(
    fitted: Fit, beta: FloatArray | None = None, shapes: FloatArray | None = None
) -> dict[str, dict[str, float]]:
    """Reported parameters by term key ("drive" holds the gain).

    Args:
        fitted: A fit.
        beta: (1 + k,) in place of the fit's own.
        shapes: (s,) values of the shape parameters in place of the fit's own.
    """
    where, own = shape_places(fitted.terms)
    beta = fitted.beta if beta is None else beta
    shapes = own if shapes is None else shapes
    terms = with_shapes(fitted.terms, where, shapes)
    gain = 1.0 / beta[0]
    out: dict[str, dict[str, float]] = {"drive": {"gain": float(gain)}}
    scale = held = 1.0
    for term, theta in coefficients_by_term(terms, beta):
        out["drive"]["gain"] = term.effect.drive_gain(out["drive"]["gain"], term.shape)
        out[term.effect.key] = term.effect.physical(theta, term.shape, gain)
        factor = term.effect.torque_scale(theta, gain)
        scale *= factor
        held *= factor if term.shape.get(HELD_GAIN) else 1.0
    if scale != 1.0:
        _to_true_torque(out, terms, scale, held)
    return out


def _to_true_torque(out: dict[str, dict[str, float]], terms: Sequence[Term], scale: float, held: float) -> None:
    """One N m of the fit is 1/scale N m of true torque (a sensor's gain error, a servo's wind-up).

    The fitted gain K is K scale in true torque. Where `servo_gain` holds it against the declared K_0, the drive keeps
    K_0 and the effect takes the scale: 1 + e = K_0/(K scale). Effects whose columns hold the gain
    (`effects.held_gain`) leave it where it is: of their part `held` of the scale, 1/K = held/K_true - (held - 1)/K_0.
    """
    if ServoGain.id in out:
        out[ServoGain.id]["gain_error"] = (out[ServoGain.id]["gain_error"] + held) / scale - 1.0
    else:
        out["drive"]["gain"] *= scale / held
    for term in terms:
        for p in term.effect.parameters:
            if p.unit.startswith(("N*m", "kg")):
                out[term.effect.key][p.name] /= scale
