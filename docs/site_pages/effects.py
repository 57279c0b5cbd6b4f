"""A gallery of the effects by where they act, and a page for each: equation, parameters, plots and neighbours."""

from functools import cache

import numpy as np

from drake_tc.config.page import table
from drake_tc.effects.base import Effect
from drake_tc.effects.library import BUILT_IN, LIBRARY, UNCOMMON
from drake_tc.report.equation import symbolic_equations
from drake_tc.report.notes import isolating
from drake_tc.types import FloatArray
from site_pages import traces
from site_pages.plots import BACKWARD, FORWARD, INK, Series, plot
from site_pages.traces import Trace

SHOWN, LISTED, DRAWN = 0.5, 3, 600
"""Least share of a neighbour's imitation that is listed; neighbours in the gallery; points that are drawn."""
ALWAYS_FITTED = ("viscous", "coulomb")
LABELS = {
    "position": "position q [rad]",
    "velocity": "velocity [rad/s]",
    "acceleration": "acceleration [rad/s²]",
    "load_torque": "load torque τ [N·m]",
    "expected_torque": "load torque τ [N·m]",
    "effort": "effort y",
    "command": "command",
    "temperature": "temperature [°C]",
    "time": "time [s]",
    "travel": "travel since the last reversal [rad]",
    "supply_voltage": "supply voltage [V]",
    "motor_position": "motor position [rad]",
}
GROUPS = {
    "friction": ("friction", "Friction", "Torques that oppose the motion of the joint."),
    "drive": ("drive", "Drive", "What stands between the command and the torque of the motor."),
    "transmission": ("gear", "Gear", "What stands between the angle of the motor and the angle of the link."),
    "load": ("load", "Load", "Torques of masses, springs and cables on the link, and of the rotor's inertia."),
    "sensor": ("sensor", "Sensor", "Errors of what was recorded. The joint itself moves as it would without them."),
}
"""Kind of an effect to the name, the title and the first sentence of its group's page."""


def pages() -> dict[str, str]:
    """Page to its text: the overview, the gallery of each group, and the details of each effect."""
    galleries = {f"effects/{name}.md": _gallery(kind) for kind, (name, _, _) in GROUPS.items()}
    return {"effects/index.md": _overview()} | galleries | {f"effects/{e.key}.md": _page(e) for e in _listed()}


def _listed() -> list[Effect]:
    """Every effect, one of each family of forms that differ in their number of levels alone."""
    families: dict[tuple[str, str], Effect] = {}
    for effect in BUILT_IN:
        families.setdefault((effect.id, effect.form.rstrip("0123456789_")), effect)
    return list(families.values())


def _of_kind(kind: str) -> list[Effect]:
    return [effect for effect in _listed() if effect.kind == kind]


def _overview() -> str:
    parts = [_HEAD, _SYMBOLS]
    for kind, (name, title, about) in GROUPS.items():
        rows = [
            (f"[{_title(each)}]({name}.md#{_anchor(each)})", f"`{each.key}`", each.signature.look_for)
            for each in _of_kind(kind)
        ]
        parts += [f"## [{title}]({name}.md)", about]
        parts.append(table(("effect", "id", "what to look for in the residual"), rows))
    return "\n\n".join(parts) + "\n"


def _gallery(kind: str) -> str:
    _, title, about = GROUPS[kind]
    shown = [_shown(effect) for effect in _of_kind(kind)]
    return "\n\n".join([f"# {title}", f"{about} {_HOW_TO_READ}", *shown]) + "\n"


_HOW_TO_READ = (
    "The plots show the residual of a simulated log, after viscous and Coulomb friction were fitted (blue: forward,"
    " orange: backward). The percentage behind a neighbour is the share of this residual that it alone explains."
    " [Symbols](index.md)."
)


