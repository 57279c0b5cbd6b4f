"""An encoder disc mounted off its axis."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.effects.base import Context, JointNumbers, Parameter, Plausible, SensorEffect, Shape, Signals, Signature
from drake_tc.effects.encoder_ripple import encoder_wave
from drake_tc.types import FloatArray

DISC_ERROR_RANGE = Plausible(
    -0.05,
    0.05,
    "a disc of 10 mm radius mounted 0.5 mm off its axis errs by 0.05 rad (data sheets of ring encoders: "
    "below 0.01 rad)",
)


class EncoderEccentricity(SensorEffect):
    """q_meas = q + e_s sin q + e_c cos q [rad], once a turn.

    To first order the balance misses what `encoder_wave` says for one cycle a turn; with a position servo that does not
    see this encoder it also misses stiffness times the error.
    """

    id = "encoder_eccentricity"
    joint_types = frozenset(("revolute",))
    title = "encoder eccentricity"
    equation = "q_meas = q + eccentricity_sine * sin(q) + eccentricity_cosine * cos(q)"
    kind = "sensor"
    depends_on_position = True
    form = "shared"
    coefficients = (
        Parameter(
            "eccentricity_sine",
            "rad",
            description="sine part of the error of the reading over a turn",
            plausible=DISC_ERROR_RANGE,
        ),
        Parameter(
            "eccentricity_cosine",
            "rad",
            description="cosine part of the error of the reading over a turn",
            plausible=DISC_ERROR_RANGE,
        ),
    )
    size = ("amplitude", "rad")
    signature = Signature(x="position", split="direction", look_for="one wave a turn that grows with the speed")

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The amplitude of the wave has the range of its two parts."""
        amplitude = float(np.hypot(parameters["eccentricity_sine"], parameters["eccentricity_cosine"]))
        if amplitude <= DISC_ERROR_RANGE.upper:
            return ""
        return (
            f"The amplitude is {amplitude:.3g} rad, above the plausible {DISC_ERROR_RANGE.upper:g} rad: "
            f"{DISC_ERROR_RANGE.source}."
        )

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): see the class."""
        return encoder_wave(signals, 1.0)

    def corrupt(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Add the wave to the logged position."""
        q = signals.position
        error = parameters["eccentricity_sine"] * np.sin(q) + parameters["eccentricity_cosine"] * np.cos(q)
        return replace(signals, position=q + error)

    def restore(self, signals: Signals, parameters: Mapping[str, FloatArray | float]) -> Signals:
        """Fixed point of q = q_meas - e(q): contracts by |e| < 1 a round."""
        true = signals
        for _ in range(12):
            error = self.corrupt(true, parameters).position - true.position
            true = replace(true, position=signals.position - error)
        return true

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return n.gain * n.part if context.drive == "position_servo" else 2e-3


class SeparateEncoderEccentricity(EncoderEccentricity):
    """The same error on an encoder that the position servo does not use: its effort is off by the error itself."""

    form = "separate"
    size = ("amplitude", "rad")

    def obstacle(self, context: Context) -> str:
        """Only a position servo has an effort that the error enters."""
        return "" if context.drive == "position_servo" else "the drive does not use the encoder's position"

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 2): the shared encoder's, and the servo's stiffness times the error."""
        q = signals.position
        wave = np.stack([np.sin(q), np.cos(q)], axis=-1)
        return np.asarray(super().columns(signals, shape) - signals.stiffness * wave)

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 2e-3
