"""Equations of the library as C: a function of numbers whose body is assignments and one `return` of expressions.

The equations of effects and drives stand once, in Python (`drake_tc.kernels.equations` and `torque_equations`). Their
syntax trees are written in C here, so that no equation stands twice.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

from drake_tc.errors import ParamsError

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
    names = [argument.arg for argument in tree.args.args]
    given = [f"const double *{_name(name)}" if name in arrays else f"double {_name(name)}" for name in names]
    lines, used = [], {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    lines += [f"    (void){_name(name)};" for name in names if name not in used]
    for statement in tree.body:
        lines += _statement(statement, function.__name__, function.__globals__)
    head = f"static {'void' if outputs else 'double'} dtc_{function.__name__}("
    return head + ", ".join(given + (["double *out"] if outputs else [])) + ")\n{\n" + "\n".join(lines) + "\n}\n"


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
