"""What an effect of another package must have, checked once when it is first used."""

import numpy as np

from drake_tc.effects.base import Effect, Signals, plain_signals
from drake_tc.effects.parameter import Parameter
from drake_tc.errors import ParamsError

SAMPLES = 5
"""Of the signals on which `columns` is tried."""
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
    return effect


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