def _shown(effect: Effect) -> str:
    """An effect's section of the gallery."""
    seen = traces.trace(effect)
    parts = [f'## {_title(effect)} {{ id="{_anchor(effect)}" }}', _equation(effect)]
    if seen is not None:
        parts.append(f'<div class="plot small">{_signature(seen)}</div>')
    facts = [f"**In a log:** {effect.signature.look_for}."]
    if effect.key in ALWAYS_FITTED:
        facts.append("**Always fitted:** it is part of every declared model.")
    elif found := _other_causes(effect)[:LISTED]:
        names = "; ".join(f"{_link(other)} ({100 * share:.0f} %)" for other, share in found)
        facts.append(f"**Taken for:** {names}.")
    if effect.key not in ALWAYS_FITTED:
        facts.append(f"**Told apart:** {isolating(effect.id)}.")
    facts.append(f"[Parameters and details]({effect.key}.md)")
    return "\n\n".join([part for part in parts if part] + ["\n".join(f"- {fact}" for fact in facts)])


def _anchor(effect: Effect) -> str:
    return effect.key.replace(".", "-")


def _link(effect: Effect) -> str:
    """Link to an effect's section of the gallery."""
    return f"[{_title(effect)}]({GROUPS[effect.kind][0]}.md#{_anchor(effect)})"


def _other_causes(effect: Effect) -> list[tuple[Effect, float]]:
    """The imitators of other ids, the best form of each."""
    best: dict[str, tuple[Effect, float]] = {}
    for other, share in _imitators(effect):
        if other.id != effect.id:
            best.setdefault(other.id, (other, share))
    return list(best.values())


@cache
def _imitators(effect: Effect) -> list[tuple[Effect, float]]:
    """Effects with the share of the residual of this one that each explains, without those that are always fitted."""
    seen = traces.trace(effect)
    found = traces.neighbours(seen, LIBRARY, SHOWN, 6) if seen is not None else []
    return [(other, share) for other, share in found if other.key not in ALWAYS_FITTED]


_HEAD = """# Effects

An effect is one physical cause between the command of a drive and the motion of its joint. Its equation serves the
fit, the simulation, the compensation and the plot of the report. All effects add to one balance of torques,

    y*/K = τ + J q̈ + Σ Δτ

with the effort y that the drive was given, the effort y\\* on which it acted, the drive gain K, the load torque τ
on the link's side of the gear, and the inertia J of the rotor, reflected to that side."""


