"""Equations of the library as C: a function of numbers whose body is assignments and one `return` of expressions.

The equations of effects and drives stand once, in Python (`drake_tc.kernels.equations` and `torque_equations`). Their
syntax trees are written in C here, so that no equation stands twice.

The links of a robot with a fixed base, as numbers for inverse dynamics: what a joint moves, and where it stands.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.torque_equations import JointState
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import has_axis, is_revolute, joint_axes
from drake_tc.types import FloatArray

CALLS = {
    "abs": "fabs",
    "exp": "exp",
    "expm1": "expm1",
    "log": "log",
    "sin": "sin",
    "cos": "cos",
    "tanh": "tanh",
    "sqrt": "sqrt",
    "copysign": "copysign",
    "sign": "dtc_sign",
    "minimum": "dtc_min",
    "maximum": "dtc_max",
    "min": "dtc_min",
    "max": "dtc_max",
}
"""Function of NumPy, `math` or Python to its name in C."""
KEYWORDS = (
    "switch",
    "double",
    "int",
    "float",
    "default",
    "case",
    "register",
    "short",
    "long",
    "static",
    "auto",
    "const",
)
"""Names in Python that C keeps for itself; they get an underscore."""
OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
}


def number(value: float) -> str:
    """A double of C that reads back as the same number.

    Raises:
        ParamsError: NaN, which no model has.
    """
    if value != value:
        raise ParamsError("export --to c: expected numbers in the model, got NaN")
    if value in (float("inf"), float("-inf")):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    text = repr(float(value))
    return text if any(sign in text for sign in ".en") else f"{text}.0"


def c_function(function: Callable[..., Any], arrays: tuple[str, ...] = (), outputs: int = 0) -> str:
    """A static function of C with the name `dtc_NAME`, and `const double *` for the arguments that are arrays.

    Args:
        function: One of the library's equations.
        arrays: Arguments that are arrays of numbers.
        outputs: Length of the tuple that it returns, which goes to a last argument `double *out`; 0: it returns a
            number.

    Raises:
        ParamsError: an expression that has no counterpart in C.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise ParamsError(f"export --to c: expected a function, got {function!r}")
    names = [name for argument in tree.args.args for name in _numbers_of(argument)]
    given = [f"const double *{_name(name)}" if name in arrays else f"double {_name(name)}" for name in names]
    lines, used = [], {getattr(node, "id", getattr(node, "attr", "")) for node in ast.walk(tree)}
    lines += [f"    (void){_name(name)};" for name in names if name not in used]
    for statement in tree.body:
        lines += _statement(statement, function.__name__, function.__globals__)
    head = f"static {'void' if outputs else 'double'} dtc_{function.__name__}("
    return head + ", ".join(given + (["double *out"] if outputs else [])) + ")\n{\n" + "\n".join(lines) + "\n}\n"


def _numbers_of(argument: ast.arg) -> tuple[str, ...]:
    """The argument, or the parts of a joint's state in its place."""
    is_state = argument.annotation is not None and ast.unparse(argument.annotation) == JointState.__name__
    return JointState._fields if is_state else (argument.arg,)


def _name(name: str) -> str:
    return f"{name}_" if name in KEYWORDS else name


def _statement(node: ast.stmt, where: str, known: dict[str, Any]) -> list[str]:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return []
    if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        return [f"    const double {_name(ast.unparse(target))} = {_expression(node.value, where, known)};"]
    if isinstance(node, ast.Return) and isinstance(node.value, ast.Tuple):
        return [f"    out[{i}] = {_expression(each, where, known)};" for i, each in enumerate(node.value.elts)]
    if isinstance(node, ast.Return) and node.value is not None:
        return [f"    return {_expression(node.value, where, known)};"]
    raise ParamsError(f"export --to c: {where}: {ast.unparse(node)!r} has no counterpart in C")


