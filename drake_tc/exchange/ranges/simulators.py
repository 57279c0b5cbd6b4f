"""mjlab: a Python file with EVENTS, one domain randomisation term of `mjlab.envs.mdp.dr` for each term of a joint.

The terms are absolute (`operation="abs"`) and drawn once for each environment, at startup. mjlab hands the two numbers
of `ranges` to the `Distribution`; here they are the value and the deviation, and the limits belong to the distribution.
mjlab draws each term by itself. Where the terms of a joint are correlated the file says so, and the samples of
`--to parquet` keep the correlation.

Source: mjlab 1.6.0, `mjlab.envs.mdp.dr` and `mjlab.managers.event_manager`.

Isaac Lab: a Python file with EVENTS, event terms for the fields of an ArticulationCfg's actuators.

`randomize_actuator_gains` draws the gain, `randomize_joint_parameters` the armature, both absolute and at startup, for
one joint at a time. Of distributions Isaac Lab has a normal one without limits, which is used where the limits are four
standard deviations away, and a log-uniform one, which otherwise gets the central 95 %. Isaac Lab 3.0.0 draws dry,
dynamic and viscous friction from one and the same pair of numbers, which fit one of them only: the file has a function
of its own, `set_joint_friction`, that draws dry and viscous friction apart.

Source: Isaac Lab 3.0.0, `isaaclab.envs.mdp.events` and `isaaclab.managers`.

MuJoCo Playground: a Python file with a function that makes the environment's `randomization_fn`.

`domain_randomizer(env.mj_model)` returns `domain_randomize(model, rng)`, which sets the fields of an `mjx.Model` for a
batch of keys and returns it with its `in_axes`, as the environments of Playground do. The terms of a joint are drawn
together, with their correlation (a Gaussian copula).

Source: MuJoCo Playground 0.2.0, `mujoco_playground._src.wrapper` and `locomotion/go1/randomize.py`.
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from drake_tc.exchange.ranges.posterior import Posterior
from drake_tc.exchange.ranges.program import TermRanges, as_tuple, drawing, head, literal
from drake_tc.exchange.ranges.unit import NEAR_ZERO, Distribution

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


def mjlab_terms(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that mjlab can randomise."""
    terms = each.projection.terms
    in_lugre = ("frictionloss",) if terms.torque_constant is not None and terms.stribeck is not None else ()
    servo = ("kp", "torque_limit") if terms.drive == "position_servo" else ()
    return (*(name for name in OF_JOINTS if name not in in_lugre), *servo)


