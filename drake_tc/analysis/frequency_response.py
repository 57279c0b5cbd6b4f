"""The frequency response between two ports of a Diagram, measured in simulation: stepped sines and a lock-in.

At each frequency the diagram starts from the same state; at every tick k the input is held at

    u[k] = u_0 + a sin(2 pi f k dt)                    u_0: what comes there at the operating point

and the output is read before the events of the tick, as in `linearise`, whose C (z I - A)^-1 B + D is the same
quantity for a small a. After a time to settle, N ticks are taken whose halves hold a whole number of periods each.
The drift is the difference of the halves' means, which no harmonic has a part in; then

    y[k] - drift = c sin + d cos + e + rest,      H = (c + j d)/a,

with c, d by projection: neither offset, drift nor harmonics leak into H. `rest` is `distortion`: noise, and what is not
linear.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram

from drake_tc.analysis.margins import ComplexArray
from drake_tc.analysis.ports import cut_at, output_named
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Channel:
    """One element of a port.

    Attributes:
        port: "system:port".
        index: Which element.
    """

    port: str
    index: int = 0

    @property
    def name(self) -> str:
        """As it is written: "system:port[index]"."""
        return f"{self.port}[{self.index}]"


@dataclass(frozen=True)
class Sweep:
    """How a response is measured.

    Attributes:
        amplitude: a [unit of the input].
        settle: Time before the measurement [s]; two periods at least.
        measure: Time that is measured [s]; two periods at least.
        frequencies_hz: Wanted; the nearest that close after a whole number of ticks are taken.

    Raises:
        ParamsError: no frequency, or numbers that are not positive.
    """

    frequencies_hz: tuple[float, ...]
    amplitude: float = 1.0
    settle: float = 0.5
    measure: float = 1.0

    def __post_init__(self) -> None:
        if not self.frequencies_hz or not all(np.isfinite(f) and f > 0.0 for f in self.frequencies_hz):
            raise ParamsError(f"sweep: wanted positive frequencies [Hz]; got {self.frequencies_hz!r}")
        for name in ("amplitude", "measure"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ParamsError(f"sweep.{name}: wanted a positive number; got {getattr(self, name)!r}")
        if not 0.0 <= self.settle < np.inf:
            raise ParamsError(f"sweep.settle: wanted a time >= 0 [s]; got {self.settle!r}")


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """A response at F frequencies.

    Attributes:
        frequency_hz: (F,) as measured.
        response: (F,) H.
        distortion: (F,) RMS of what is not the fundamental over RMS of the fundamental; NaN where nothing was measured.
    """

    frequency_hz: FloatArray
    response: ComplexArray
    distortion: FloatArray

    @property
    def magnitude_db(self) -> FloatArray:
        """(F,) 20 log10 |H|."""
        return np.asarray(20.0 * np.log10(np.maximum(np.abs(self.response), 1e-300)))

    @property
    def phase(self) -> FloatArray:
        """(F,) arg H, unwrapped from the lowest frequency on [rad]."""
        return np.asarray(np.unwrap(np.angle(self.response)))


def channel(name: str) -> Channel:
    """The channel of "SYSTEM:PORT" (its first element) or "SYSTEM:PORT[i]".

    Raises:
        ParamsError: an index that is no whole number.
    """
    port, bracket, rest = name.partition("[")
    if not bracket:
        return Channel(name)
    if not (rest.endswith("]") and rest[:-1].isdigit()):
        raise ParamsError(f"port {name!r}: wanted SYSTEM:PORT or SYSTEM:PORT[i]")
    return Channel(port, int(rest[:-1]))


def swept_sine(
    diagram: Diagram,
    context: Context,
    dt: float,
    ports: tuple[Channel, Channel],
    sweep: Sweep,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """Measure H between two ports; see the module.

    Args:
        diagram: Whose response.
        context: Of it, with the state just before the events of a tick; not changed.
        dt: Period [s] of the ticks, of which the context's time is a multiple.
        ports: Input, cut off from what it is connected to (as in `linearise`), and output.
        sweep: Frequencies, amplitude, times.
        progress: Told what is done and which share.

    Raises:
        ParamsError: a port or element that is not there, a frequency beyond half the sampling rate.
        SimulationError: the diagram failed under a sine, or its output is not finite.
    """
    into, out = ports
    check_channels(diagram, context, ports)
    rows = []
    for number, wanted in enumerate(sweep.frequencies_hz):
        periods, ticks = _whole_periods(wanted, sweep.measure, dt)
        frequency = periods / (ticks * dt)
        settle = round(max(sweep.settle, 2.0 / frequency) / dt)
        u = sweep.amplitude * np.sin(2.0 * np.pi * frequency * dt * np.arange(settle + ticks))
        y = _driven(diagram, context, dt, (into, out), u)
        if not np.all(np.isfinite(y)):
            raise SimulationError(f"swept sine: {out.name} is not finite at {frequency:.3g} Hz")
        rows.append((frequency, *_lock_in(y[settle:], frequency, dt, settle, sweep.amplitude)))
        if progress:
            progress(f"{frequency:.2f} Hz", (number + 1) / len(sweep.frequencies_hz))
    found = np.array([row[0] for row in rows])
    return FrequencyResponse(found, np.array([row[1] for row in rows]), np.array([row[2] for row in rows]))


def check_channels(diagram: Diagram, context: Context, ports: Sequence[Channel]) -> None:
    """Refuse ports and elements that are not there.

    Raises:
        ParamsError: says what is possible.
    """
    into, out = ports
    sizes = (cut_at(diagram, context, into.port).value.size, output_named(diagram, out.port).size())
    for one, size in zip(ports, sizes, strict=True):
        if one.index >= size:
            raise ParamsError(f"port {one.name!r}: wanted an element 0 to {size - 1}; got {one.index}")


def _whole_periods(frequency: float, measure: float, dt: float) -> tuple[int, int]:
    """(periods, ticks), both even, that close near `frequency`, over `measure` [s] or two periods."""
    if frequency >= 0.4 / dt:
        raise ParamsError(f"swept sine: wanted frequencies below {0.4 / dt:g} Hz at dt = {dt:g} s; got {frequency:g}")
    half = max(1, round(0.5 * measure * frequency))
    return 2 * half, 2 * round(half / (frequency * dt))


def _driven(diagram: Diagram, context: Context, dt: float, ports: tuple[Channel, Channel], u: FloatArray) -> FloatArray:
    """(T,) of the output, under u (T,) on top of what is there."""
    into, out = ports
    simulator = Simulator(diagram, context.Clone())
    own: Any = simulator.get_mutable_context()
    cut, port = cut_at(diagram, own, into.port), output_named(diagram, out.port)
    reader = port.get_system().GetMyContextFromRoot(own)
    begin, value, y = round(own.get_time() / dt), cut.value.copy(), np.empty(u.size)
    simulator.Initialize(InitializeParams(suppress_initialization_events=True))
    try:
        for k in range(u.size):
            value[into.index] = cut.value[into.index] + u[k]
            cut.fix(own, value)
            y[k] = port.Eval(reader)[out.index]
            simulator.AdvanceTo((begin + k + 1) * dt)
    except (RuntimeError, SystemExit) as error:
        raise SimulationError(f"swept sine: the diagram failed: {' '.join(str(error).split())}") from error
    return y


def _lock_in(y: FloatArray, frequency: float, dt: float, first: int, amplitude: float) -> tuple[complex, float]:
    """(H, distortion) of the samples y (N,) from tick `first` of the sine on."""
    half = y.size // 2
    slope = (y[half:].mean() - y[:half].mean()) / half
    level = y - y.mean() - slope * (np.arange(y.size) - 0.5 * (y.size - 1))
    angle = 2.0 * np.pi * frequency * dt * np.arange(first, first + y.size)
    c, d = 2.0 * float(np.mean(level * np.sin(angle))), 2.0 * float(np.mean(level * np.cos(angle)))
    rest = level - c * np.sin(angle) - d * np.cos(angle)
    size = float(np.hypot(c, d))
    left = float(np.sqrt(2.0 * np.mean(rest**2)) / size) if size > 0.0 else float("nan")
    return complex(c, d) / amplitude, left


def bandwidth_hz(found: FrequencyResponse, drop_db: float = 3.0) -> float:
    """Lowest frequency [Hz] at which |H| has dropped by `drop_db` from 0 dB, between measured ones by their dB.

    Where it never does, the highest measured frequency: the bandwidth is at least that. 0 where the lowest is below.
    """
    below = np.flatnonzero(found.magnitude_db < -drop_db)
    if not below.size:
        return float(found.frequency_hz[-1])
    i = int(below[0])
    if i == 0:
        return 0.0
    f, m = np.log(found.frequency_hz[i - 1 : i + 1]), found.magnitude_db[i - 1 : i + 1]
    return float(np.exp(f[0] + (f[1] - f[0]) * (m[0] + drop_db) / (m[0] - m[1])))
