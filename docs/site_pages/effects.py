"""A page for each effect: equation, parameters, its plot, what it looks like in a log, and its neighbours."""

import numpy as np

from drake_tc.config.page import table
from drake_tc.effects.base import Effect
from drake_tc.effects.library import BUILT_IN, LIBRARY, UNCOMMON
from drake_tc.report.equation import symbolic_equations
from drake_tc.types import FloatArray
from site_pages import traces
from site_pages.plots import BACKWARD, FORWARD, INK, Series, plot
from site_pages.traces import Trace

SHOWN, DRAWN = 0.5, 600
"""Least share of a neighbour's imitation that is listed; points that are drawn."""
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
KINDS = {
    "friction": "Friction",
    "load": "Load",
    "drive": "Drive",
    "transmission": "Transmission",
    "sensor": "Sensor",
}


def pages() -> dict[str, str]:
    """Page to its text."""
    return {"effects/index.md": _overview()} | {f"effects/{effect.key}.md": _page(effect) for effect in _listed()}


def _listed() -> list[Effect]:
    """Every effect, one of each family of forms that differ in their number of levels alone."""
    families: dict[tuple[str, str], Effect] = {}
    for effect in BUILT_IN:
        families.setdefault((effect.id, effect.form.rstrip("0123456789_")), effect)
    return list(families.values())


def _overview() -> str:
    parts = [_HEAD]
    for kind, title in KINDS.items():
        rows = [
            (f"[{_title(effect)}]({effect.key}.md)", f"`{effect.key}`", effect.signature.look_for)
            for effect in _listed()
            if effect.kind == kind
        ]
        parts += [f"## {title}", table(("effect", "id", "what to look for in the residual"), rows)]
    return "\n\n".join(parts) + "\n"


_HEAD = """# Effects

An effect is one physical cause between the command of a drive and the motion of its joint. Its equation serves the
fit, the simulation, the compensation and the plot of the report. All effects add to one balance of torques,

    y*/K = τ + J q̈ + Σ Δτ

with the effort y that the drive was given, the effort y\\* on which it acted, the drive gain K, the load torque τ
on the link's side of the gear, and the inertia J of the rotor, reflected to that side."""


def _page(effect: Effect) -> str:
    searched, uncommon = (any(effect.key == each.key for each in among) for among in (LIBRARY, UNCOMMON))
    seen = traces.trace(effect)
    parts = [f"# {_title(effect)}", f"`{effect.key}` · {KINDS[effect.kind].lower()}", _summary(effect)]
    if effect.equation:
        parts += ["## Equation", f'<div class="equation">{"".join(symbolic_equations(effect))}</div>', _SYMBOLS]
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
    parts = []
    if effect.isolated_by:
        parts.append(f"**The experiment that shows it alone:** {effect.isolated_by}.")
    found = traces.neighbours(seen, LIBRARY, SHOWN, 6) if seen is not None else []
    found = [(other, share) for other, share in found if other.key not in ("viscous", "coulomb")]
    if effect.key in ("viscous", "coulomb"):
        parts.append("It is part of every declared model, and always fitted.")
        return "\n\n".join(parts)
    if seen is None:
        parts.append("On one log, the drive gain and the friction, always fitted, explain all of its residual.")
        return "\n\n".join(parts)
    if not found:
        parts.append("No other effect of the library explains half of the power of the residual in the plots above.")
        return "\n\n".join(parts)
    rows = [
        (
            f"[{_title(other)}]({other.key}.md)",
            f"{100 * share:.0f} %",
            other.signature.look_for,
            other.isolated_by or "–",
        )
        for other, share in found
    ]
    parts.append(
        "Each of these effects alone explains the given share of the power of the residual in the plots above. A motion"
        " that excites both effects in different ways separates them. The experiment in the last column shows the"
        " neighbour alone."
    )
    parts.append(table(("neighbour", "explains", "it shows as", "experiment"), rows))
    return "\n\n".join(parts)
