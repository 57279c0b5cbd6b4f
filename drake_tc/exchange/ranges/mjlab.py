"""mjlab: a Python file with EVENTS, one domain randomisation term of `mjlab.envs.mdp.dr` for each term of a joint.

The terms are absolute (`operation="abs"`) and drawn once for each environment, at startup. mjlab hands the two numbers
of `ranges` to the `Distribution`; here they are the value and the deviation, and the limits belong to the distribution.
mjlab draws each term by itself. Where the terms of a joint are correlated the file says so, and the samples of
`--to parquet` keep the correlation.

Source: mjlab 1.6.0, `mjlab.envs.mdp.dr` and `mjlab.managers.event_manager`.
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from drake_tc.exchange.ranges.distribution import Distribution
from drake_tc.exchange.ranges.posterior import Posterior
from drake_tc.exchange.ranges.program import TermRanges, drawing, head, literal

OF_JOINTS: Mapping[str, str] = MappingProxyType(
    {
        "armature": "joint_armature",
        "damping": "joint_damping",
        "frictionloss": "joint_friction",
        "stiffness": "joint_stiffness",
    }
)
"""Term to the function of `dr` that takes `ranges`."""
NOTABLE = 0.3
"""Correlation from which a file says that its terms are drawn independently."""


def randomised(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that mjlab can randomise."""
    terms = each.projection.terms
    in_lugre = ("frictionloss",) if terms.torque_constant is not None and terms.stribeck is not None else ()
    servo = ("kp", "torque_limit") if terms.drive == "position_servo" else ()
    return (*(name for name in OF_JOINTS if name not in in_lugre), *servo)


def to_mjlab(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module whose EVENTS go into the events of an environment.

    Args:
        posterior: Of the parameters.
        ranges: Of each joint's terms.
    """
    terms = sorted({name for each in ranges for name in randomised(each)})
    entries = [line for each in ranges for name, of in each.distributions.items() for line in _entry(each, name, of)]
    return "\n".join(
        [
            *head("Domain randomisation for mjlab: events = {**events, **EVENTS}.", posterior, ranges, terms),
            "",
            "import math",
            "",
            "import torch",
            "from mjlab.envs.mdp import dr",
            "from mjlab.managers.event_manager import EventTermCfg",
            "from mjlab.managers.scene_entity_config import SceneEntityCfg",
            "",
            'ROBOT = "robot"  # name of the entity in the scene',
            "",
            "",
            *drawing("torch.special", "torch"),
            "",
            "",
            "def bounded(law, lower=-math.inf, upper=math.inf):",
            '    """A distribution of mjlab whose two numbers are value and deviation."""',
            "",
            "    def sample(value, deviation, shape, device):",
            "        if float(deviation) == 0.0:",
            "            return torch.full(shape, float(value), device=device)",
            "        share = torch.rand(shape, device=device).clamp(1e-6, 1.0 - 1e-6)",
            "        return quantile((law, float(value), float(deviation), lower, upper), share)",
            "",
            "    return dr.Distribution(law, sample)",
            "",
            "",
            "EVENTS = {",
            *correlated(ranges, terms),
            *entries,
            "}",
            "",
        ]
    )


def correlated(ranges: Sequence[TermRanges], terms: Sequence[str]) -> list[str]:
    """Comment lines on terms that are drawn independently although they are correlated.

    Args:
        ranges: Of each joint's terms.
        terms: That the file randomises.
    """
    out = []
    for each in ranges:
        names = list(each.distributions)
        for i, one in enumerate(names):
            for j, two in enumerate(names[:i]):
                r = float(each.correlation[i, j])
                if abs(r) >= NOTABLE and one in terms and two in terms:
                    out.append(f"    # {each.joint}: {two} and {one} have the correlation {r:.2f}; drawn independently")
    return out


def _entry(each: TermRanges, name: str, of: Distribution) -> list[str]:
    if name not in randomised(each):
        return []
    law = f'bounded("{of.law}", {literal(of.lower)}, {literal(of.upper)})'
    pair = f"({literal(of.value)}, {literal(of.deviation)})"
    pattern = repr(re.escape(each.joint))
    selects = "joint_names" if name in OF_JOINTS else "actuator_names"
    params = {
        "asset_cfg": f"SceneEntityCfg(ROBOT, {selects}=({pattern},))",
        "distribution": law,
        "operation": '"abs"',
    }
    if name == "kp":
        kd = each.projection.terms.derivative_gain
        params |= {"kp_range": pair, "kd_range": f"({literal(kd)}, 0.0)"}
    elif name == "torque_limit":
        params["effort_limit_range"] = pair
    else:
        params["ranges"] = pair
    function = {"kp": "pd_gains", "torque_limit": "effort_limits"}.get(name) or OF_JOINTS[name]
    return [
        f"    {f'{each.joint}_{name}'!r}: EventTermCfg(  # {each.unit(name)}",
        '        mode="startup",',
        f"        func=dr.{function},",
        "        params={",
        *(f'            "{key}": {value},' for key, value in params.items()),
        "        },",
        "    ),",
    ]
