"""The numbers of a `JointLoop` by name, and those that stand for others: K6, K7 and the friction's over-estimate.

K6 = Ks K_tau' (1 + Kp) [-], K7 = Kd K_tau' (1 + Kp) [s], friction = K_v'/K_v [-].
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from drake_tc.analysis.joint_loop import JointLoop
from drake_tc.errors import ParamsError

WHOLE = ("window", "order", "extra_delay", "inertial_order")
EQUIVALENT = ("k6", "k7", "friction")
"""Beside the fields of JointLoop: K6 [-] and K7 [s] in place of Ks and Kd, and `friction` = K_v'/K_v [-]."""


def parameters() -> tuple[str, ...]:
    """The numbers of a JointLoop, and EQUIVALENT."""
    texts = ("gravity_at", "velocity_from")
    return tuple(field.name for field in fields(JointLoop) if field.name not in texts) + EQUIVALENT


def value_of(loop: JointLoop, name: str) -> float:
    """The loop's own value of a parameter; NaN for `at` mid-window."""
    per = loop.k_tau_model * (1.0 + loop.kp)
    if name == "k6":
        return loop.ks * per
    if name == "k7":
        return loop.kd * per
    if name == "friction":
        return loop.k_v_model / loop.k_v if loop.k_v else np.nan
    value = getattr(loop, name)
    return np.nan if value is None else float(value)


def with_values(loop: JointLoop, values: Mapping[str, float]) -> JointLoop:
    """The loop with other values; K6 and K7 stay what they are unless Ks, Kd, or they themselves are given.

    Raises:
        ParamsError: a value that is not possible.
    """
    plain: dict[str, Any] = {name: value for name, value in values.items() if name not in EQUIVALENT}
    for name in WHOLE:
        if name in plain:
            if plain[name] != round(plain[name]):
                raise ParamsError(f"JointLoop.{name}: expected a whole number, got {plain[name]:g}")
            plain[name] = round(plain[name])
    if "friction" in values:
        plain["k_v_model"] = values["friction"] * loop.k_v
    changed = replace(loop, **plain)
    per = changed.k_tau_model * (1.0 + changed.kp)
    kept = {name: values.get(name, value_of(loop, name)) for name in ("k6", "k7")}
    ks = changed.ks if "ks" in plain else kept["k6"] / per
    kd = changed.kd if "kd" in plain else kept["k7"] / per
    return replace(changed, ks=ks, kd=kd)
