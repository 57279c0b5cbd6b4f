"""A Bode plot of several frequency responses: magnitude above, phase below."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogFormatter

from drake_tc.analysis.frequency_response import FrequencyResponse


def draw_bode(
    figure: Any,
    curves: Mapping[str, FrequencyResponse],
    title: str = "",
    *,
    delay: float | None = None,
) -> None:
    """Draw responses into a matplotlib Figure.

    Args:
        figure: Empty.
        curves: By name; those called "linear ..." are lines, the others dots on lines. Where the turns of one's phase
            are not known its dots stand alone, and the axis says so.
        title: Above.
        delay: Phase of a pure delay [s], drawn beside them; None: not.
    """
    above, below = figure.subplots(2, 1, sharex=True)
    modulo = any(one.turned is None for one in curves.values())
    for name, one in curves.items():
        style = {"linestyle": "--"} if name.startswith("linear") else {"marker": "o", "markersize": 3.0}
        magnitude = np.where(np.isfinite(one.magnitude_db), one.magnitude_db, np.nan)
        above.semilogx(one.frequency_hz, magnitude, label=name, **style)
        alone = {} if one.turned is not None else {"linestyle": "none"}
        below.semilogx(one.frequency_hz, np.degrees(one.phase), label=name, **{**style, **alone})
    if delay is not None:
        grid = np.unique(np.concatenate([one.frequency_hz for one in curves.values()]))
        below.semilogx(grid, -360.0 * grid * delay, "k:", label=f"{1e3 * delay:g} ms")
    above.set_ylabel("|H| [dB]")
    below.set_ylabel("phase modulo 360 [deg]" if modulo else "phase [deg]")
    below.set_xlabel("frequency [Hz]")
    above.set_title(title)
    for axes in (above, below):
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(2.0, 0.5)))
    below.legend()
