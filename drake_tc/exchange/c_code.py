"""Torque control as one C99 file and its header, without dependencies, allocation or state of its own.

The equations of effects and drives stand once, in Python (`drake_tc.kernels.equations` and `torque_equations`). Their
syntax trees are written in C here: a function is assignments and one `return` of expressions of numbers. The drives'
tables are those of the `Compensator`, the links those of the plant; the rest stands in the two templates beside this
file.
"""

import ast
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from drake_tc.actuation.compensator import Compensator
from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.guard import GuardLaw, GuardSpec, rated_guard
from drake_tc.control.torque_law import CompensationSpec
from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import LARGEST
from drake_tc.filtering.savitzky_golay import delay, savgol_weights
from drake_tc.kernels import equations as scalar
from drake_tc.kernels import torque_equations as at
from drake_tc.kernels.guard import COMPLETE, UNTRUSTED
from drake_tc.kernels.guard import LARGEST as MOST
from drake_tc.kernels.joint_layout import DEAD_ZONE, TERM_END, TERM_FIRST, TERM_KIND
from drake_tc.kernels.torque_equations import EQUATIONS, REFERENCE_CELSIUS, JointState
from drake_tc.robot.plant import has_axis, is_revolute, joint_axes, joint_limits, make_plant
from drake_tc.robot.robot import Robot
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
    *("switch", "double", "int", "float", "default", "case", "register", "short", "long", "static", "auto", "const"),
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
class _MovedLink:
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


def _moved_links(robot: Robot) -> tuple[list[_MovedLink], FloatArray, list[int]]:
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
    world = {int(body.index()) for body in plant.GetBodiesWeldedTo(plant.world_body())}
    order: list[int] = []
    while len(order) < len(joints):
        before = set().union(*(carried[i] for i in order), world)
        ready = [i for i in range(len(joints)) if i not in order and int(joints[i].parent_body().index()) in before]
        if not ready:
            raise ParamsError(f"export --to c: {robot.source}: a link is moved by a joint that the robot file lacks")
        order += ready
    links = []
    for i in order:
        joint, holder = joints[i], int(joints[i].parent_body().index())
        inner = next((k for k in order if holder in carried[k]), None)
        base = plant.world_frame() if inner is None else joints[inner].frame_on_child()
        pose = plant.CalcRelativeTransform(context, base, joint.frame_on_parent())
        indices = [body.index() for body in plant.GetBodiesWeldedTo(joint.child_body())]
        lump = plant.CalcSpatialInertia(context, joint.frame_on_child(), indices)
        link = _MovedLink(
            parent=-1 if inner is None else order.index(inner),
            turns=is_revolute(joint),
            axis=axes[i],
            rotation=np.array(pose.rotation().matrix()),
            place=np.array(pose.translation()),
            mass=float(lump.get_mass()),
            moment=float(lump.get_mass()) * np.array(lump.get_com()),
            inertia=np.array(lump.CalcRotationalInertia().CopyToFullMatrix3()),
        )
        links.append(link)
    return links, np.array(plant.gravity_field().gravity_vector()), order


