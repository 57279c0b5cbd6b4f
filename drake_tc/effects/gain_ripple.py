"""A drive whose torque for the same effort depends on the angle of its motor."""

import math
from collections.abc import Mapping

import numpy as np

from drake_tc.effects.base import Context, DriveEffect, Parameter, Plausible, Shape, Signals, Signature, Values
from drake_tc.effects.kernel import DriveKernel, DriveSurroundings
from drake_tc.effects.position_dependent_friction import LEAST_PERIODS
from drake_tc.effects.torque_ripple import MOST_CYCLES, SLIDING_WAVE_RANGE, waves
from drake_tc.types import FloatArray

PART_RANGE = Plausible(
    -0.5,
    0.5,
    "six-step commutation varies the torque by 7 % about its mean, errors of the measured phase currents by a few per "
    "cent; a drive that varies by half has lost a phase",
)
CYCLES_RANGE = Plausible(
    1.0,
    2000.0,
    "a motor's shaft, its pole pairs and its phases repeat at least once in a turn of the output",
    sliding=SLIDING_WAVE_RANGE,
)
LEAST_GAIN = 0.05
"""Of 1 + c cos(n q) + s sin(n q), below which the inverse does not divide."""


class GainRipple(DriveEffect):
    """y* = y (1 + c cos(n q) + s sin(n q)): a torque constant that varies with the angle, n cycles a turn of the joint.

    Linear in c/K and s/K, so it is looked for as two columns. A torque ripple (cogging) does not depend on the effort;
    this wave is proportional to it.
    """

    id = "gain_ripple"
    title = "torque constant that varies with the angle"
    equation = "y_eff = y * (1 + gain_cosine * cos(cycles_per_turn * q) + gain_sine * sin(cycles_per_turn * q))"
    kind = "drive"
    depends_on_position = True
    coefficients = (Parameter("cosine_torque", "N*m/effort"), Parameter("sine_torque", "N*m/effort"))
    shapes = (
        Parameter(
            "cycles_per_turn",
            "1/turn",
            1.0,
            MOST_CYCLES,
            20.0,
            description="periods of the torque constant in one turn of the joint",
            plausible=CYCLES_RANGE,
        ),
    )
    signature = Signature(
        x="position modulo period",
        split="direction",
        look_for="a wave over one period that grows with the effort and changes its sign with it",
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """C, s and n."""
        return (
            Parameter(
                "gain_cosine",
                "-",
                -1.0,
                1.0,
                description="cosine part of the torque constant over its mean",
                plausible=PART_RANGE,
            ),
            Parameter(
                "gain_sine",
                "-",
                -1.0,
                1.0,
                description="sine part of the torque constant over its mean",
                plausible=PART_RANGE,
            ),
            *self.shapes,
        )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        return waves(context, LEAST_PERIODS, 200.0, least=1.0, most=420.0)

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The amplitude has the range of its two parts, and the positions span half a period."""
        amplitude = math.hypot(parameters["gain_cosine"], parameters["gain_sine"])
        if amplitude > PART_RANGE.upper:
            return f"The amplitude is {amplitude:.3g}, above the plausible {PART_RANGE.upper:g}: {PART_RANGE.source}."
        cycles = parameters["cycles_per_turn"]
        periods = cycles * context.turns
        if periods >= LEAST_PERIODS:
            return ""
        return (
            f"The positions span {periods:.3g} of a period of a torque constant with {cycles:.3g} cycles a turn: at "
            f"least {LEAST_PERIODS:g} is expected, as less of a wave determines neither its amplitude nor its period."
        )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """-y (cos(n q), sin(n q)) (T, 2)."""
        angle = shape["cycles_per_turn"] * signals.position
        return np.asarray(-signals.effort[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    def physical(self, theta: FloatArray, shape: Shape, gain: float) -> dict[str, float]:
        """The parts c = theta_1 K and s = theta_2 K."""
        named = {"gain_cosine": float(theta[0]) * gain, "gain_sine": float(theta[1]) * gain}
        return named | {"cycles_per_turn": float(shape["cycles_per_turn"])}

    def transform(self, effort: FloatArray, signals: Signals, shape: Shape) -> FloatArray:
        """The ripple acts through its columns."""
        return effort

    def kernel(self, parameters: Mapping[str, float], period: float) -> DriveKernel:
        """Memory is [c cos(n q) + s sin(n q)]; acts on the raw effort, as the columns do."""

        def observe(now: DriveSurroundings, memory: list[float], at: int) -> None:
            memory[at] = float(_ripple(now.position, parameters))

        def step(value: float, effort: float, direction: float, memory: list[float], at: int) -> float:
            return value + memory[at] * effort

        return DriveKernel(1, lambda value, effort: [0.0], step, observe)

    def inverse(
        self, effort: FloatArray, position: FloatArray, direction: FloatArray, parameters: Values
    ) -> FloatArray:
        """The effort y = y*/(1 + c cos(n q) + s sin(n q)); at most 20 times y*."""
        return np.asarray(effort / np.maximum(1.0 + _ripple(position, parameters), LEAST_GAIN))


def _ripple(position: FloatArray | float, parameters: Values) -> FloatArray:
    """C cos(n q) + s sin(n q)."""
    angle: FloatArray = np.asarray(parameters["cycles_per_turn"]) * np.asarray(position)
    return np.asarray(parameters["gain_cosine"] * np.cos(angle) + parameters["gain_sine"] * np.sin(angle))
