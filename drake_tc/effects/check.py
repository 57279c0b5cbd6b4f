"""What an effect of another package must have, and whether the fitted values of an effect are possible on a rig."""

import ast
import math
from collections.abc import Iterator, Mapping

import numpy as np

from drake_tc.effects.base import Effect, Signals, plain_signals
from drake_tc.effects.context import Context, Parameter, Plausible, Scale
from drake_tc.errors import ParamsError

SAMPLES = 5
"""Of the signals on which `columns` is tried."""
EQUATION_SIGNALS = frozenset(
    {
        *("q", "qdot", "qddot", "q_d", "q_meas", "q_motor", "tau", "tau_add", "tau_meas", "y", "y_eff"),
        *("K", "J", "t", "T", "T_25", "V", "w", "r", "z"),
    }
)
"""Names that `Effect.equation` may have beside its parameters (`drake_tc.report.equation` writes them)."""
EQUATION_FUNCTIONS = ("sign", "exp", "sin", "cos", "max", "min", "spline")
_OPERATORS = ("ddt", "ddq", "integral", "total", "abs")
_NEEDED = ("id", "title", "kind", "signature")


def checked_effect(name: str, given: object) -> Effect:
    """An effect, from an instance or a class, whose columns have the right shape.

    Args:
        name: The `id` or the `key` under which it is registered.
        given: An `Effect` or a subclass that is made without arguments.

    Raises:
        ParamsError: it is no effect, lacks an attribute, or its columns are not (T, coefficients) finite numbers.
    """
    effect = _instance(name, given)
    for attribute in _NEEDED:
        if not hasattr(effect, attribute):
            raise ParamsError(f"effect {name!r}: class {type(effect).__name__} has no attribute {attribute!r}")
    if name not in (effect.id, effect.key):
        raise ParamsError(f"effect {name!r}: it is registered under this name, but its key is {effect.key!r}")
    names = [p.name for p in (*effect.coefficients, *effect.shapes, *effect.given_shapes)]
    if len(set(names)) < len(names):
        raise ParamsError(f"effect {name!r}: expected different names of parameters, got {', '.join(names)}")
    _check_columns(name, effect)
    _check_equation(name, effect)
    return effect


def _check_equation(name: str, effect: Effect) -> None:
    """`equation` is what a report can write: Python expressions in the names of parameters and signals."""
    parameters = (*effect.parameters, *effect.coefficients, *effect.shapes, *effect.given_shapes)
    known = EQUATION_SIGNALS | {parameter.name for parameter in parameters}
    where = f"effect {name!r}: equation {effect.equation!r}"
    if not isinstance(effect.equation, str):
        raise ParamsError(f"{where}: expected text")
    parts = [part.split(" = ") for part in effect.equation.split(";") if effect.equation]
    if any(len(sides) < 2 for sides in parts):
        raise ParamsError(f"{where}: expected expressions on both sides of ' = '")
    for side in (side for sides in parts for side in sides):
        try:
            tree = ast.parse(side.strip(), mode="eval").body
        except (SyntaxError, ValueError):
            raise ParamsError(f"{where}: expected Python expressions on both sides of ' = ', got {side!r}") from None
        for what in _strange(tree, known):
            raise ParamsError(f"{where}: {what}; possible: {', '.join(sorted(known))}")


def _strange(node: ast.expr, known: frozenset[str]) -> Iterator[str]:
    """What a report cannot write of an expression."""
    if isinstance(node, ast.Name):
        if node.id not in known:
            yield f"no parameter or signal {node.id!r}"
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id not in (*EQUATION_FUNCTIONS, *_OPERATORS, *known):
            yield f"no function {node.func.id!r}"
        for argument in node.args[:3] if node.func.id == "spline" else node.args:  # then all levels at once
            yield from _strange(argument, known)
    elif isinstance(node, ast.UnaryOp | ast.BinOp | ast.IfExp | ast.Compare):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                yield from _strange(child, known)
    elif not isinstance(node, ast.Constant):
        yield f"no such thing as {ast.unparse(node)!r} in an equation"


def _instance(name: str, given: object) -> Effect:
    try:
        made = given() if isinstance(given, type) else given
    except TypeError as error:
        raise ParamsError(f"effect {name!r}: its class cannot be made without arguments: {error}") from None
    if not isinstance(made, Effect):
        raise ParamsError(f"effect {name!r}: expected an instance or a subclass of Effect, got {given!r}")
    return made