HERE = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class CSpec:
    """What the C file computes beside the drives' models.

    Attributes:
        name: Of the files, and before the name of each function.
        dt: Period of every call [s].
        window: Samples of the filter of positions.
        order: Of its polynomial.
        kp: Torque feedback Kp [-].
        ki: Integral of the torque error [1/s].
        residual_gain: K of the external torques [1/s].
        compensation: Motion for which the effects of the drives are compensated.
        guard: Limits and times of the guard. None: those of `GuardSpec`. Where it has no offset limit, a robot's rated
            torques give it; drives other than position servos have no guard without either.

    Raises:
        ParamsError: a name that is no identifier of C, or a number that is not possible.

    Example:
        >>> CSpec(name="arm", kp=2.0).window
        80
    """

    name: str = "torque_control"
    dt: float = 1e-3
    window: int = 80
    order: int = 2
    kp: float = 0.0
    ki: float = 0.0
    residual_gain: float = 30.0
    compensation: CompensationSpec = field(default_factory=CompensationSpec)
    guard: GuardSpec | None = None

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise ParamsError(f"name: expected an identifier of C in small letters, got {self.name!r}")
        for name in ("dt", "residual_gain"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ParamsError(f"{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in ("kp", "ki"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ParamsError(f"{name}: expected a number >= 0, got {getattr(self, name)!r}")


@dataclass(frozen=True)
class CFiles:
    """The two files.

    Attributes:
        name: Without ending.
        header: Text of `name`.h.
        source: Text of `name`.c.
    """

    name: str
    header: str
    source: str

    def write(self, folder: Path) -> list[Path]:
        """Write both; the folder must exist."""
        paths = [folder / f"{self.name}.h", folder / f"{self.name}.c"]
        for path, text in zip(paths, (self.header, self.source), strict=True):
            path.write_text(text, encoding="utf-8")
        return paths


def to_c(models: Models, robot: Robot | None = None, spec: CSpec | None = None) -> CFiles:
    """The C file of the torque control of joints, and its header.

    Args:
        models: One a joint, by joint or in order.
        robot: With a fixed base and these joints: adds inverse dynamics, gravity and external torques, and limits
            torques to the joints' efforts. None: the drives alone, without limits.
        spec: Period, filter, gains; None: the defaults.

    Raises:
        ParamsError: a drive with an effect of the user's own that has no compiled equation, or a robot that has no
            fixed base.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> files = to_c(load_models(robot.actuators), robot)
        >>> "torque_control_gravity" in files.header
        True
    """
    from drake_tc import __version__

    spec = CSpec() if spec is None else spec
    drives = model_list(models, None if robot is None else robot.joints)
    n, compensation = len(drives), spec.compensation
    compensator = Compensator(drives, compensation.direction_speed, compensation.smoothing)
    if compensator.interpreted:
        joint = compensator.joints[compensator.interpreted[0]]
        raise ParamsError(f"export --to c: joint {joint!r} has an effect without compiled equation")
    laws, kinds = _laws(compensator)
    links, gravity, order = ([], np.zeros(3), []) if robot is None else _moved_links(robot)
    given = {"estimate": "motion", "reference": "reference", "none": ""}
    values: dict[str, Any] = {
        "name": spec.name,
        "upper": spec.name.upper(),
        "guard": f"{spec.name.upper()}_H",
        "version": __version__,
        "joints": compensator.joints,
        "window": spec.window,
        "dt": spec.dt,
        "delay": delay(spec.window, spec.dt),
        "weights": [savgol_weights(spec.window, spec.order, None, d, spec.dt) for d in range(3)],
        "equations": _equations(laws, kinds),
        "laws": laws,
        "kp": [spec.kp] * n,
        "ki": [spec.ki] * n,
        "limit": [math.inf] * n if robot is None else joint_limits(robot).effort,
        "servo": [float(model.drive.kind == "position_servo") for model in drives],
        "velocity": given[compensation.velocity],
        "direction": given[compensation.direction],
        "acceleration": given[compensation.acceleration],
        "per_speed": 1.0 / compensation.direction_speed,
        "celsius": REFERENCE_CELSIUS,
        "links": links,
        "gravity": gravity,
        "order": order,
        "blend": -math.expm1(-spec.residual_gain * spec.dt),
        "residual_gain": spec.residual_gain,
        "largest": LARGEST,
        "limits": _guard(drives, robot, spec),
        "num": number,
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)
    environment.filters["nums"] = lambda values: ", ".join(number(float(value)) for value in np.ravel(values))
    header, source = (
        environment.from_string((HERE / f"torque_control.{ending}.jinja").read_text(encoding="utf-8")).render(values)
        for ending in ("h", "c")
    )
    return CFiles(spec.name, header, source)


def _guard(drives: Sequence[ActuatorModel], robot: Robot | None, spec: CSpec) -> dict[str, Any] | None:
    """Numbers of the guard; None where nothing limits a drive that is no position servo."""
    guard, n = spec.guard or GuardSpec(), len(drives)
    servo = tuple(model.drive.kind == "position_servo" for model in drives)
    bounds = None if robot is None else joint_limits(robot)
    if bounds is not None:
        guard = rated_guard(guard, drives, bounds.effort, bounds.velocity)
    if guard.offset_limit is None and not all(servo):
        return None
    offset, step, start_step, _ = GuardLaw(n, spec.dt, guard, servo).limits
    none = np.full(n, np.inf)
    return {
        "offset": offset,
        "step": step,
        "start_step": start_step,
        "lower": -none if bounds is None else np.where(servo, bounds.lower, -none),
        "upper": none if bounds is None else np.where(servo, bounds.upper, none),
        "most": MOST,
        "untrusted": UNTRUSTED,
        "complete": COMPLETE,
        "start_rate": 1.0 / max(guard.time_to_start(servo), spec.dt),
        "blend_rate": 1.0 / max(guard.blend_time, spec.dt),
        "recover": guard.recover_time - 0.5 * spec.dt,
        "hold": guard.hold_time + 0.5 * spec.dt,
        "damp_step": guard.damp_rate * spec.dt,
        "damp_share": spec.dt / max(guard.damp_time, spec.dt),
    }


def _laws(compensator: Compensator) -> tuple[list[dict[str, Any]], set[int]]:
    """Each joint's numbers, and the kinds of equations that any of them has."""
    rows, inverses, terms, numbers = compensator.tables
    laws: list[dict[str, Any]] = []
    kinds: set[int] = set()
    for name, row in zip(compensator.joints, rows, strict=True):
        own = [terms[t] for t in range(int(row[at.TERMS]), int(row[at.TERMS_END]))]
        kinds |= {int(term[TERM_KIND]) for term in own}
        undone = inverses[int(row[at.INVERSES]) : int(row[at.INVERSES_END])]
        laws.append(
            {
                "name": name,
                "parts": row[at.LEVEL : at.LEVEL + 3],
                "gain": row[at.GAIN],
                "inertia": row[at.INERTIA],
                "compliance": row[at.COMPLIANCE],
                "half_gap": row[at.HALF_GAP],
                "smoothing": row[at.SMOOTHING],
                "inverses": [{"dead_zone": kind == DEAD_ZONE, "number": value} for kind, value in undone],
                "terms": [
                    {
                        "equation": EQUATIONS[term[TERM_KIND]].__name__,
                        "numbers": numbers[term[TERM_FIRST] : term[TERM_END]],
                    }
                    for term in own
                ],
            }
        )
    return laws, kinds


def _equations(laws: list[dict[str, Any]], kinds: set[int]) -> list[str]:
    """The functions that any joint needs, each once."""
    needed = [c_function(EQUATIONS[kind], ("n",), 3) for kind in sorted(kinds)]
    undone = {inverse["dead_zone"] for law in laws for inverse in law["inverses"]}
    if True in undone:
        needed.append(c_function(scalar.dead_zone_inverse))
    if False in undone:
        needed.append(c_function(scalar.switch_inverse))
    if any(law["half_gap"] for law in laws):
        needed.append(c_function(scalar.soft_sign))
    return [*needed, c_function(scalar.needed_torque, ("parts",))]
