"""An encoder whose reading wanders several times a turn: one on the motor's side, or with an uneven scale."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.types import FloatArray


def encoder_wave(signals: Signals, cycles: float) -> FloatArray:
    """Columns (T, 2) of e_s and e_c in q_meas = q + e_s sin(n q) + e_c cos(n q), to first order in the error.

    The error e enters all that is computed from the position: the balance misses J e_ddot + F_v e_dot + (d tau/dq) e,
    where J has the inertia of a load that is computed from the position, and d tau/dq is that load's slope.

    Args:
        signals: Of the log.
        cycles: n, waves a turn.
    """
    q, v, a = signals.position, signals.velocity, signals.acceleration
    sine, cosine = np.sin(cycles * q), np.cos(cycles * q)
    inertia, viscous, slope = signals.rotor_inertia + signals.link_inertia, signals.viscous, signals.load_slope
    fast = (cycles * v) ** 2
    of_sine = inertia * (cycles * a * cosine - fast * sine) + viscous * cycles * v * cosine + slope * sine
    of_cosine = -inertia * (cycles * a * sine + fast * cosine) - viscous * cycles * v * sine + slope * cosine
    return -np.stack([of_sine, of_cosine], axis=-1)


WAVE_RANGE = Plausible(
    -0.02,
    0.02,
    "interpolation and magnet errors of encoders stay below 0.02 rad (data sheets of magnetic encoders: "
    "0.02 rad on the axis)",
)
CYCLES_PER_TURN_RANGE = Plausible(
    2.0,
    400.0,
    "an encoder behind a gear of up to 1:200 errs once and twice a motor turn; one cycle a turn is eccentricity",
)


class EncoderRipple(SensorEffect):
    """q_meas = q + e(q), e = e_s sin(n q) + e_c cos(n q) [rad], n cycles a turn of the joint.

    A motor-side encoder behind a gear N errs N, 2N, ... times. A load that is computed from the position is off too:
    to first order the balance misses (J + J_load) d2e/dt2 + F_v de/dt + (d tau/d q) e. The first term grows with
    (n qdot)^2, so that errors below the encoder's step spoil the torque of a fast motion.
    """

    id = "encoder_ripple"
    title = "encoder ripple"
    equation = "q_meas = q + ripple_sine * sin(cycles_per_turn * q) + ripple_cosine * cos(cycles_per_turn * q)"
    kind = "sensor"
    depends_on_position = True
    coefficients = (
        Parameter("ripple_sine", "rad", description="sine part of the error of the reading", plausible=WAVE_RANGE),
        Parameter("ripple_cosine", "rad", description="cosine part of the error of the reading", plausible=WAVE_RANGE),
    )
    size = ("amplitude", "rad")
    shapes = (
        Parameter(
            "cycles_per_turn",
            "1/turn",
            1.5,
            400.0,
            12.0,
            description="periods of the error in one turn of the joint",
            plausible=CYCLES_PER_TURN_RANGE,
        ),
    )
    signature = Signature(
        x="position modulo period",
        split="direction",
        look_for="a wave over one period that grows with the speed squared",
    )

    def obstacle(self, context: Context) -> str:
        """Only a torque that is computed from the position shows it well."""
        if context.taken_up:
            return context.taken_up
        if context.load != "pendulum":
            return "the load torque is not computed from the encoder"
        return super().obstacle(context)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """From two cycles a turn to what the sampling still shows at full speed, in steps the travel can tell apart."""
        turns = (context.position_span[1] - context.position_span[0]) / (2 * np.pi)
        fastest = 0.25 / context.period * 2 * np.pi / max(context.max_speed, 1e-9)
        most = min(60.0, fastest)
        return [{"cycles_per_turn": float(n)} for n in np.arange(2.0, max(most, 3.0), max(0.35 / turns, 0.25))]

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The reading grows with the angle: n |e| < 1."""
        cycles = parameters["cycles_per_turn"]
        slope = cycles * float(np.hypot(parameters["ripple_sine"], parameters["ripple_cosine"]))
        if slope < 1.0:
            return ""
        return f"With {cycles:.3g} cycles a turn the reading would run backwards: its slope changes by {slope:.3g}."

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        return encoder_wave(signals, shape["cycles_per_turn"])

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Add the wave to the logged position."""
        phase = parameters["cycles_per_turn"] * signals.position
        error = parameters["ripple_sine"] * np.sin(phase) + parameters["ripple_cosine"] * np.cos(phase)
        return replace(signals, position=signals.position + error)

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Fixed point of q = q_meas - e(q): contracts by n |e| a round, far below 1 for any encoder."""
        true = signals
        for _ in range(20):
            error = self.corrupt(true, parameters).position - true.position
            true = replace(true, position=signals.position - error)
        return true

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 1e-3
