"""Torque that varies with the angle: cogging, gear meshing, ripple."""

from collections.abc import Mapping

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, Signature
from drake_tc.effects.equation_effect import EquationEffect
from drake_tc.effects.sliding_wave import MOST_CYCLES, SLIDING_WAVE_RANGE, waves
from drake_tc.kernels.torque_equations import WAVE

WAVE_RANGE = Plausible(
    -1.0,
    1.0,
    "a ripple cannot exceed the largest torques of drive and load together",
    "torque",
)
CYCLES_PER_TURN_RANGE = Plausible(
    3.0,
    2000.0,
    "shafts behind a gear, pole pairs and gear teeth repeat three times or more in a turn of the output; "
    "less often it is a load curve over the position",
    sliding=SLIDING_WAVE_RANGE,
)
LEAST_PERIODS = 1.0
"""Periods of a ripple that the positions must span."""


class TorqueRipple(EquationEffect):
    """R_1 cos(n q) + R_2 sin(n q) [N m], n cycles a turn."""

    id = "torque_ripple"
    torque_kind = WAVE
    title = "torque ripple"
    equation = "tau_add = ripple_cosine * cos(cycles_per_turn * q) + ripple_sine * sin(cycles_per_turn * q)"
    kind = "load"
    depends_on_position = True
    coefficients = (
        Parameter("ripple_cosine", "N*m", description="cosine part of the torque over the angle", plausible=WAVE_RANGE),
        Parameter("ripple_sine", "N*m", description="sine part of the torque over the angle", plausible=WAVE_RANGE),
    )
    size = ("amplitude", "N*m")
    shapes = (
        Parameter(
            "cycles_per_turn",
            "1/turn",
            1.5,
            MOST_CYCLES,
            20.0,
            description="periods of the torque in one turn of the joint",
            plausible=CYCLES_PER_TURN_RANGE,
        ),
    )
    signature = Signature(
        x="position modulo period",
        split="direction",
        look_for="a wave over one period, the same in both directions",
    )

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Starting points that cover what the logs excite."""
        return waves(context, 1.2, 200.0, least=2.0, most=420.0)

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The positions span at least one period: less of a wave is a curve."""
        cycles = parameters["cycles_per_turn"]
        periods = cycles * context.turns
        if periods >= LEAST_PERIODS:
            return ""
        return (
            f"The positions span {periods:.3g} of a period of a ripple of {cycles:.3g} cycles a turn: that is a load "
            "curve over the position."
        )

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.friction