def to_mjlab(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module whose EVENTS go into the events of an environment."""
    terms = sorted({name for each in ranges for name in mjlab_terms(each)})
    entries = [
        line for each in ranges for name, of in each.distributions.items() for line in _mjlab_entry(each, name, of)
    ]
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
    """Comment lines on terms that are drawn independently although they are correlated."""
    out = []
    for each in ranges:
        names = list(each.distributions)
        for i, one in enumerate(names):
            for j, two in enumerate(names[:i]):
                r = float(each.correlation[i, j])
                if abs(r) >= NOTABLE and one in terms and two in terms:
                    out.append(f"    # {each.joint}: {two} and {one} have the correlation {r:.2f}; drawn independently")
    return out


def _mjlab_entry(each: TermRanges, name: str, of: Distribution) -> list[str]:
    if name not in mjlab_terms(each):
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


FRICTION = ("frictionloss", "damping")


def isaaclab_terms(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that Isaac Lab can randomise."""
    return (*FRICTION, "armature", *(("kp",) if each.projection.terms.drive == "position_servo" else ()))


def to_isaaclab_events(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module whose EVENTS become the fields of an environment's events."""
    terms = sorted({name for each in ranges for name in isaaclab_terms(each)})
    entries = [line for each in ranges for line in _isaaclab_entries(each)]
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


def _isaaclab_entries(each: TermRanges) -> list[str]:
    found, can = each.distributions, isaaclab_terms(each)
    out = []
    friction = {
        name: as_tuple(found[term]) for name, term in (("dry", "frictionloss"), ("viscous", "damping")) if term in found
    }
    if friction:
        out += _isaaclab_entry(each, "friction", "set_joint_friction", friction)
    for term, function, parameter in (
        ("kp", "mdp.randomize_actuator_gains", "stiffness_distribution_params"),
        ("armature", "mdp.randomize_joint_parameters", "armature_distribution_params"),
    ):
        if term in found and term in can:
            pair, law = _of_isaaclab(found[term])
            out += _isaaclab_entry(
                each, term, function, {parameter: pair, "operation": '"abs"', "distribution": f'"{law}"'}
            )
    return out


def _of_isaaclab(of: Distribution) -> tuple[str, str]:
    """The two numbers and the name of the distribution in Isaac Lab."""
    room = min(of.value - of.lower, of.upper - of.value)
    if of.law == "normal" and room >= NEAR_ZERO * of.deviation:
        return f"({literal(of.value)}, {literal(of.deviation)})", "gaussian"
    low, high = of.interval
    law = "log_uniform" if of.law == "lognormal" else "uniform"
    return f"({literal(low)}, {literal(high)})", law


def _isaaclab_entry(each: TermRanges, name: str, function: str, params: dict[str, str]) -> list[str]:
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


OF_DOFS = {"armature": "dof_armature", "damping": "dof_damping", "frictionloss": "dof_frictionloss"}
"""Term to the field of the model, one number a degree of freedom."""
OTHERS = {
    "stiffness": ("jnt_stiffness",),
    "kp": ("actuator_gainprm", "actuator_biasprm"),
    "torque_limit": ("actuator_forcerange",),
}
"""Term to the other fields that it changes."""


def playground_terms(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that the file can randomise."""
    servo = ("kp", "torque_limit") if each.projection.terms.drive == "position_servo" else ()
    return (*OF_DOFS, "stiffness", *servo)


def to_playground(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module with `domain_randomizer`."""
    terms = sorted({name for each in ranges for name in playground_terms(each)})
    purpose = "Domain randomisation for MuJoCo Playground: randomization_fn = domain_randomizer(env.mj_model)."
    return "\n".join(
        [
            *head(purpose, posterior, ranges, terms),
            "",
            "import math",
            "",
            "import jax",
            "import jax.numpy as jp",
            "import mujoco",
            "",
            "# joint: {term: (law, value, deviation, lower, upper)}",
            "TERMS = {",
            *(line for each in ranges for line in _terms(each)),
            "}",
            "# joint: correlation of its terms, in their order",
            "CORRELATION = {",
            *(line for each in ranges for line in _correlation(each)),
            "}",
            f"OF_DOFS = {OF_DOFS!r}",
            "",
            "",
            *drawing("jax.scipy.special", "jp"),
            "",
            "",
            *_PROGRAM.format(fields=_fields(ranges)).strip("\n").splitlines(),
            "",
        ]
    )


def _fields(ranges: Sequence[TermRanges]) -> tuple[str, ...]:
    """Fields of the model that the file changes."""
    names = [list(each.distributions)[k] for each in ranges for k in _used(each)]
    return tuple(sorted({field for name in names for field in (OTHERS.get(name) or (OF_DOFS[name],))}))


def _used(each: TermRanges) -> list[int]:
    return [k for k, name in enumerate(each.distributions) if name in playground_terms(each)]


def _terms(each: TermRanges) -> list[str]:
    names = list(each.distributions)
    rows = [f'        "{names[k]}": {as_tuple(each.distributions[names[k]])},' for k in _used(each)]
    rows = [f"{row}  # {each.unit(names[k])}" for row, k in zip(rows, _used(each), strict=True)]
    return [f"    {each.joint!r}: {{", *rows, "    },"]


def _correlation(each: TermRanges) -> list[str]:
    used = _used(each)
    rows = [", ".join(literal(round(float(each.correlation[i, j]), 4)) for j in used) for i in used]
    return [f"    {each.joint!r}: [", *(f"        [{row}]," for row in rows), "    ],"]


_PROGRAM = '''
def drawn(joint, key):
    """One value of each term of a joint."""
    names = list(TERMS[joint])
    size, turn = jp.linalg.eigh(jp.array(CORRELATION[joint]))
    root = turn * jp.sqrt(jp.maximum(size, 0.0))
    root = root / jp.linalg.norm(root, axis=1, keepdims=True)
    share = jax.scipy.special.ndtr(root @ jax.random.normal(key, (len(names),)))
    return {{name: quantile(TERMS[joint][name], share[k]) for k, name in enumerate(names)}}


def domain_randomizer(mj_model):
    """A function (model, rng) -> (model, in_axes) for the joints of TERMS in this mujoco.MjModel."""
    for joint in TERMS:
        if mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_JOINT, joint) < 0:
            raise ValueError(f"the model has no joint {{joint!r}}")
        if mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_ACTUATOR, joint + "_friction") >= 0:
            raise ValueError(f"{{joint!r}} has its friction in an actuator; export the model with --to playground")

    def actuator(joint):
        number = mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        of_joint = (mj_model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (mj_model.actuator_trnid[:, 0] == number)
        found = [int(k) for k in of_joint.nonzero()[0]]
        if len(found) != 1:
            raise ValueError(f"expected one actuator of the joint {{joint!r}}, found {{len(found)}}")
        return found[0]

    def domain_randomize(model, rng):
        @jax.vmap
        def fields_of(rng):
            fields = {{name: getattr(model, name) for name in {fields}}}
            for key, joint in zip(jax.random.split(rng, len(TERMS)), TERMS):
                dof = int(mj_model.joint(joint).dofadr[0])
                for name, value in drawn(joint, key).items():
                    if name in OF_DOFS:
                        fields[OF_DOFS[name]] = fields[OF_DOFS[name]].at[dof].set(value)
                    elif name == "stiffness":
                        number = int(mj_model.joint(joint).id)
                        fields["jnt_stiffness"] = fields["jnt_stiffness"].at[number].set(value)
                    elif name == "kp":
                        k = actuator(joint)
                        fields["actuator_gainprm"] = fields["actuator_gainprm"].at[k, 0].set(value)
                        fields["actuator_biasprm"] = fields["actuator_biasprm"].at[k, 1].set(-value)
                    elif name == "torque_limit":
                        limits = jp.stack([-value, value])
                        fields["actuator_forcerange"] = fields["actuator_forcerange"].at[actuator(joint)].set(limits)
            return fields

        fields = fields_of(rng)
        in_axes = jax.tree_util.tree_map(lambda x: None, model)
        in_axes = in_axes.tree_replace(dict.fromkeys(fields, 0))
        return model.tree_replace(fields), in_axes

    return domain_randomize
'''