def _page(effect: Effect) -> str:
    searched, uncommon = (any(effect.key == each.key for each in among) for among in (LIBRARY, UNCOMMON))
    seen = traces.trace(effect)
    name, title, _ = GROUPS[effect.kind]
    parts = [f"# {_title(effect)}", f"`{effect.key}` · [{title}]({name}.md#{_anchor(effect)})", _summary(effect)]
    if effect.equation:
        parts += ["## Equation", _equation(effect), _SYMBOLS]
    if effect.parameters:
        parts += ["## Parameters", _parameters(effect)]
    parts += ["## What it looks like", f"Look for {effect.signature.look_for}."]
    if seen is not None:
        parts += [f'<div class="plot">{_signature(seen)}{_over_time(seen)}</div>', _CAPTION.format(_drive(seen))]
    if effect.needs:
        names = ", ".join(f"`{name}`" for name in sorted(effect.needs))
        parts.append(f"It can be looked for only where these signals were recorded: {names}.")
    if uncommon and effect.id != "static_friction":
        parts.append("`close-loop` looks for this effect only where the common ones leave much that it explains.")
    elif not searched:
        parts.append("A model may list this effect, but `close-loop` does not look for it in every log.")
    parts += ["## What separates it from its neighbours", _neighbours(effect, seen)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _equation(effect: Effect) -> str:
    equations = "".join(symbolic_equations(effect))
    return f'<div class="equation">{equations}</div>' if equations else ""


_SYMBOLS = (
    "q: position, q̇: velocity, q̈: acceleration, q_d: commanded position, τ: load torque on the link's side, Δτ: torque"
    " that the effect takes, y: effort that the drive is given, y\\*: effort on which the drive acts, t: time,"
    " T: temperature, V: supply voltage."
)
_CAPTION = (
    "Simulated: the residual of a model with viscous and Coulomb friction that was fitted to a log of a {} with this"
    " effect. Blue: forward, orange: backward. The scale of the residual is arbitrary."
)


def _drive(seen: Trace) -> str:
    return seen.drive.replace("_", " ") + ("" if seen.drive == "position_servo" else " drive")


def _title(effect: Effect) -> str:
    title = effect.title[:1].upper() + effect.title[1:]
    same = [each for each in _listed() if each.title == effect.title]
    form = effect.form.rstrip("0123456789_").replace("_", " ")
    return f"{title} ({form})" if len(same) > 1 and effect.form else title


def _summary(effect: Effect) -> str:
    """The class's docstring, as it stands; its equations keep their lines."""
    lines = (type(effect).__doc__ or "").strip().splitlines()
    return "\n".join(line[4:] if line.startswith("    ") else line for line in lines)


def _parameters(effect: Effect) -> str:
    rows = []
    for each in effect.parameters:
        unit = each.unit.replace("*", "·") if each.unit != "-" else ""
        why = each.plausible.source if each.plausible else ""
        rows.append((f"`{each.name}`", each.description or "–", unit, why))
    return table(("parameter", "meaning", "unit", "what limits its value"), rows)


def _signature(seen: Trace) -> str:
    axis = seen.effect.signature.x
    cycles = seen.shape.get("cycles_per_turn", 0.0)
    if axis.startswith("position modulo") and cycles:
        period = 2.0 * np.pi / cycles
        x, label = np.mod(seen.signals.position, period), f"position modulo {period:.3g} rad"
    else:
        name = "position" if axis.startswith("position") else axis
        x, label = getattr(seen.signals, name), LABELS.get(name, name.replace("_", " "))
    y = _scaled(seen.torque)
    kept = _kept(x.size)
    forward = seen.signals.direction[kept] >= 0.0
    series = [
        Series(x[kept][forward], y[kept][forward], FORWARD),
        Series(x[kept][~forward], y[kept][~forward], BACKWARD),
    ]
    return plot("Residual against " + label.split(" [")[0], label, "residual", [s for s in series if s.x.size])


def _over_time(seen: Trace) -> str:
    half = slice(seen.signals.time.size // 2, None)
    time, y = seen.signals.time[half], _scaled(seen.torque)[half]
    speed = seen.signals.velocity[half] / np.abs(seen.signals.velocity).max()
    series = [
        Series(time[::3], speed[::3], "#bbbbbb", line=True, name="velocity, scaled"),
        Series(time[::3], y[::3], INK, line=True, name="residual"),
    ]
    return plot("Residual over time", "time [s]", "residual", series)


def _scaled(values: FloatArray) -> FloatArray:
    return np.asarray(values / np.abs(values).max())


def _kept(size: int) -> FloatArray:
    return np.random.default_rng(0).choice(size, min(size, DRAWN), replace=False)


def _neighbours(effect: Effect, seen: Trace | None) -> str:
    if effect.key in ALWAYS_FITTED:
        return "It is part of every declared model, and always fitted."
    parts = [f"**The experiment that shows it alone:** {isolating(effect.id)}."]
    found = _imitators(effect)
    if seen is None:
        parts.append("On one log, the drive gain and the friction, always fitted, explain all of its residual.")
    elif not found:
        parts.append("No other effect of the library explains half of the power of the residual in the plots above.")
    else:
        rows = [
            (_link(other), f"{100 * share:.0f} %", other.signature.look_for, isolating(other.id))
            for other, share in found
        ]
        parts.append(
            "Each of these effects alone explains the given share of the power of the residual in the plots above. A"
            " motion that excites both effects in different ways separates them. The experiment in the last column"
            " shows the neighbour alone."
        )
        parts.append(table(("neighbour", "explains", "it shows as", "experiment"), rows))
    return "\n\n".join(parts)
