"""An effect's equation with its numbers filled in, as MathML.

`Effect.equation` is written as Python expressions in the names of the effect's parameters and of these signals: `q`,
`qdot`, `qddot`, `q_d`, `tau`, `y`, `t`, `T`, `V`, with `tau_add`, `y_eff`, `q_meas`, `tau_meas`, `q_motor` on the left.
`ddt(x)` and `ddq(x)` are derivatives, `integral(x)` is over time, and a signal with an argument is taken at that time.
"""

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

from drake_tc.config.joint_units import TURNING, JointUnits
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.base import Effect
from drake_tc.effects.check import EQUATION_FUNCTIONS as FUNCTIONS
from drake_tc.report.numbers import interval, pretty_unit, significant

SYMBOLS: Mapping[str, str] = {
    "q": "<mi>q</mi>",
    "qdot": '<mi class="dot">q\u0307</mi>',
    "qddot": '<mi class="dot">q\u0308</mi>',
    "q_d": "<msub><mi>q</mi><mi>d</mi></msub>",
    "q_meas": "<msub><mi>q</mi><mtext>meas</mtext></msub>",
    "q_motor": "<msub><mi>q</mi><mtext>motor</mtext></msub>",
    "tau": "<mi>τ</mi>",
    "tau_add": "<mrow><mi>Δ</mi><mi>τ</mi></mrow>",
    "tau_meas": "<msub><mi>τ</mi><mtext>meas</mtext></msub>",
    "y": "<mi>y</mi>",
    "y_eff": "<msup><mi>y</mi><mo>*</mo></msup>",
    "K": "<mi>K</mi>",
    "J": "<mi>J</mi>",
    "t": "<mi>t</mi>",
    "T": "<mi>T</mi>",
    "T_25": "<mrow><mn>25</mn><mtext>\u00a0°C</mtext></mrow>",
    "V": "<mi>V</mi>",
    "w": "<mi>w</mi>",
    "r": "<mi>r</mi>",
    "z": "<mi>z</mi>",
}
TIMES, APPLY = '<mspace width="0.17em"/>', "<mo>\u2061</mo>"
_SUM, _PRODUCT, _POWER, _ATOM = 1, 2, 3, 4


@dataclass(frozen=True)
class _Piece:
    """MathML of an expression, how tightly it binds, and whether it ends with a number that has a unit."""

    text: str
    binds: int = _ATOM
    ends_with_unit: bool = False

    def within(self, least: int) -> str:
        """The text, in parentheses where it binds less tightly than `least`."""
        return self.text if self.binds >= least else _parentheses(self.text)


def equations(effect: Effect, values: Mapping[str, Estimate]) -> list[str]:
    """`<math>` elements of an effect whose parameters have these values; none where it states no equation."""
    return [_math(part, values) for part in effect.equation.split(";")] if effect.equation else []


def symbolic_equations(effect: Effect) -> list[str]:
    """`<math>` elements of an effect with the names of its parameters in place of numbers; for documentation."""
    names = {p.name: p.name for p in (*effect.parameters, *effect.coefficients, *effect.shapes, *effect.given_shapes)}
    writer = _Symbols(names)
    return [_display(part, writer) for part in effect.equation.split(";")] if effect.equation else []


def model_equations(joint: JointResult) -> list[tuple[str, bool, list[str]]]:
    """(title, whether it was added, `<math>` elements) of the final model: the torque balance, then every effect."""
    values, known = joint.final_parameters, {t.effect.key for t in joint.baseline.terms}
    inertia = joint.train.samples.signals.rotor_inertia
    rows = [("torque balance", False, [balance(values["drive"]["gain"], inertia, joint.units)])]
    for effect in (t.effect for t in joint.final.terms):
        if effect.equation:
            rows.append((effect.title, effect.key not in known, equations(effect, values[effect.key])))
    return rows


