"""A load of which nothing is measured: what a declared model fits of it from the motion and the effort alone."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, ClassVar

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, Parameter, Plausible, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.kernel import TorqueKernel, TorqueParts
from drake_tc.effects.position_dependent_load import spline_columns, spline_curve
from drake_tc.effects.rotor_inertia import SCREW_RANGE
from drake_tc.kernels import torque_equations
from drake_tc.types import FloatArray

MOMENT_RANGE = Plausible(
    0.0, 1.5, "a load cannot exceed one and a half times the largest torque of the drive", "torque"
)
LEVEL_RANGE = Plausible(
    -1.5, 1.5, "a load cannot exceed one and a half times the largest torque of the drive", "torque"
)
INERTIA_RANGE = Plausible(0.0, 450.0, "an inertia is positive, and 50 kg at 3 m have 450 kg m^2", sliding=SCREW_RANGE)
ANGLE_RANGE = Plausible(-np.pi, np.pi, "an angle is given within one turn, from -pi to pi")
END_RANGE = Plausible(-np.inf, np.inf, "the ends of the curve are those of the recorded positions")
INTERVALS = (2, 3, 4, 6, 8, 12)
"""Numbers of intervals over the travelled range from which the smooth load's one is chosen."""


class UnknownLoadEffect(TorqueEffect):
    """tau = J qddot + G(q) [N m], both unknown; G is what a subclass says. No search looks for it: a rig declares it.

    The inertia J is that of the load, and of the rotor too where no rotor inertia is declared. It is the last
    coefficient where the effect is `inertial`.
    """

    inertial: ClassVar[bool] = True
    inertia_parameter = "inertia"

    id = "unknown_load"
    kind = "load"
    linear = True

    def obstacle(self, context: Context) -> str:
        """Only a rig whose load is unknown has it."""
        return "" if context.load == "unknown" else "the load is known"


