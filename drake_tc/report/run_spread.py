"""Each run's own estimate of a parameter beside that of all runs: a small plot for a table's cell."""

from collections.abc import Mapping, Sequence
from html import escape

from drake_tc.diagnosis.problem.columns import coefficients_by_term
from drake_tc.diagnosis.result.joint_result import JointResult, ParameterByCondition
from drake_tc.report.numbers import interval

WIDTH, HEIGHT, MARGIN = 96.0, 26.0, 4.0
Value = tuple[float, float, float]
"""Value, lower and upper end of the 95 % interval."""


def run_spreads(joint: JointResult) -> Mapping[tuple[str, str], str]:
    """SVG by effect key and name of parameter, for the parameters that were fitted again by run.

    A coefficient of the regression is in the parameter's unit up to one factor, which an effect that scales the balance
    has (`Effect.torque_scale`); parameters that are no coefficient have no plot.
    """
    factors = _factors(joint)
    out = {}
    for p in joint.consistency:
        if p.by == "run" and (p.effect, p.name) in factors:
            estimate = joint.final_parameters[p.effect][p.name]
            runs = _scaled(p, factors[p.effect, p.name])
            out[p.effect, p.name] = spread_svg(runs, (estimate.value, *estimate.ci95), moves=p.moves)
    return out


def _factors(joint: JointResult) -> dict[tuple[str, str], float]:
    fitted = {("drive", "gain"): joint.final.gain}
    for term, theta in coefficients_by_term(joint.final.terms, joint.final.beta):
        fitted |= {
            (term.effect.key, p.name): float(x)
            for p, x in zip(term.effect.coefficients, theta, strict=True)
            if x != 0.0
        }
    known = joint.final_parameters
    return {(key, name): known[key][name].value / x for (key, name), x in fitted.items() if name in known.get(key, {})}


def _scaled(p: ParameterByCondition, factor: float) -> dict[str, Value]:
    return {run: (factor * v, *sorted((factor * low, factor * high))) for run, (v, low, high) in p.values.items()}  # type: ignore[misc]


def spread_svg(runs: Mapping[str, Value], overall: Value, *, moves: bool) -> str:
    """One dot a run with its 95 % interval; the line and the band are the estimate from all runs.

    The frame holds every value and the interval of the estimate; an interval of a run may reach beyond it.
    """
    values = [v for v, _, _ in runs.values()]
    low, high = min(*values, *overall), max(*values, *overall)
    reach = (high - low) or abs(high) or 1.0
    low, high = low - 0.15 * reach, high + 0.15 * reach

    def y(value: float) -> float:
        return round(min(max(HEIGHT * (high - value) / (high - low), 0.0), HEIGHT), 1)

    step = (WIDTH - 2 * MARGIN) / len(runs)
    colour = "var(--alarm)" if moves else "var(--after)"
    band = y(overall[2])
    parts = [
        f'<rect x="0" y="{band}" width="{WIDTH:g}" height="{max(y(overall[1]) - band, 0.6):.1f}" fill="var(--shade)"/>',
        f'<path d="M0 {y(overall[0])}H{WIDTH:g}" stroke="var(--muted)" stroke-width="0.8"/>',
    ]
    for k, (value, bottom, top) in enumerate(runs.values()):
        x = round(MARGIN + (k + 0.5) * step, 1)
        parts.append(f'<path d="M{x} {y(bottom)}V{y(top)}" stroke="{colour}" stroke-width="1"/>')
        parts.append(f'<circle cx="{x}" cy="{y(value)}" r="{min(2.2, 0.4 * step):.1f}" fill="{colour}"/>')
    said = escape(_told(list(runs.items())), quote=True)
    return (
        f'<svg class="spread" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{said}"><title>{said}</title>'
        f"{''.join(parts)}</svg>"
    )


def _told(runs: Sequence[tuple[str, Value]]) -> str:
    return "; ".join(f"{run}: {' '.join(interval(*value))}".rstrip() for run, value in runs)