def _expression(node: ast.expr, where: str, known: dict[str, Any]) -> str:
    """The expression in C."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return number(float(node.value))
    if isinstance(node, ast.Name):
        value = known.get(node.id)
        return number(float(value)) if isinstance(value, int | float) else _name(node.id)
    if isinstance(node, ast.Attribute) and node.attr in JointState._fields:
        return node.attr
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return ast.unparse(node)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return f"(-{_expression(node.operand, where, known)})"
    if isinstance(node, ast.BinOp):
        left, right = _expression(node.left, where, known), _expression(node.right, where, known)
        if isinstance(node.op, ast.Pow):
            return f"pow({left}, {right})"
        if type(node.op) in OPERATORS:
            return f"({left} {OPERATORS[type(node.op)]} {right})"
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
        sides = _expression(node.left, where, known), _expression(node.comparators[0], where, known)
        return f"(double)({sides[0]} {OPERATORS[type(node.ops[0])]} {sides[1]})"
    if isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
        if name in CALLS and not node.keywords:
            return f"{CALLS[name]}({', '.join(_expression(each, where, known) for each in node.args)})"
    raise ParamsError(f"export --to c: {where}: {ast.unparse(node)!r} has no counterpart in C")


@dataclass(frozen=True, eq=False)
class MovedLink:
    """The body that a joint moves, with all that is welded to it.

    Frames: F where the joint stands on the body before it, M on the moved body; they coincide at q = 0. P is the M of
    the joint before, the world for the first.

    Attributes:
        parent: Index of the joint before, -1 for the world; smaller than the joint's own.
        turns: Whether the joint is revolute.
        axis: (3,) in F and in M.
        rotation: (3, 3) R_PF.
        place: (3,) p_PF [m].
        mass: [kg].
        moment: (3,) mass times centre of mass, from Mo, in M [kg m].
        inertia: (3, 3) about Mo, in M [kg m^2].
    """

    parent: int
    turns: bool
    axis: FloatArray
    rotation: FloatArray
    place: FloatArray
    mass: float
    moment: FloatArray
    inertia: FloatArray


def moved_links(robot: Robot) -> tuple[list[MovedLink], FloatArray, list[int]]:
    """The links in an order in which each comes after that before it; gravity (3,) [m/s^2]; their joints' indices.

    The indices are those of `robot.joints`.

    Raises:
        ParamsError: a base that floats, or joints that are not the robot's or neither revolute nor prismatic.
    """
    if not robot.fixed_base:
        raise ParamsError(f"export --to c: {robot.source}: expected a fixed base; this robot's base floats")
    plant: Any = make_plant(robot, 0.0)
    if plant.num_velocities() != len(robot.joints):
        raise ParamsError(
            f"export --to c: {robot.source}: expected a robot whose {plant.num_velocities()} degrees of freedom are all"
            f" joints of the robot file, got {len(robot.joints)} joints"
        )
    joints = [plant.GetJointByName(name) for name in robot.joints]
    for joint in joints:
        if not has_axis(joint):
            raise ParamsError(f"export --to c: joint {joint.name()!r}: expected a revolute or prismatic joint")
    axes = joint_axes(plant, joints)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    carried = [{int(body.index()) for body in plant.GetBodiesWeldedTo(joint.child_body())} for joint in joints]
    order: list[int] = []
    while len(order) < len(joints):
        before = set().union(*(carried[i] for i in order), _world(plant))
        ready = [i for i in range(len(joints)) if i not in order and int(joints[i].parent_body().index()) in before]
        if not ready:
            raise ParamsError(f"export --to c: {robot.source}: a link is moved by a joint that the robot file lacks")
        order += ready
    links = [_link(plant, context, joints, carried, order, i, axes[i]) for i in order]
    return links, np.array(plant.gravity_field().gravity_vector()), order


def _world(plant: Any) -> set[int]:
    return {int(body.index()) for body in plant.GetBodiesWeldedTo(plant.world_body())}


def _link(
    plant: Any, context: Any, joints: list[Any], carried: list[set[int]], order: list[int], i: int, axis: FloatArray
) -> MovedLink:
    """One link at q = 0."""
    joint = joints[i]
    holder = int(joint.parent_body().index())
    before = next((k for k in order if holder in carried[k]), None)
    base = plant.world_frame() if before is None else joints[before].frame_on_child()
    pose = plant.CalcRelativeTransform(context, base, joint.frame_on_parent())
    indices = [body.index() for body in plant.GetBodiesWeldedTo(joint.child_body())]
    lump = plant.CalcSpatialInertia(context, joint.frame_on_child(), indices)
    mass = float(lump.get_mass())
    return MovedLink(
        parent=-1 if before is None else order.index(before),
        turns=is_revolute(joint),
        axis=axis,
        rotation=np.array(pose.rotation().matrix()),
        place=np.array(pose.translation()),
        mass=mass,
        moment=mass * np.array(lump.get_com()),
        inertia=np.array(lump.CalcRotationalInertia().CopyToFullMatrix3()),
    )
