"""A Bode plot of several frequency responses: magnitude above, phase below."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogFormatter
from numpy.typing import NDArray

from drake_tc.types import FloatArray


def draw_bode(
    figure: Any,
    curves: Mapping[str, tuple[FloatArray, NDArray[np.complex128]]],
    title: str = "",
    *,
    delay: float | None = None,
) -> None:
    """Draw responses into a matplotlib Figure.

    Args:
        figure: Empty.
        curves: Name to (frequencies (F,) [Hz], H (F,)); those called "linear ..." are lines, the others dots on lines.
        title: Above.
        delay: Phase of a pure delay [s], drawn beside them; None: not.
    """
    above, below = figure.subplots(2, 1, sharex=True)
    for name, (frequency, response) in curves.items():
        style = {"linestyle": "--"} if name.startswith("linear") else {"marker": "o", "markersize": 3.0}
        above.semilogx(frequency, 20.0 * np.log10(np.maximum(np.abs(response), 1e-12)), label=name, **style)
        below.semilogx(frequency, np.degrees(np.unwrap(np.angle(response))), label=name, **style)
    if delay is not None:
        grid = np.unique(np.concatenate([frequency for frequency, _ in curves.values()]))
        below.semilogx(grid, -360.0 * grid * delay, "k:", label=f"{1e3 * delay:g} ms")
    above.set_ylabel("|H| [dB]")
    below.set_ylabel("phase [deg]")
    below.set_xlabel("frequency [Hz]")
    above.set_title(title)
    for axes in (above, below):
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(2.0, 0.5)))
    below.legend()
