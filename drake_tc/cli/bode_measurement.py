"""What `drake-tc bode` measures and predicts, and what it says of both."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drake_tc.analysis.frequency_response import FrequencyResponse, bandwidth, continuous_phase, swept_sine
from drake_tc.analysis.release import settled_at
from drake_tc.analysis.sampled import linearise
from drake_tc.cli.bode_command import SteppedSine
from drake_tc.config.quoted import json_value
from drake_tc.errors import DrakeTcError
from drake_tc.types import FloatArray

UNSTABLE = 1e-4
"""A spectral radius by so much above 1 is told: below it, double eigenvalues at 1 that rounding has moved apart."""
LARGEST_GROWTH = 2.0
"""An unstable loop that grows by more than this during a measurement has no response that could be compared."""


@dataclass(frozen=True)
class BodeMeasurement:
    """What was measured and computed.

    Attributes:
        measured: The response.
        predicted: Of the linearisation, or None where there is none.
        notes: Sentences: why there is no prediction, what is no steady response.
        stable: False where the linearised loop is not.
    """

    measured: FrequencyResponse
    predicted: FrequencyResponse | None
    notes: tuple[str, ...]
    stable: bool = True

    def rows(self) -> list[dict[str, Any]]:
        """Plain data, one a frequency; angles in degrees."""
        rows = []
        for i, frequency in enumerate(self.measured.frequency_hz.tolist()):
            one, other = self.measured, self.predicted
            row = {
                "frequency_hz": frequency,
                "magnitude_db": float(one.magnitude_db[i]),
                "phase_deg": float(np.degrees(one.phase[i])),
                "distortion": float(one.distortion[i]),
                "predicted_magnitude_db": None if other is None else float(other.magnitude_db[i]),
                "predicted_phase_deg": None if other is None else float(np.degrees(other.phase[i])),
                "steady": bool(one.steady[i]),
            }
            rows.append(json_value(row))
        return rows

    def to_json(self) -> dict[str, Any]:
        """Rows; bandwidth, null where H is not about 1 at the lowest frequency; notes."""
        found = bandwidth(self.measured) if self.stable else None
        return {
            "rows": self.rows(),
            "phase_modulo_360": self.measured.turned is None,
            "bandwidth_hz": None if found is None else found.hz,
            "bandwidth_is_at_least": found is not None and found.at_least,
            "note": "; ".join(self.notes),
        }


def measure_bode(
    entry: Any, scenario: Any, sine: SteppedSine, progress: Callable[[str, float], None], *, predict: bool
) -> BodeMeasurement:
    """Measure and predict.

    Args:
        entry: Of the diagrams' registry.
        scenario: Of that entry.
        sine: Between which ports, when and how.
        progress: Told what is done, and which share.
        predict: Also linearise.

    Raises:
        ParamsError: ports or frequencies that cannot be.
        SimulationError: the diagram failed on its way or under a sine.
    """
    ports, sweep = sine.ports(), sine.sweep()
    if dt := getattr(scenario, "dt", None):
        sweep.check(dt)
    progress(f"on its way to t = {sine.at:g} s", 0.0)
    loop, context = settled_at(entry, scenario, sine.at, ports)
    measured = swept_sine(loop.diagram, context, loop.period, ports, sweep, progress)
    notes = _unsteady(measured)
    if not predict:
        return BodeMeasurement(measured, None, notes)
    try:
        with TemporaryDirectory() as folder:
            progress("linearising", 1.0)
            plain = scenario if entry.sliding is None else entry.sliding(scenario, Path(folder))
            predicted, radius = _predicted(entry, plain, sine, measured.frequency_hz)
    except DrakeTcError as error:
        return BodeMeasurement(measured, None, (*notes, f"no prediction: {error}"))
    stable = radius <= 1.0 + UNSTABLE
    if not stable:
        lasts = max(sweep.settle, 2.0 / measured.frequency_hz[0])
        lasts += max(sweep.measure, 2.0 / measured.frequency_hz[0])
        exponent = np.log(radius) * lasts / loop.period
        growth = float(np.exp(min(exponent, 20.0)))
        notes += (
            f"the linearised loop is unstable: spectral radius {radius:.4f}, {growth:.2g} times as large after the"
            f" {lasts:.2g} s of a measurement; it has no steady response",
        )
        if exponent > np.log(LARGEST_GROWTH):
            return BodeMeasurement(measured, None, notes, stable=False)
    return BodeMeasurement(measured.near(predicted.phase), predicted, notes, stable)


def _unsteady(measured: FrequencyResponse) -> tuple[str, ...]:
    apart = np.zeros(measured.frequency_hz.size) if measured.apart is None else measured.apart
    return tuple(
        f"{frequency:.2f} Hz: no steady sine (distortion {distortion:.2g}; the halves of the measurement"
        f" differ by {100.0 * away:.0f} %): use a longer --settle or another --amplitude"
        for frequency, distortion, away, steady in zip(
            measured.frequency_hz, measured.distortion, apart, measured.steady, strict=True
        )
        if not steady
    )


def _predicted(
    entry: Any, scenario: Any, sine: SteppedSine, frequency_hz: FloatArray
) -> tuple[FrequencyResponse, float]:
    """The linearisation's response, and the spectral radius of its loop."""
    into, out = sine.ports()
    loop, context = settled_at(entry, scenario, sine.at, (into, out))
    system = linearise(loop.diagram, context, loop.period, inputs=(into.port,), outputs=(out.port,))

    def response(hz: FloatArray) -> Any:
        return system.response(2.0 * np.pi * hz)[:, out.index, into.index]

    nothing = np.full(frequency_hz.size, np.nan)
    turned = continuous_phase(response, frequency_hz)
    return FrequencyResponse(
        frequency_hz, response(frequency_hz), nothing, turned=turned
    ), system.radius_but_for_drift()
