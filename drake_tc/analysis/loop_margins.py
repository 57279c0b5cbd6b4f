"""Margins of every channel of a loop that was cut at a port, from one frequency response."""

from collections.abc import Callable, Sequence

import numpy as np

from drake_tc.analysis.margins import ComplexArray, Margins, frequency_grid, margins
from drake_tc.analysis.sampled import SampledSystem
from drake_tc.types import FloatArray


def loop_margins(
    cut: SampledSystem, channels: Sequence[str | int] | None = None, grid: FloatArray | None = None
) -> dict[str, Margins]:
    """Margins of the channels of a cut (`open_loop`), each with the other channels closed.

    Args:
        cut: Open at a port of m elements; closed again it must be stable.
        channels: Which: "system:port[i]" or numbers; None for all.
        grid: (W,) rising frequencies up to pi/dt [rad/s]; None: `frequency_grid`.

    Returns:
        Name "system:port[i]" to margins.

    Raises:
        ParamsError: no such channel, or a response that is not finite.
    """
    omega = frequency_grid(cut.dt) if grid is None else np.asarray(grid, dtype=np.float64)
    on_grid = cut.loop_responses(omega)
    known: dict[float, ComplexArray] = {}
    chosen = range(len(cut.inputs)) if channels is None else [cut.channel(name) for name in channels]

    def response(index: int) -> Callable[[FloatArray], ComplexArray]:
        def one(frequency: FloatArray) -> ComplexArray:
            if frequency is omega:
                return np.asarray(on_grid[:, index])
            w = float(frequency[0])
            if w not in known:
                known[w] = cut.loop_responses(frequency)[0]
            return known[w][index : index + 1]

        return one

    return {cut.inputs[i]: margins(response(i), cut.dt, omega) for i in chosen}
