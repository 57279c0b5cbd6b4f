"""MuJoCo Playground: a Python file with a function that makes the environment's `randomization_fn`.

`domain_randomizer(env.mj_model)` returns `domain_randomize(model, rng)`, which sets the fields of an `mjx.Model` for a
batch of keys and returns it with its `in_axes`, as the environments of Playground do. The terms of a joint are drawn
together, with their correlation (a Gaussian copula).

Source: MuJoCo Playground 0.2.0, `mujoco_playground._src.wrapper` and `locomotion/go1/randomize.py`.
"""

from collections.abc import Sequence

from drake_tc.exchange.ranges.posterior import Posterior
from drake_tc.exchange.ranges.program import TermRanges, as_tuple, drawing, head, literal

OF_DOFS = {"armature": "dof_armature", "damping": "dof_damping", "frictionloss": "dof_frictionloss"}
"""Term to the field of the model, one number a degree of freedom."""
OTHERS = {
    "stiffness": ("jnt_stiffness",),
    "kp": ("actuator_gainprm", "actuator_biasprm"),
    "torque_limit": ("actuator_forcerange",),
}
"""Term to the other fields that it changes."""


def randomised(each: TermRanges) -> tuple[str, ...]:
    """Terms of a joint that the file can randomise."""
    servo = ("kp", "torque_limit") if each.projection.terms.drive == "position_servo" else ()
    return (*OF_DOFS, "stiffness", *servo)


def to_playground(posterior: Posterior, ranges: Sequence[TermRanges]) -> str:
    """The text of a Python module with `domain_randomizer`.

    Args:
        posterior: Of the parameters.
        ranges: Of each joint's terms.
    """
    terms = sorted({name for each in ranges for name in randomised(each)})
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
    return [k for k, name in enumerate(each.distributions) if name in randomised(each)]


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
