"""The frequency response between two ports of a Diagram, measured in simulation: stepped sines and a lock-in.

At each frequency the diagram starts from the same state; at every tick k the input is held at

    u[k] = u_0 + a sin(2 pi f k dt)                    u_0: what comes there at the operating point

and the output is read before the events of the tick, as in `linearise`, whose C (z I - A)^-1 B + D is the same
quantity for a small a. After a time to settle, N ticks are taken whose halves hold a whole number of periods each.
The drift is the difference of the halves' means, which no harmonic has a part in; then

    y[k] - drift = c sin + d cos + e + rest,      H = (c + j d)/a,

with c, d by projection: neither offset, drift nor harmonics leak into H. `rest` is `distortion`: noise, and what is not
linear. The halves' own H differ (`apart`) where it has not settled, or grows.

On which turn a phase is: followed from near 0 Hz on a grid that is refined until no step turns far.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram

from drake_tc.analysis.state_coordinates import cut_at, output_named
from drake_tc.config.records import Checked, FromZero, Positive
from drake_tc.control.stability_margins import ComplexArray
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.types import BoolArray, FloatArray

EVEN, BY_RATIO = 400, 60
"""Points of the first grid: evenly spaced, for delays, and by their logarithm, for what happens at low frequencies."""
LARGEST_STEP = np.pi / 4.0
"""Between neighbours [rad]."""
ROUNDS = 12
"""Of halving where a step is larger: as narrow as 1/4000 of the first grid's."""


def continuous_phase(response: Callable[[FloatArray], ComplexArray], frequency_hz: FloatArray) -> FloatArray:
    """(F,) arg H [rad] without jumps from a thousandth of the lowest frequency on, where it is in [-pi, pi).

    Args:
        response: H (G,) at frequencies (G,) [Hz].
        frequency_hz: (F,) > 0 [Hz].
    """
    low, top = 1e-3 * float(frequency_hz.min()), float(frequency_hz.max())
    grid = np.unique(np.concatenate([np.linspace(low, top, EVEN), np.geomspace(low, top, BY_RATIO), frequency_hz]))
    h = response(grid)
    for _ in range(ROUNDS):
        wide = np.flatnonzero(np.abs(np.angle(h[1:] * np.conj(h[:-1]))) > LARGEST_STEP)
        if not wide.size:
            break
        middle = 0.5 * (grid[wide] + grid[wide + 1])
        h = np.insert(h, wide + 1, response(middle))
        grid = np.insert(grid, wide + 1, middle)
    phase = np.unwrap(np.angle(h))
    if phase[0] > np.pi - 1e-9:
        phase = phase - 2.0 * np.pi
    return np.asarray(phase[np.searchsorted(grid, frequency_hz)])


def nearest_turn(phase: FloatArray, reference: FloatArray) -> FloatArray:
    """The same angles [rad], by whole turns as near as can be to a reference; one that is NaN changes nothing."""
    turns = np.round((reference - phase) / (2.0 * np.pi))
    return np.asarray(phase + 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0))


