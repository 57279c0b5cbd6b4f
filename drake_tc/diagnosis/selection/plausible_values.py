"""Can the fitted values of an effect be believed at all, whatever the effect explains?"""

import math
from collections.abc import Mapping
from dataclasses import replace

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.selection.withdrawal import Withdrawal
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.plausibility import implausible

RESOLVED: Mapping[str, tuple[str, ...]] = {
    "encoder_offset": ("offset",),
    "encoder_eccentricity": ("eccentricity_sine", "eccentricity_cosine"),
    "encoder_ripple": ("ripple_sine", "ripple_cosine"),
}
"""Effects that correct the encoder, and the parameters [rad] whose root sum of squares its resolution must reach."""


def objection_to_values(fitted: Fit, term: Term, context: Context, samples: Samples) -> tuple[Withdrawal, str] | None:
    """Why the values of one effect of a fit cannot be believed, whatever they explain."""
    named = physical_parameters(fitted)
    values = named[term.effect.key]
    own = {
        "gain": named["drive"]["gain"],
        "viscous": named["viscous"]["viscous"],
        "coulomb": named["coulomb"]["coulomb"],
    }
    why = implausible(term.effect, values, replace(context, fitted=own))
    if why:
        return "implausible", why
    return _below_resolution(term.effect, values, samples)


def _below_resolution(effect: Effect, values: Mapping[str, float], samples: Samples) -> tuple[Withdrawal, str] | None:
    names = RESOLVED.get(effect.id)
    if names is None:
        return None
    size = math.hypot(*(values[name] for name in names))
    least = max(samples.resolution.position_step, samples.resolution.position_noise)
    if size >= least:
        return None
    what = names[0] if len(names) == 1 else "amplitude"
    return "below_resolution", f"{what} is {size:.2g} rad; the encoder resolves {least:.2g} rad."
