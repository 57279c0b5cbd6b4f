"""`linearise`: a Diagram as the linear sampled system x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k].

x is the complete state just before the events of a tick (`StateCoordinates`), F its map over one control period: the
events of the tick, then everything up to the next tick, plant steps and faster updates included. A, B, C, D are central
differences of F and of the outputs; where the difference forwards is not the difference backwards the map has a kink
there (dry friction at rest, the edge of a dead zone, a limit), and the state is named in `kinks`.

One control period of a Diagram as a function of state and inputs, and its derivatives by central differences.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram
from scipy.sparse import csc_matrix, identity
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from drake_tc.analysis.state_coordinates import Cut, StateCoordinates, cut_at, output_named
from drake_tc.control.stability_margins import ComplexArray, Margins, frequency_grid, margins
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.types import BoolArray, FloatArray

KINK = 1e-2
"""Forward and backward differences that disagree by this share of the larger are a kink."""
FINE = 20
"""Integration steps a period, where there are continuous states."""
ROUNDING = 1e-13
"""Of F, as a share of its value."""


class SamplingPeriod:
    """F and the outputs, as one function of state and inputs."""

    def __init__(self, diagram: Diagram, context: Context, dt: float, cuts: list[Cut], ports: list[Any]) -> None:
        tick = round(context.get_time() / dt)
        if abs(context.get_time() / dt - tick) > 1e-6:
            raise ParamsError(
                f"linearise: expected a time that is a multiple of dt = {dt:g} s, got {context.get_time():g} s"
            )
        self._diagram, self._cuts, self._ports = diagram, cuts, ports
        self._start, self._end = tick * dt, (tick + 1) * dt
        self.base: Any = context.Clone()
        self.base.SetTime(self._start)
        self.coordinates = StateCoordinates(diagram, self.base)
        self._simulator = Simulator(diagram, context.Clone())
        if self.base.num_continuous_states():  # steps that adapt are not a smooth function of the state
            integrator = self._simulator.get_mutable_integrator()
            integrator.set_fixed_step_mode(True)
            integrator.set_maximum_step_size(dt / FINE)
            integrator.request_initial_step_size_target(dt / FINE)  # the default may be longer, which Drake refuses
        self._quiet = InitializeParams(suppress_initialization_events=True)
        self._last = self.coordinates.read(self.base)

    def after(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """[x[k+1]; y[k]]."""
        context = self._simulator.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self.base)
        for block in self.coordinates.blocks:
            part = slice(block.first, block.first + block.size)
            if not np.array_equal(x[part], self._last[part]):
                block.write(context, x[part])
        at = 0
        for cut in self._cuts:
            cut.fix(context, u[at : at + cut.value.size])
            at += cut.value.size
        try:
            y = [np.array(port.Eval(port.get_system().GetMyContextFromRoot(context))) for port in self._ports]
            self._simulator.Initialize(self._quiet)
            self._simulator.AdvanceTo(self._end)
        except (RuntimeError, SystemExit) as error:
            raise SimulationError(f"linearise: the period from {self._start:g} s failed: {error}") from error
        return np.concatenate([self.coordinates.read(context), *y])


def differences(period: SamplingPeriod, x: FloatArray, u: FloatArray, step: float) -> tuple[FloatArray, BoolArray]:
    """Derivatives of [x[k+1]; y[k]] by [x; u], and by which of these the map has a kink."""
    at, middle = np.concatenate((x, u)), period.after(x, u)
    table, rough = np.empty((middle.size, at.size)), np.zeros(at.size, dtype=np.bool_)
    for j in range(at.size):
        width = step * max(1.0, abs(at[j]))
        sides = []
        for way in (width, -width):
            moved = at.copy()
            moved[j] += way
            sides.append((period.after(moved[: x.size], moved[x.size :]) - middle) / way)
        table[:, j] = 0.5 * (sides[0] + sides[1])
        largest = np.maximum(np.abs(sides[0]), np.abs(sides[1]))
        rounding = ROUNDING * np.maximum(1.0, np.abs(middle)) / width
        rough[j] = np.any(np.abs(sides[0] - sides[1]) > KINK * largest + rounding)
    return table, rough


STEP = 1e-5
"""Of the differences, times max(1, |x|)."""
DRIFT = 1e-5
"""Eigenvalues as close to 1 belong to what stays where it is put."""
SINGULAR = 1e12
"""Condition number from which on an algebraic loop has no solution."""
NEGLIGIBLE = 1e-9
"""Entries of A below this share of its largest are rounding errors of the differences."""


@dataclass(frozen=True, eq=False)
class SampledSystem:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k].

    Attributes:
        a, b, c, d: (n, n), (n, m), (p, n), (p, m).
        dt: Period [s].
        states, inputs, outputs: Names.
        kinks: States in whose direction the map is not smooth.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    dt: float
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    kinks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in (("a", (n, n)), ("b", (n, m)), ("c", (p, n)), ("d", (p, m))):
            if getattr(self, name).shape != shape:
                raise ParamsError(
                    f"SampledSystem.{name}: expected shape {shape}, as the names say, got {getattr(self, name).shape}"
                )
            if not np.all(np.isfinite(getattr(self, name))):
                raise ParamsError(f"SampledSystem.{name}: expected finite numbers")
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise ParamsError(f"SampledSystem.dt: expected a positive period [s], got {self.dt!r}")

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """(n,) of A, largest first; of each part of A that no loop connects with the others by itself."""
        groups = self._groups
        found = [np.linalg.eigvals(self.a[np.ix_(group, group)]) for group in groups if group.size > 1]
        single = [self.a[group[0], group[0]] for group in groups if group.size == 1]
        values = np.concatenate([*found, np.array(single, dtype=np.float64)]).astype(np.complex128)
        return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])

    @cached_property
    def spectral_radius(self) -> float:
        """Largest modulus of the eigenvalues; 0 without states."""
        return float(np.abs(self.eigenvalues).max(initial=0.0))

    def moving(self, tolerance: float = DRIFT) -> ComplexArray:
        """The eigenvalues, largest first, but for those within `tolerance` of 1.

        A joint that nothing holds in position has one: it rests anywhere.
        """
        return np.asarray(self.eigenvalues[np.abs(self.eigenvalues - 1.0) > tolerance])

    def radius_but_for_drift(self, tolerance: float = DRIFT) -> float:
        """Largest modulus of those `moving`."""
        return float(np.abs(self.moving(tolerance)).max(initial=0.0))

    def response(self, omega: FloatArray) -> ComplexArray:
        """(W, p, m) C (z I - A)^-1 B + D at z = exp(j omega dt), omega (W,) [rad/s]."""
        keep, a, b, c = self._reachable
        out = np.empty((np.size(omega), len(self.outputs), len(self.inputs)), dtype=np.complex128)
        unit = identity(keep.size, dtype=np.complex128, format="csc")
        for k, w in enumerate(np.atleast_1d(omega)):
            solved = splu(np.exp(1j * w * self.dt) * unit - a).solve(b) if keep.size else b
            out[k] = c @ solved + self.d
        return out

    def channel(self, name: str | int) -> int:
        """Index of an input: "system:port[i]", "system:port" for its first element, or the index itself.

        Raises:
            ParamsError: there is no such input.
        """
        if isinstance(name, int) and 0 <= name < len(self.inputs):
            return name
        full = name if isinstance(name, int) or name.endswith("]") else f"{name}[0]"
        if full not in self.inputs:
            raise ParamsError(f"channel {name!r}: expected one of {', '.join(self.inputs)}, or its number")
        return self.inputs.index(full)

    def loop_responses(self, omega: FloatArray) -> ComplexArray:
        """(W, m) L of every channel of a loop that was cut (`open_loop`), for negative feedback, the others closed.

            L_i = -(G_ii + G_io (1 - G_oo)^-1 G_oi),   G = `response`, o: the other channels

        One solve a frequency serves all channels; closing the others in A would fill a sparse matrix.
        """
        opened = self.response(omega)
        m = len(self.inputs)
        out = np.empty(opened.shape[:2], dtype=np.complex128)
        for i in range(m):
            others = [k for k in range(m) if k != i]
            around = np.eye(m - 1) - opened[:, others][:, :, others]
            through = np.linalg.solve(around, opened[:, others, i : i + 1])
            out[:, i] = -(opened[:, i, i] + (opened[:, i : i + 1, others] @ through)[:, 0, 0])
        return out

    def loop_response(self, channel: int | str = 0) -> Callable[[FloatArray], ComplexArray]:
        """L of one channel, an index or "system:port[i]": a column of `loop_responses`."""
        index = self.channel(channel)
        return lambda omega: self.loop_responses(np.atleast_1d(omega))[:, index]

    def closed(self, channels: Sequence[int] | None = None) -> "SampledSystem":
        """u_i = y_i for the channels i (None: all); the other inputs and outputs stay.

        Raises:
            ParamsError: a loop that is algebraic and has no solution.
        """
        shut = list(range(len(self.inputs))) if channels is None else list(channels)
        left = [i for i in range(len(self.inputs)) if i not in shut]
        around = np.eye(len(shut)) - self.d[np.ix_(shut, shut)]
        if shut and np.linalg.cond(around) > SINGULAR:
            raise ParamsError("closed: expected a loop with one solution; this one is algebraic and singular")
        from_x, from_u = np.linalg.solve(around, self.c[shut]), np.linalg.solve(around, self.d[np.ix_(shut, left)])
        rows = [i for i in range(len(self.outputs)) if i not in shut]
        return SampledSystem(
            self.a + self.b[:, shut] @ from_x,
            self.b[:, left] + self.b[:, shut] @ from_u,
            self.c[rows] + self.d[np.ix_(rows, shut)] @ from_x,
            self.d[np.ix_(rows, left)] + self.d[np.ix_(rows, shut)] @ from_u,
            self.dt,
            self.states,
            tuple(self.inputs[i] for i in left),
            tuple(self.outputs[i] for i in rows),
            self.kinks,
        )

    @cached_property
    def _links(self) -> Any:
        """A without what is rounding error, sparse."""
        small = np.abs(self.a) <= NEGLIGIBLE * np.abs(self.a).max(initial=0.0)
        return csc_matrix(np.where(small, 0.0, self.a))

    @cached_property
    def _groups(self) -> list[Any]:
        count, label = connected_components(self._links, directed=True, connection="strong")
        order = np.argsort(label, kind="stable")
        return np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1]) if count else []

    @cached_property
    def _reachable(self) -> tuple[Any, Any, ComplexArray, ComplexArray]:
        """States that B reaches and C sees; A, B, C of these."""
        links = self._links
        reached = _spread(links, np.any(self.b != 0.0, axis=1))
        seen = _spread(links.T.tocsc(), np.any(self.c != 0.0, axis=0))
        keep = np.flatnonzero(reached & seen)
        a = csc_matrix(self.a[np.ix_(keep, keep)], dtype=np.complex128)
        return keep, a, self.b[keep].astype(np.complex128), self.c[:, keep].astype(np.complex128)


def _spread(links: Any, start: Any) -> Any:
    """What can be reached along the links (row from column) from where `start` is true."""
    reached = start.copy()
    while True:
        further = reached | (np.abs(links) @ reached.astype(np.float64) > 0.0)
        if np.array_equal(further, reached):
            return reached
        reached = further


def linearise(
    diagram: Diagram,
    context: Context,
    dt: float,
    *,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    step: float = STEP,
) -> SampledSystem:
    """The period map of the complete state (discrete, continuous, delays) and of named ports, at one operating point.

    Constants, states that F leaves alone whatever they are (a bias that was measured once), are left out.

    Args:
        diagram: Whose loop.
        context: Of it, with the state just before the events of a tick; not changed.
        dt: Control period [s], of which the context's time is a multiple.
        inputs: "system:port", vector ports. An input port is cut off from what it is connected to, an output port from
            everything that reads it; the input u is held there over the period.
        outputs: "system:port" of output ports, or of input ports for what comes in there; read at the tick.
        step: Of the differences, times max(1, |x|).

    Raises:
        ParamsError: a port that is not there, a time that is no tick, a state that cannot be linearised (noise,
            quantisation, a guard that is not in its normal mode).
        SimulationError: a period that could not be simulated.

    Example:
        >>> diagram = small_loop()
        >>> period_map = linearise(diagram, diagram.CreateDefaultContext(), 0.01)
        >>> round(period_map.spectral_radius, 3)
        0.9
    """
    if not 0.0 < dt < np.inf:
        raise ParamsError(f"linearise: expected a positive period dt [s], got {dt!r}")
    cuts = [cut_at(diagram, context, name) for name in inputs]
    ports = [output_named(diagram, name) for name in outputs]
    period = SamplingPeriod(diagram, context, dt, cuts, ports)
    x, u = period.coordinates.read(period.base), np.concatenate([np.zeros(0), *(cut.value for cut in cuts)])
    table, rough = differences(period, x, u, step)
    n, m = x.size, u.size
    names = (*period.coordinates.names, *(f"{cut.name}[{i}]" for cut in cuts for i in range(cut.value.size)))
    live = np.flatnonzero(~np.all(table[:n] == np.eye(n, n + m), axis=1))
    keep = np.concatenate((live, np.arange(n, n + m)))
    return SampledSystem(
        table[np.ix_(live, live)],
        table[live, n:],
        table[n:, live],
        table[n:, n:],
        dt,
        tuple(names[i] for i in live),
        names[n:],
        tuple(f"{name}[{i}]" for name, port in zip(outputs, ports, strict=True) for i in range(port.size())),
        tuple(names[i] for i in keep if rough[i]),
    )


def open_loop(
    diagram: Diagram, context: Context, dt: float, port: str, *, relative_to: str | None = None
) -> SampledSystem:
    """The loop cut open at a port: u goes in there, y is what would have come; closed again it is u = y.

    With `relative_to`, a port with r, the cut is at the difference: u + r goes in, and y is what would have come less
    r. A position servo's effort q_d - q is "torque_control:command" relative to "torque_control:position".

    Args:
        diagram: As `linearise`; so are `context` and `dt`.
        context: See there.
        dt: See there.
        port: "system:port", an output port (all that it feeds is cut) or an input port (that one wire).
        relative_to: "system:port" of the same size, whose connections stay.

    Raises:
        ParamsError, SimulationError: as `linearise`; a port of another size.

    Example:
        >>> diagram = small_loop()
        >>> cut = open_loop(diagram, diagram.CreateDefaultContext(), 0.01, "gain:y0")
        >>> cut.inputs
        ('gain:y0[0]',)
    """
    if relative_to is None:
        return linearise(diagram, context, dt, inputs=(port,), outputs=(port,))
    found = linearise(diagram, context, dt, inputs=(port,), outputs=(port, relative_to))
    m = len(found.inputs)
    if len(found.outputs) != 2 * m:
        raise ParamsError(
            f"relative_to: expected a port of size {m}, as {port} has, got {relative_to} of size"
            f" {len(found.outputs) - m}"
        )
    around = np.eye(m) - found.d[m:]
    if np.linalg.cond(around) > SINGULAR:
        raise ParamsError(f"relative_to: {relative_to} follows {port} within the tick, so that nothing is left to cut")
    from_x, from_u = np.linalg.solve(around, found.c[m:]), np.linalg.inv(around)
    difference, direct = found.c[:m] - found.c[m:], found.d[:m] - found.d[m:]
    return replace(
        found,
        a=found.a + found.b @ from_x,
        b=found.b @ from_u,
        c=difference + direct @ from_x,
        d=direct @ from_u,
        outputs=found.outputs[:m],
    )


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

    Example:
        >>> diagram = small_loop()
        >>> cut = open_loop(diagram, diagram.CreateDefaultContext(), 0.01, "gain:y0")
        >>> round(loop_margins(cut)["gain:y0[0]"].gain_margin, 2)
        20.0
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