class UnknownPendulum(EquationEffect, UnknownLoadEffect):
    """J qddot + m g l sin(q - z) + c [N m], as J qddot + A sin q + B cos q + c.

    A = m g l cos z and B = -m g l sin z, so m g l = sqrt(A^2 + B^2) and z = atan2(-B, A).
    """

    form = "pendulum"
    joint_types = frozenset(("revolute",))
    torque_kind = torque_equations.PENDULUM
    title = "unknown load: pendulum"
    equation = "tau = moment * sin(q - zero) + constant + inertia * qddot"
    coefficients = (
        Parameter("sine", "N*m", description="A"),
        Parameter("cosine", "N*m", description="B"),
        Parameter("constant", "N*m", description="constant torque c", plausible=LEVEL_RANGE),
        Parameter("inertia", "kg*m^2", 0.0, description="inertia of the load", plausible=INERTIA_RANGE),
    )
    signature = Signature(x="position", split="", look_for="a sine of the angle with a line over the acceleration")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Moment and zero in place of A and B."""
        return (
            Parameter("moment", "N*m", 0.0, description="m g l", plausible=MOMENT_RANGE),
            Parameter("zero", "rad", description="z: position at which it hangs", plausible=ANGLE_RANGE),
            *self.coefficients[2:],
        )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 4): see the class."""
        q = signals.position
        return np.stack([np.sin(q), np.cos(q), np.ones(q.size), signals.acceleration], axis=-1)

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """(m g l, z, c, J): see the class."""
        sine, cosine, constant, inertia = map(float, theta)
        moment, zero = float(np.hypot(sine, cosine)), float(np.arctan2(-cosine, sine))
        return {"moment": moment, "zero": zero, "constant": constant, "inertia": inertia}

    def torque(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> FloatArray:
        """The load torque (T,): see the class."""
        return self.equation_torque(signals, parameters)


class UnknownSlider(EquationEffect, UnknownLoadEffect):
    """M qddot + c [N]: the mass that a joint which slides moves, and a constant force such as its weight."""

    form = "sliding"
    joint_types = frozenset(("prismatic",))
    torque_kind = torque_equations.CONSTANT
    title = "unknown load: mass and constant force"
    equation = "tau = constant + inertia * qddot"
    coefficients = (
        Parameter("constant", "N*m", description="constant force c", plausible=LEVEL_RANGE),
        Parameter("inertia", "kg*m^2", 0.0, description="mass of the load", plausible=INERTIA_RANGE),
    )
    signature = Signature(x="acceleration", split="", look_for="a straight line over the acceleration")

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A constant force."""
        return 0.0, 0.0, parameters["constant"]


CURVE_EQUATION = "tau = spline(q, curve_start, curve_end, levels)"


class SmoothLoad(UnknownLoadEffect):
    """J qddot + sum_k c_k B_k(q) [N m]: uniform cubic B-splines over the recorded positions (`splines`).

    There is one class for each number of intervals, and one more without J (`curve_4` beside `smooth_4`). Beyond the
    recorded positions the curve keeps its last value.
    """

    title = "unknown load: smooth function of the position"
    equation = f"{CURVE_EQUATION} + inertia * qddot"
    intervals: ClassVar[int]
    given_shapes = (
        Parameter("curve_start", "rad", default=-1.0, description="q_a", plausible=END_RANGE),
        Parameter("curve_end", "rad", default=1.0, description="q_b > q_a", plausible=END_RANGE),
    )
    signature = Signature(x="position", split="", look_for="one curve for both directions of motion")

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The recorded positions."""
        return [{"curve_start": context.position_span[0], "curve_end": context.position_span[1]}]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The curve has a range to lie over."""
        start, end = parameters["curve_start"], parameters["curve_end"]
        return "" if end > start else f"The curve ends at {end:.3g} rad, before it starts at {start:.3g} rad."

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, intervals + 4): the splines, then qddot where it is inertial."""
        curve = spline_columns(signals.position, shape["curve_start"], shape["curve_end"], self.intervals)
        return np.column_stack([curve, signals.acceleration]) if self.inertial else curve

    def __reduce__(self) -> tuple[Callable[[int, bool], "SmoothLoad"], tuple[int, bool]]:
        """By its form, because its class has no name in this module: a copy is the one object of the form."""
        return _smooth, (self.intervals, self.inertial)

    def kernel(self, parameters: Mapping[str, float]) -> TorqueKernel:
        """The curve at one instant, without J qddot."""
        levels = np.array([parameters[p.name] for p in self.coefficients[: self.intervals + 3]])
        curve = spline_curve(levels, parameters["curve_start"], parameters["curve_end"])

        def parts(q: float, *_: float) -> TorqueParts:
            return 0.0, 0.0, curve(q)

        return parts


@cache
def _smooth(intervals: int, inertial: bool) -> SmoothLoad:
    levels = tuple(
        Parameter(f"level_{k + 1}", "N*m", description=f"coefficient {k + 1} of the spline", plausible=LEVEL_RANGE)
        for k in range(intervals + 3)
    )
    inertia = (
        (Parameter("inertia", "kg*m^2", 0.0, description="inertia of the load", plausible=INERTIA_RANGE),)
        if inertial
        else ()
    )
    members = {
        "__doc__": SmoothLoad.__doc__,
        "form": f"{'smooth' if inertial else 'curve'}_{intervals}",
        "intervals": intervals,
        "inertial": inertial,
        "inertia_parameter": "inertia" if inertial else "",
        "equation": SmoothLoad.equation if inertial else CURVE_EQUATION,
        "coefficients": levels + inertia,
    }
    made: SmoothLoad = type(f"SmoothLoad{intervals}", (SmoothLoad,), members)()
    return made


PENDULUM, SLIDER = UnknownPendulum(), UnknownSlider()
SMOOTH_LOADS = tuple(_smooth(n, True) for n in INTERVALS)
CURVE_LOADS = tuple(_smooth(n, False) for n in INTERVALS)
UNKNOWN_LOADS: tuple[UnknownLoadEffect, ...] = (PENDULUM, SLIDER, *SMOOTH_LOADS, *CURVE_LOADS)