Progress = Callable[[str, float], None]
FASTEST = 0.4
"""Highest frequency, times dt."""
STEADY_APART, STEADY_DISTORTION = 0.05, 1.0
"""Halves further apart, or more rest than fundamental, are no steady sine."""


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
class Sweep(Checked):
    """How a response is measured.

    Attributes:
        amplitude: a [unit of the input].
        settle: Time before the measurement [s]; two periods at least.
        measure: Time that is measured [s]; two periods at least.
        frequencies_hz: Requested; the nearest that close after a whole number of ticks are taken.

    Raises:
        ParamsError: no frequency, or numbers that are not positive.
    """

    frequencies_hz: tuple[float, ...]
    amplitude: Positive = 1.0
    settle: FromZero = 0.5
    measure: Positive = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.frequencies_hz or not all(np.isfinite(f) and f > 0.0 for f in self.frequencies_hz):
            raise ParamsError(f"frequencies_hz: expected positive frequencies [Hz], got {self.frequencies_hz!r}")

    def check(self, dt: float) -> None:
        """Refuse what cannot be sampled every dt [s].

        Raises:
            ParamsError: a frequency of 0.4/dt or more.
        """
        for frequency in self.frequencies_hz:
            if frequency >= FASTEST / dt:
                raise ParamsError(
                    f"swept sine: expected frequencies below {FASTEST / dt:g} Hz at dt = {dt:g} s, got {frequency:g}"
                )


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """A response at F frequencies.

    Attributes:
        frequency_hz: (F,) as measured.
        response: (F,) H.
        distortion: (F,) RMS of what is not the fundamental over RMS of the fundamental; NaN where nothing was measured.
        apart: (F,) how far the H of the measurement's halves are apart, over |H|; None where nothing was measured.
        turned: (F,) arg H [rad] with its whole turns, where these are known.
    """

    frequency_hz: FloatArray
    response: ComplexArray
    distortion: FloatArray
    apart: FloatArray | None = None
    turned: FloatArray | None = None

    @property
    def magnitude_db(self) -> FloatArray:
        """(F,) 20 log10 |H|; minus infinity for 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(20.0 * np.log10(np.abs(self.response)))

    @property
    def phase(self) -> FloatArray:
        """(F,) arg H [rad]: with its turns where they are known, else in (-pi, pi]."""
        return np.asarray(np.angle(self.response)) if self.turned is None else self.turned

    @property
    def steady(self) -> BoolArray:
        """(F,) whether a steady sine was measured; true where nothing was."""
        apart = np.zeros(self.distortion.size) if self.apart is None else self.apart
        return np.asarray(~(self.distortion > STEADY_DISTORTION) & ~(apart > STEADY_APART))

    def unwrapped(self) -> "FrequencyResponse":
        """With turns from the lowest frequency on: right if it begins in (-pi, pi] and no step turns by pi or more."""
        return replace(self, turned=np.asarray(np.unwrap(np.angle(self.response))))

    def near(self, phase: FloatArray) -> "FrequencyResponse":
        """With the turns that bring it nearest to a phase (F,) [rad]."""
        return replace(self, turned=nearest_turn(np.angle(self.response), phase))


@dataclass(frozen=True)
class Bandwidth:
    """Where a response has dropped from about 1.

    Attributes:
        hz: [Hz].
        at_least: It never drops in what was measured: `hz` is the highest measured frequency.
    """

    hz: float
    at_least: bool


def channel(name: str) -> Channel:
    """The channel of "SYSTEM:PORT" (its first element) or "SYSTEM:PORT[i]".

    Raises:
        ParamsError: an index that is no whole number.

    Example:
        >>> channel("guard:command[2]").index
        2
    """
    port, bracket, rest = name.partition("[")
    if not bracket:
        return Channel(name)
    if not (rest.endswith("]") and rest[:-1].isascii() and rest[:-1].isdecimal()):
        raise ParamsError(f"port {name!r}: expected SYSTEM:PORT or SYSTEM:PORT[i]")
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
        ParamsError: a port or element that is not there, a frequency of 0.4/dt or more.
        SimulationError: the diagram failed under a sine, or its output is not finite.

    Example:
        >>> diagram = small_loop()
        >>> ports = channel("gain:y0"), channel("integrator:y0")
        >>> sweep = Sweep((1.0,), amplitude=0.1, settle=0.1, measure=1.0)
        >>> found = swept_sine(diagram, diagram.CreateDefaultContext(), 0.01, ports, sweep)
        >>> found.frequency_hz
        array([1.])
    """
    into, out = ports
    check_channels(diagram, context, ports)
    sweep.check(dt)
    rows = []
    for number, requested in enumerate(sweep.frequencies_hz):
        periods, ticks = _whole_periods(requested, sweep.measure, dt)
        frequency = periods / (ticks * dt)
        settle = round(max(sweep.settle, 2.0 / frequency) / dt)
        u = sweep.amplitude * np.sin(2.0 * np.pi * frequency * dt * np.arange(settle + ticks))
        y = _driven(diagram, context, dt, (into, out), u)
        if not np.all(np.isfinite(y)):
            raise SimulationError(f"swept sine: {out.name} is not finite at {frequency:.3g} Hz")
        rows.append((frequency, *_lock_in(y[settle:], frequency, dt, settle, sweep.amplitude)))
        if progress:
            progress(f"{frequency:.2f} Hz", (number + 1) / len(sweep.frequencies_hz))
    frequencies, response, distortion, apart = (np.array(column) for column in zip(*rows, strict=True))
    return FrequencyResponse(frequencies, response, distortion, apart)


def check_channels(diagram: Diagram, context: Context, ports: Sequence[Channel]) -> None:
    """Refuse ports and elements that are not there.

    Raises:
        ParamsError: says what is possible.
    """
    into, out = ports
    sizes = (cut_at(diagram, context, into.port).value.size, output_named(diagram, out.port).size())
    for one, size in zip(ports, sizes, strict=True):
        if one.index >= size:
            raise ParamsError(f"port {one.name!r}: expected an element 0 to {size - 1}, got {one.index}")


def _whole_periods(frequency: float, measure: float, dt: float) -> tuple[int, int]:
    """(periods, ticks), both even, that close near `frequency`, over `measure` [s] or two periods."""
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


def _lock_in(y: FloatArray, frequency: float, dt: float, first: int, amplitude: float) -> tuple[complex, float, float]:
    """(H, distortion, apart) of the samples y (N,) from tick `first` of the sine on."""
    half = y.size // 2
    slope = (y[half:].mean() - y[:half].mean()) / half
    level = y - y.mean() - slope * (np.arange(y.size) - 0.5 * (y.size - 1))
    angle = 2.0 * np.pi * frequency * dt * np.arange(first, first + y.size)
    turned = 2.0 * level * np.exp(-1j * angle) * 1j  # its mean is c + j d
    h = complex(turned.mean())
    rest = level - h.real * np.sin(angle) - h.imag * np.cos(angle)
    size = abs(h)
    if size == 0.0:
        return 0j, float("nan"), float("nan")
    left = float(np.sqrt(2.0 * np.mean(rest**2)) / size)
    return h / amplitude, left, float(abs(turned[half:].mean() - turned[:half].mean()) / size)


DROP_DB = 3.0
"""Of |H| at the end of the bandwidth [dB]."""


def bandwidth(found: FrequencyResponse) -> Bandwidth | None:
    """Lowest frequency at which |H| has dropped by `DROP_DB` from 0 dB, between measured ones by their dB.

    None where |H| is not within `DROP_DB` of 0 dB at the lowest frequency: H then is not about 1.
    """
    if abs(found.magnitude_db[0]) > DROP_DB:
        return None
    below = np.flatnonzero(found.magnitude_db < -DROP_DB)
    if not below.size:
        return Bandwidth(float(found.frequency_hz[-1]), at_least=True)
    i = int(below[0])
    f, m = np.log(found.frequency_hz[i - 1 : i + 1]), np.maximum(found.magnitude_db[i - 1 : i + 1], -1e3)
    return Bandwidth(float(np.exp(f[0] + (f[1] - f[0]) * (m[0] + DROP_DB) / (m[0] - m[1]))), at_least=False)
