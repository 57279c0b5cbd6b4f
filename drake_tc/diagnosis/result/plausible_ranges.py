"""Where each parameter of the final model is physically possible on this rig, and why."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.base import Context
from drake_tc.effects.plausibility import ROUNDING, plausible_range


@dataclass(frozen=True)
class PlausibleRange:
    """The values of a parameter that are possible: lower <= value <= upper, in its own unit; infinite where unlimited.

    `source` says why: a law, a definition, a data sheet or a publication.
    """

    lower: float
    upper: float
    source: str

    def holds(self, value: float) -> bool:
        """Whether a value lies in the range, up to rounding."""
        low, high = self.lower, self.upper
        return low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high)


def plausible_ranges(fitted: Fit, context: Context) -> Mapping[str, Mapping[str, PlausibleRange]]:
    """Ranges by effect key and name of parameter; parameters without one, and those of links, are left out.

    Args:
        fitted: The final model: some ranges are multiples of its drive gain, viscous or Coulomb friction.
        context: What the training logs span.
    """
    named = physical_parameters(fitted)
    own = {"gain": named["drive"]["gain"]}
    own |= {name: named[name][name] for name in ("viscous", "coulomb") if name in named}
    known = replace(context, fitted=own)
    out: dict[str, dict[str, PlausibleRange]] = {}
    for term in fitted.terms:
        for p in term.effect.parameters:
            if p.plausible is not None:
                low, high = plausible_range(p, known)
                source = context.units.text(p.plausible.on(context.joint_type).source)
                out.setdefault(term.effect.key, {})[p.name] = PlausibleRange(low, high, source)
    return out
