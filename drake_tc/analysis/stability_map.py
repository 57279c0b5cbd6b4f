"""A map of stability over any two numbers of a `JointLoop`: spectral radius, sensitivity peak or another figure."""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, get_args

import numpy as np

from drake_tc.analysis.sweep import Progress, SweepError, sweep
from drake_tc.config.quoted import json_value
from drake_tc.control.joint_loop import JointLoop, parameters, value_of, with_values
from drake_tc.errors import ParamsError
from drake_tc.types import BoolArray, FloatArray

Figure = Literal["spectral_radius", "sensitivity_peak", "gain_margin", "phase_margin", "delay_margin"]
MOST_POINTS = 1_000_000


@dataclass(frozen=True)
class Axis:
    """One parameter and the values that it takes.

    Raises:
        ParamsError: an unknown parameter, no value, or one that is not finite.
    """

    name: str
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.name not in parameters():
            raise ParamsError(f"map: no parameter {self.name!r}; possible: {', '.join(parameters())}")
        if not self.values or not np.all(np.isfinite(self.values)):
            raise ParamsError(f"map: {self.name}: expected finite values, got {self.values}")

    @classmethod
    def parse(cls, text: str) -> "Axis":
        """From "NAME=FIRST:LAST:STEP", the last included, or "NAME=A,B,C".

        Raises:
            ParamsError: another form, or more than a million values.
        """
        name, _, numbers = text.partition("=")
        expected = f"map axis {text!r}: expected NAME=FIRST:LAST:STEP with a step > 0, or NAME=A,B,C"
        try:
            parts = [float(part) for part in numbers.split(":" if ":" in numbers else ",")]
        except ValueError:
            raise ParamsError(expected) from None
        if ":" not in numbers:
            return cls(name, tuple(parts))
        if len(parts) != 3 or not np.all(np.isfinite(parts)) or parts[2] <= 0.0 or parts[1] < parts[0]:
            raise ParamsError(expected)
        count = int(np.floor((parts[1] - parts[0]) / parts[2] + 1e-9)) + 1
        if count > MOST_POINTS:
            raise ParamsError(f"map axis {text!r}: expected at most {MOST_POINTS} values, got {count}")
        return cls(name, tuple((parts[0] + parts[2] * np.arange(count)).tolist()))


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """A figure over two parameters.

    Attributes:
        x, y: The axes.
        figure: What is mapped.
        values: (len(y), len(x)); NaN where a point could not be computed, or an unstable loop has no margins.
        radius: (len(y), len(x)) spectral radius; the loop is stable below 1.
        present: (x, y) of the loop that the map was made from.
        failed: What went wrong at points without a result.
    """

    x: Axis
    y: Axis
    figure: Figure
    values: FloatArray
    radius: FloatArray
    present: tuple[float, float]
    failed: tuple[str, ...] = ()

    @property
    def stable(self) -> BoolArray:
        """(len(y), len(x))."""
        return np.asarray(self.radius < 1.0)

    def to_json(self) -> dict[str, Any]:
        """Plain data; None for NaN."""
        return {
            "x": {"name": self.x.name, "values": list(self.x.values)},
            "y": {"name": self.y.name, "values": list(self.y.values)},
            "figure": self.figure,
            "values": json_value(self.values),
            "spectral_radius": json_value(self.radius),
            "present": list(self.present),
            "stable_share": float(np.mean(self.stable)),
            "failed": list(self.failed),
        }


def map_point(loop: JointLoop, figure: Figure, values: dict[str, float], seed: int) -> tuple[float, float]:
    """(figure, spectral radius) of one point; the seed is not used."""
    changed = with_values(loop, values)
    radius = changed.spectral_radius()
    if figure == "spectral_radius":
        return radius, radius
    return (float(getattr(changed.margins(), figure)) if radius < 1.0 else np.nan), radius


def stability_map(
    loop: JointLoop,
    x: Axis,
    y: Axis,
    figure: Figure = "spectral_radius",
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> StabilityMap:
    """A figure over two parameters, all else as in `loop`; K6 and K7 are kept when Kp or a model changes.

    Args:
        loop: The present setting, marked in the plot.
        x: First parameter.
        y: Second one.
        figure: "spectral_radius", or one of the margins.
        executor: As `sweep`.
        progress: Told how many points are done, and which share.

    Raises:
        ParamsError: the same parameter twice, an unknown figure, more than a million points, or none can be computed.
    """
    if figure not in get_args(Figure):
        raise ParamsError(f"map: no figure {figure!r}; possible: {', '.join(get_args(Figure))}")
    if x.name == y.name or len(x.values) * len(y.values) > MOST_POINTS:
        raise ParamsError(f"map: expected two parameters and at most {MOST_POINTS} points, got {x.name} and {y.name}")
    points = [{x.name: across, y.name: up} for up in y.values for across in x.values]
    failed: tuple[str, ...] = ()
    try:
        results = sweep(partial(map_point, loop, figure), points, executor=executor, progress=progress)
    except SweepError as error:
        failed = tuple(f"{_text(points[point.index])}: {point.why}" for point in error.failed)
        if all(result is None for result in error.results):
            raise ParamsError(f"map: no point can be computed; {failed[0]}") from error
        results = [(np.nan, np.nan) if result is None else result for result in error.results]
    grid = np.array(results, dtype=np.float64).reshape(len(y.values), len(x.values), 2)
    present = (value_of(loop, x.name), value_of(loop, y.name))
    return StabilityMap(x, y, figure, grid[..., 0], grid[..., 1], present, failed)


def _text(values: Mapping[str, float]) -> str:
    """As in "window = 40, kp = 2"."""
    return ", ".join(f"{name} = {value:g}" for name, value in values.items())


def draw_map(figure: Any, found: StabilityMap) -> None:
    """Draw into a matplotlib Figure: the figure as colour, the border of stability as a line, the present setting."""
    axes = figure.subplots()
    unit = {"delay_margin": "delay margin [ms]"}.get(found.figure, found.figure.replace("_", " "))
    shown = found.values * (1e3 if found.figure == "delay_margin" else 1.0)
    finite = shown[np.isfinite(shown)]
    high = float(np.quantile(finite, 0.95)) if finite.size else 1.0
    x, y = np.array(found.x.values), np.array(found.y.values)
    mesh = axes.pcolormesh(x, y, shown, shading="nearest", cmap="viridis", vmax=high)
    figure.colorbar(mesh, ax=axes, label=unit)
    if min(found.radius.shape) > 1 and np.unique(found.stable[np.isfinite(found.radius)]).size == 2:
        axes.contour(x, y, found.radius, levels=[1.0], colors="tab:red", linewidths=2.0)
    if np.all(np.isfinite(found.present)):
        axes.plot(*found.present, "*", color="tab:orange", markersize=14, label="present setting", clip_on=False)
        axes.legend(fontsize="small")
    axes.set(xlabel=found.x.name, ylabel=found.y.name, title="stable below 1; the line is the border")
    if found.figure != "spectral_radius":
        axes.set_title("white: unstable; the line is the border")