def balance(gain: Estimate, rotor_inertia: float, units: JointUnits = TURNING) -> str:
    """`<math>` of the torque balance with the drive gain [effort/(N m)] and the declared inertia [kg m^2], if any."""
    inertia = " + J * qddot" if rotor_inertia > 0.0 else ""
    values = {"K": gain, "J": Estimate(rotor_inertia, units.of("kg*m^2"), (rotor_inertia, rotor_inertia), False)}
    return _math(f"y_eff / K = tau{inertia} + total(tau_add)", values)


def _math(text: str, values: Mapping[str, Estimate]) -> str:
    return _display(text, _Writer(values))


def _display(text: str, writer: "_Writer") -> str:
    sides = [writer.piece(ast.parse(side.strip(), mode="eval").body).text for side in text.split(" = ")]
    return f'<math display="block"><mrow>{"<mo>=</mo>".join(sides)}</mrow></math>'


def _parentheses(text: str) -> str:
    """Larger parentheses around a fraction, by size and not by stretching, which needs a font for mathematics."""
    size = ' stretchy="false" class="tall"' if "<mfrac>" in text else ""
    return f"<mrow><mo{size}>(</mo>{text}<mo{size}>)</mo></mrow>"


class _Writer:
    """Expressions to MathML with the parameters' values."""

    def __init__(self, values: Mapping[str, Estimate]) -> None:
        self.values = values

    def piece(self, node: ast.expr) -> _Piece:
        """MathML of one expression."""
        if isinstance(node, ast.Constant):
            return _Piece(f"<mn>{node.value!r}</mn>")
        if isinstance(node, ast.Name):
            return self._name(node.id)
        if isinstance(node, ast.UnaryOp):
            return _Piece(f"<mo>−</mo>{self.piece(node.operand).within(_PRODUCT)}", _SUM)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.IfExp):
            return self._cases(node)
        if isinstance(node, ast.Compare):
            return _Piece(f"{self.piece(node.left).text}<mo>&gt;</mo>{self.piece(node.comparators[0]).text}", _SUM)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return self._call(node.func.id, node.args)
        raise ValueError(f"no such thing in an equation: {ast.dump(node)}")

    def _name(self, name: str) -> _Piece:
        if name not in self.values:
            return _Piece(SYMBOLS[name])
        unit = pretty_unit(self.values[name].unit)
        number = f"<mn>{self._number(name).lstrip('−')}</mn>"
        number = f"<mo>−</mo>{number}" if self._negative_name(name) else number
        if unit in ("", "1/turn", "rad/m"):
            return _Piece(f"<mrow>{number}</mrow>", _SUM if self._negative_name(name) else _ATOM)
        binds = _SUM if self._negative_name(name) else _PRODUCT
        return _Piece(f"<mrow>{number}<mtext>\u00a0{escape(unit)}</mtext></mrow>", binds, ends_with_unit=True)

    def _number(self, name: str) -> str:
        value = self.values[name]
        return interval(value.value, *value.ci95)[0]

    def _negative_name(self, name: str) -> bool:
        return name in self.values and self._number(name).startswith("−")

    def _negative(self, node: ast.expr) -> bool:
        """Whether the text of an expression begins with a minus that the sign before it can take up."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            return self._negative(node.left)
        return isinstance(node, ast.Name) and self._negative_name(node.id)

    def _binary(self, node: ast.BinOp) -> _Piece:
        if isinstance(node.op, ast.Add | ast.Sub):
            return self._sum(node)
        if isinstance(node.op, ast.Pow):
            power = self.piece(node.right).text
            return _Piece(f"<msup>{self._base(node.left)}<mrow>{power}</mrow></msup>", _POWER)
        left, right = self.piece(node.left), self.piece(node.right)
        if isinstance(node.op, ast.Div):
            return _Piece(f"<mfrac><mrow>{left.text}</mrow><mrow>{right.text}</mrow></mfrac>", _POWER)
        minus = left.text.startswith("<mrow><mo>−</mo>") and left.binds == _SUM and self._negative(node.left)
        text = left.text if minus else left.within(_PRODUCT)
        between = "<mo>·</mo>" if left.ends_with_unit or right.ends_with_unit else TIMES
        binds = _SUM if minus else _PRODUCT
        return _Piece(f"<mrow>{text}{between}{right.within(_PRODUCT)}</mrow>", binds, right.ends_with_unit)

    def _base(self, node: ast.expr) -> str:
        return self.piece(node).within(_ATOM)

    def _sum(self, node: ast.BinOp) -> _Piece:
        minus = isinstance(node.op, ast.Sub)
        right = self.piece(node.right)
        text = right.text if self._negative(node.right) else right.within(_PRODUCT)
        if self._negative(node.right):
            text, minus = text.replace("<mo>−</mo>", "", 1), not minus
        sign = "−" if minus else "+"
        return _Piece(f"{self.piece(node.left).text}<mo>{sign}</mo>{text}", _SUM, right.ends_with_unit)

    def _cases(self, node: ast.IfExp) -> _Piece:
        test = self.piece(node.test).text
        rows = ((self.piece(node.body).text, test), (self.piece(node.orelse).text, "<mtext>otherwise</mtext>"))
        cells = "".join(f"<mtr><mtd>{value}</mtd><mtd>{when}</mtd></mtr>" for value, when in rows)
        return _Piece(f"<mrow><mo>{{</mo><mtable>{cells}</mtable></mrow>", _ATOM, ends_with_unit=True)

    def _call(self, name: str, arguments: list[ast.expr]) -> _Piece:
        if name == "spline":
            return self._spline(arguments)
        inside = [self.piece(a).text for a in arguments]
        if name == "abs":
            return _Piece(f"<mrow><mo>|</mo>{inside[0]}<mo>|</mo></mrow>")
        if name in ("ddt", "ddq"):
            below = name[-1]
            return _Piece(f"<mfrac><mrow><mi>d</mi>{inside[0]}</mrow><mrow><mi>d</mi><mi>{below}</mi></mrow></mfrac>")
        if name == "integral":
            return _Piece(f"<mrow><mo>∫</mo>{inside[0]}{TIMES}<mi>d</mi><mi>t</mi></mrow>", _PRODUCT)
        if name == "total":
            return _Piece(f"<mrow><mo>∑</mo>{inside[0]}</mrow>", _PRODUCT)
        label = f"<mi>{name}</mi>" if name in FUNCTIONS else SYMBOLS[name]
        return _Piece(f"<mrow>{label}{APPLY}{_parentheses('<mo>,</mo>'.join(inside))}</mrow>")

    def _spline(self, arguments: list[ast.expr]) -> _Piece:
        """A curve B(q) through levels, with the range over which it lies."""
        levels = [name for name in self.values if name.startswith("level_")]
        unit = pretty_unit(self.values[levels[0]].unit)
        listed = "<mo>,</mo>".join(f"<mn>{significant(self.values[name].value)}</mn>" for name in levels)
        start, end = (self.piece(a).text for a in arguments[1:3])
        span = f"<mi>q</mi><mo>=</mo>{start}<mo>…</mo>{end}"
        curve = f"<mi>B</mi>{APPLY}<mo>(</mo><mi>q</mi><mo>;</mo>{listed}<mtext>\u00a0{escape(unit)}</mtext><mo>)</mo>"
        return _Piece(f"<mrow>{curve}</mrow><mrow><mo>(</mo>{span}<mo>)</mo></mrow>", _PRODUCT)


class _Symbols(_Writer):
    """Expressions to MathML with the parameters' names."""

    def __init__(self, names: Mapping[str, str]) -> None:
        super().__init__({})
        self.names = names

    def _name(self, name: str) -> _Piece:
        if name in self.names:
            return _Piece(f"<mtext>{escape(name.replace('_', ' '))}</mtext>")
        return _Piece(SYMBOLS[name])

    def _spline(self, arguments: list[ast.expr]) -> _Piece:
        return _Piece(f"<mrow><mi>B</mi>{APPLY}<mo>(</mo><mi>q</mi><mo>;</mo><mtext>levels</mtext><mo>)</mo></mrow>")
