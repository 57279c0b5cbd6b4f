"""A drive that delivers no more than so much."""

from collections.abc import Mapping
from math import inf, isfinite

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Parameter, Plausible, Shape, Signals, Signature
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings, memoryless
from drake_tc.kernels.equations import saturated
from drake_tc.kernels.joint_layout import SATURATION
from drake_tc.types import FloatArray

LIMIT_RANGE = Plausible(
    0.02,
    1.0,
    "a limit beyond the recorded efforts never acted, and one far below them would have let no motion happen",
    "effort",
)


class Saturation(DriveEffect):
    """y* = clip(y, -L, L)."""

    id = "saturation"
    title = "saturation of the drive"
    equation = "y_eff = min(max(y, -limit), limit)"
    kind = "drive"
    shapes = (Parameter("limit", "effort", 0.0, default=np.inf, description="largest effort L", plausible=LIMIT_RANGE),)
    signature = Signature(x="effort", split="", look_for="a line that bends at the same effort on both sides")

    def obstacle(self, context: Context) -> str:
        """Not where links are fitted: in a joint with little load, friction explains an effort cut down to its sign."""
        if context.load == "links":
            return "the links are fitted from the recorded efforts, and a fitted limit could cut off a part of these"
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Limits from a fifth of the largest effort up to it."""
        largest = max(abs(context.effort_span[0]), abs(context.effort_span[1]))
        return [{"limit": float(x * largest)} for x in np.linspace(0.2, 0.98, 14)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Clip."""
        return np.asarray(saturated(effort, shape["limit"]))

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """No memory."""
        limit = parameters["limit"]
        return memoryless(lambda value, effort, direction: float(saturated(value, limit)), SATURATION, (limit,))

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.8 * n.effort


class ServoSaturation(Saturation):
    """y* = clip(y - T_d qdot, -L, L) + T_d qdot: a servo that limits its whole torque k (y - T_d qdot).

    The damping k T_d of such a servo is a part of the viscous friction of the balance, so that the limit takes it out
    of y and puts it back. It is part of a model only where it is declared: T_d is a setting of the servo.
    """

    form = "servo"
    title = "saturation of the whole torque of the servo"
    equation = "y_eff = min(max(y - derivative_time * qdot, -limit), limit) + derivative_time * qdot"
    given_shapes = (
        Parameter(
            "derivative_time",
            "s",
            0.0,
            default=0.0,
            description="damping of the servo over its gain",
            plausible=Plausible(0.0, 1.0, "it is a setting of the servo"),
        ),
    )

    def obstacle(self, context: Context) -> str:
        """Only where it is declared."""
        return "the damping of the servo inside of its limit is known only where it is declared"

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """The limits, with the declared setting."""
        time = context.declared.get(f"{self.key}.derivative_time", 0.0)
        return [shape | {"derivative_time": time} for shape in super().shape_grid(context)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Clip what the servo asks for."""
        damping = shape["derivative_time"] * signals.velocity
        return np.asarray(saturated(effort - damping, shape["limit"])) + damping

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [the velocity now]."""
        limit, time = parameters["limit"], parameters["derivative_time"]

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            memory[at] = now.velocity

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            damping = time * memory[at]
            return float(saturated(value - damping, limit)) + damping

        return DriveKernel(1, lambda value, effort: [0.0], step, observe)


DUTY_RANGE = Plausible(
    0.0,
    2.0,
    "a limit beyond the recorded efforts never acted, also when the supply was at half of its median",
    "effort/supply",
)


class SupplyLimit(DriveEffect):
    """y* = clip(y, -m V, m V), V the recorded supply voltage: full duty of the bridge.

    m is 1 where the effort is the motor's voltage; of a position servo it holds the gain from rad to volts.
    """

    id = "saturation"
    title = "saturation of the drive at its supply voltage"
    equation = "y_eff = min(max(y, -(limit_per_volt * V)), limit_per_volt * V)"
    kind = "drive"
    form = "supply"
    needs = frozenset({"supply_voltage"})
    shapes = (
        Parameter(
            "limit_per_volt",
            "effort/V",
            0.0,
            default=inf,
            description="largest effort m for 1 V",
            plausible=DUTY_RANGE,
        ),
    )
    signature = Signature(
        x="effort", split="", look_for="a line that bends at an effort which moves with the supply voltage"
    )

    def obstacle(self, context: Context) -> str:
        """Needs a recorded supply."""
        if context.imposes_current:
            return "a current drive has a limit of the current, which `saturation` describes"
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Limits at the median supply from a fifth of the largest effort up to it."""
        largest = context.scale("effort/supply")
        return [{"limit_per_volt": float(x * largest)} for x in np.linspace(0.2, 0.98, 14)]

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """Clip where the supply is known (neither NaN nor 0)."""
        supply = signals.supply_voltage
        known = np.isfinite(supply) & (supply > 0.0)
        limit = np.where(known, shape["limit_per_volt"] * np.where(known, supply, 1.0), inf)
        return np.clip(effort, -limit, limit)

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [the limit now]."""
        share = parameters["limit_per_volt"]

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            memory[at] = share * now.supply if isfinite(now.supply) and now.supply > 0.0 else inf

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            limit = memory[at]
            return max(-limit, min(limit, value))

        return DriveKernel(1, lambda value, effort: [inf], step, observe)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.8 * n.effort / max(context.supply_voltage, 1.0) if context.supply_voltage > 0.0 else 0.0
