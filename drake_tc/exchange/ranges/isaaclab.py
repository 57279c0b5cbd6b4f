"""Isaac Lab: a Python file with EVENTS, event terms for the fields of an ArticulationCfg's actuators.

`randomize_actuator_gains` draws the gain, `randomize_joint_parameters` the armature, both absolute and at startup, for
one joint at a time. Of distributions Isaac Lab has a normal one without limits, which is used where the limits are four
standard deviations away, and a log-uniform one, which otherwise gets the central 95 %. Isaac Lab 3.0.0 draws dry,
dynamic and viscous friction from one and the same pair of numbers, which fit one of them only: the file has a function
of its own, `set_joint_friction`, that draws dry and viscous friction apart.

Source: Isaac Lab 3.0.0, `isaaclab.envs.mdp.events` and `isaaclab.managers`.
"""

import re
from collections.abc import Sequence

from drake_tc.exchange.ranges.distribution import NEAR_ZERO, Distribution
from drake_tc.exchange.ranges.mjlab import correlated
from drake_tc.exchange.ranges.posterior import Posterior
from drake_tc.exchange.ranges.program import TermRanges, as_tuple, drawing, head, literal

FRICTION = ("frictionloss", "damping")


def randomised(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that Isaac Lab can randomise."""
    return (*FRICTION, "armature", *(("kp",) if each.projection.terms.drive == "position_servo" else ()))


def to_isaaclab_events(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module whose EVENTS become the fields of an environment's events.

    Args:
        posterior: Of the parameters.
        ranges: Of each joint's terms.
    """
    terms = sorted({name for each in ranges for name in randomised(each)})
    entries = [line for each in ranges for line in _entries(each)]
    return "\n".join(
        [
            *head("Domain randomisation for Isaac Lab: EVENTS, by name.", posterior, ranges, terms),
            "",
            "import math",
            "",
            "import torch",
            "from isaaclab.envs import mdp",
            "from isaaclab.managers import EventTermCfg, SceneEntityCfg",
            "",
            'ROBOT = "robot"  # name of the articulation in the scene',
            "",
            "",
            *drawing("torch.special", "torch"),
            "",
            "",
            "def set_joint_friction(env, env_ids, asset_cfg, dry=None, viscous=None):",
            '    """Draw dry [N m] and viscous friction [N m s/rad] of one joint; what is None stays."""',
            "    asset = env.scene[asset_cfg.name]",
            "    if env_ids is None or isinstance(env_ids, slice):",
            "        chosen = slice(None) if env_ids is None else env_ids",
            "        env_ids = torch.arange(env.num_envs, device=asset.device)[chosen]",
            "    joints = torch.arange(asset.num_joints, device=asset.device)[asset_cfg.joint_ids]",
            "    shape = (len(env_ids), len(joints))",
            "",
            "    def drawn(of, now):",
            "        if of is None:",
            "            return now.torch[env_ids[:, None], joints]",
            "        return quantile(of, torch.rand(shape, device=asset.device).clamp(1e-6, 1.0 - 1e-6))",
            "",
            "    friction = drawn(dry, asset.data.joint_friction_coeff)",
            '    dynamic = friction if hasattr(asset.data, "joint_dynamic_friction_coeff") else None',
            "    asset.write_joint_friction_coefficient_to_sim_index(",
            "        joint_friction_coeff=friction,",
            "        joint_dynamic_friction_coeff=dynamic,",
            "        joint_viscous_friction_coeff=drawn(viscous, asset.data.joint_viscous_friction_coeff),",
            "        joint_ids=joints,",
            "        env_ids=env_ids,",
            "    )",
            "",
            "",
            "EVENTS = {",
            *correlated(ranges, terms),
            *entries,
            "}",
            "",
        ]
    )


def _entries(each: TermRanges) -> list[str]:
    found, can = each.distributions, randomised(each)
    out = []
    friction = {
        name: as_tuple(found[term]) for name, term in (("dry", "frictionloss"), ("viscous", "damping")) if term in found
    }
    if friction:
        out += _entry(each, "friction", "set_joint_friction", friction)
    for term, function, parameter in (
        ("kp", "mdp.randomize_actuator_gains", "stiffness_distribution_params"),
        ("armature", "mdp.randomize_joint_parameters", "armature_distribution_params"),
    ):
        if term in found and term in can:
            pair, law = _of_isaaclab(found[term])
            out += _entry(each, term, function, {parameter: pair, "operation": '"abs"', "distribution": f'"{law}"'})
    return out


def _of_isaaclab(of: Distribution) -> tuple[str, str]:
    """The two numbers and the name of the distribution in Isaac Lab."""
    room = min(of.value - of.lower, of.upper - of.value)
    if of.law == "normal" and room >= NEAR_ZERO * of.deviation:
        return f"({literal(of.value)}, {literal(of.deviation)})", "gaussian"
    low, high = of.interval
    law = "log_uniform" if of.law == "lognormal" else "uniform"
    return f"({literal(low)}, {literal(high)})", law


def _entry(each: TermRanges, name: str, function: str, params: dict[str, str]) -> list[str]:
    pattern = repr(re.escape(each.joint))
    return [
        f"    {f'{each.joint}_{name}'!r}: EventTermCfg(",
        f"        func={function},",
        '        mode="startup",',
        "        params={",
        f'            "asset_cfg": SceneEntityCfg(ROBOT, joint_names=[{pattern}]),',
        *(f'            "{key}": {value},' for key, value in params.items()),
        "        },",
        "    ),",
    ]