def _check_columns(name: str, effect: Effect) -> None:
    shape = {p.name: _inside(p) for p in (*effect.shapes, *effect.given_shapes)}
    try:
        columns = np.asarray(effect.columns(_trial_signals(), shape))
    except Exception as error:
        raise ParamsError(f"effect {name!r}: columns failed on a trial: {type(error).__name__}: {error}") from error
    expected = (SAMPLES, len(effect.coefficients))
    if columns.shape != expected:
        raise ParamsError(
            f"effect {name!r}: columns must have one row a sample and one column a coefficient; expected shape"
            f" {expected} for {SAMPLES} samples, got {columns.shape}"
        )
    if not np.isfinite(columns).all():
        raise ParamsError(f"effect {name!r}: columns are not finite on a trial with parameters {shape}")


def _inside(parameter: Parameter) -> float:
    """The default, moved within the bounds."""
    return float(min(max(parameter.default, parameter.lower), parameter.upper))


def _trial_signals() -> Signals:
    """A joint that moves back and forth under a load."""
    time = np.linspace(0.0, 1.0, SAMPLES)
    wave = np.sin(6.0 * time + 0.5)
    known = ("position", "velocity", "acceleration", "load_torque", "expected_torque", "slow_torque", "effort")
    more = ("command", "motor_position", "load_slope", "known_torque")
    return plain_signals(
        SAMPLES,
        dict.fromkeys((*known, *more), wave)
        | {"time": time, "direction": np.sign(wave), "travel": np.abs(wave), "temperature": np.full(SAMPLES, 40.0)}
        | {"supply_voltage": np.full(SAMPLES, 24.0)},
    )


FRICTION: Mapping[Scale, str] = {"coulomb": "Coulomb", "viscous": "viscous"}
"""Quantities that limit a parameter and that a fit may make 0."""
ROUNDING = 1e-9
"""A value may pass a limit by this share of it: a fit that rests on a bound meets it up to rounding."""


def plausible_range(parameter: Parameter, context: Context) -> tuple[float, float]:
    """(lower, upper) of a parameter on this rig, in its own unit; infinite where nothing known limits it."""
    if parameter.plausible is None:
        return -math.inf, math.inf
    plausible = parameter.plausible.on(context.joint_type)
    scale = context.scale(plausible.scale)
    lower, upper = plausible.lower, plausible.upper
    low, high = (0.0 if 0.0 in (x, scale) else x * scale for x in (lower, upper))  # 0 times infinity, and no -0
    return low, high


def implausible(effect: Effect, parameters: Mapping[str, float], context: Context) -> str:
    """Why an effect with these values cannot be the cause, or "" when it can.

    An effect whose sizes are all 0 explains something else, as by the noise of a channel that it differentiates. Each
    parameter is held against its `Parameter.plausible`, scaled by what the logs span, and then all of them
    against what the effect says of them together (`Effect.inconsistency`). A range that depends on something that
    `context` does not know (`torque_span`, `duration`, `fitted`) is infinite.

    Args:
        effect: The effect.
        parameters: Reported values by name, one for each of the effect's parameters.
        context: What the training logs span, with the fitted gain, viscous and Coulomb friction where they are known.

    Returns:
        One sentence with the value, the range and its source; empty when the values are possible.
    """
    sizes = [p.name for p in effect.parameters if p not in (*effect.shapes, *effect.given_shapes)]
    if sizes and all(parameters[name] == 0.0 for name in sizes):
        names, verb = " and ".join(sizes), "is" if len(sizes) == 1 else "are"
        return (
            f"{names} of {effect.title} {verb} 0 in the fit that chose this effect: the lower error has another cause."
        )
    for parameter in effect.parameters:
        if parameter.plausible is None:
            continue
        value = parameters[parameter.name]
        unit = context.units.of(parameter.unit)
        unit = "" if unit == "-" else f" {unit}"
        if not math.isfinite(value):
            return f"{parameter.name} of {effect.title} is {value}, which is not a finite number."
        low, high = plausible_range(parameter, context)
        if not low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high):
            possible = _allowed(parameter.plausible.on(context.joint_type), low, high, unit)
            return f"{parameter.name} is {value:.3g}{unit}; {possible}."
    return context.units.text(effect.inconsistency(parameters, context))


def _allowed(plausible: Plausible, low: float, high: float, unit: str) -> str:
    """What is possible, and why; a range that a quantity of the rig has shrunk to nothing names that quantity."""
    if low == high == 0.0 and plausible.scale in FRICTION:
        limit = f"the fitted {FRICTION[plausible.scale]} friction, which limits it, is 0"
    elif math.isfinite(high):
        limit = f"its plausible range is {low:.3g} to {high:.3g}{unit}"
    else:
        limit = f"its plausible range is {low:.3g}{unit} or more"
    return f"{limit}: {plausible.source}"
