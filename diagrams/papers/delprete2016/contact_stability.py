"""The Kf at which force control goes unstable: predicted from one linearisation of the whole leg, and simulated.

The foot stands on its box as in `hrp2_leg_contact`, the force reference constant, drives in sliding. Kf multiplies what
comes in at `inverse_dynamics:contact_wrench`, so a loop that is cut there is linear in it: with L (6, 6) at Kf = 1 the
border is the smallest Kf > 0 at which an eigenvalue of Kf L(j omega) is -1.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from drake_tc.analysis.release import release, speed_states
from drake_tc.analysis.sampled import open_loop
from drake_tc.errors import SimulationError
from drake_tc.loops.torque.running import Loop, build_loop
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import sliding_scenario, torque_gains
from drake_tc.registry import diagram_entry
from drake_tc.types import FloatArray

PORT = "inverse_dynamics:contact_wrench"
SETTLED_AT, SETTLED_WITH = 1.4, 0.5
"""The loop comes to rest with this Kf by this time [s]."""
KICK, LASTS = 1e-3, 1.5
"""Of all joints [rad/s], and how long it is followed [s]."""
BAND = (10.0, 400.0)
"""Where the border is looked for [rad/s]."""
POINTS, ROUNDS, REACH = 160, 5, 1.6
"""Frequencies; bisections; the simulated border is looked for within this factor of the predicted one."""


@dataclass(frozen=True)
class ContactBorder:
    """The border of force control.

    Attributes:
        predicted, simulated: Kf [-].
        frequency_hz: Of the oscillation at the border, predicted.
    """

    predicted: float
    simulated: float
    frequency_hz: float


def standing() -> Scenario:
    """The foot pressed onto its box with a constant force."""
    scenario: Scenario = diagram_entry("hrp2_leg_contact").scenario("brisk_force_sine")
    force = {name: replace(spec, amplitude=(0.0,) * 6) for name, spec in scenario.force.items()}
    gains = replace(scenario.gains, kf=SETTLED_WITH)
    return replace(scenario, force=force, gains=gains, tare=0.1)


def settled(scenario: Scenario, at: float) -> tuple[Loop, Any]:
    """The scenario's loop with perfect sensors, and its context at a time, before the events of that tick.

    Args:
        scenario: What to build.
        at: A multiple of dt by which filters are full and the guard has let go of the start [s].

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: a solver failed on the way.
    """
    scenario = replace(scenario, sensors="perfect", duration=max(scenario.duration, at + 1.0))
    loop = build_loop(scenario)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    loop.start(context)
    try:
        simulator.Initialize()
        simulator.AdvanceTo(round(at / scenario.dt) * scenario.dt)
    except RuntimeError as error:
        raise SimulationError(f"the way to the operating point failed: {' '.join(str(error).split())}") from error
    return loop, context


def contact_border() -> ContactBorder:
    """Predict, then simulate."""
    with TemporaryDirectory() as folder:
        loop, context = settled(sliding_scenario(standing(), Path(folder)), SETTLED_AT)
        border, omega = predicted_border(loop, context)
        return ContactBorder(border, simulated_border(loop, context, border), omega / (2.0 * np.pi))


def predicted_border(loop: Loop, context: Any) -> tuple[float, float]:
    """(Kf, omega [rad/s]) of the border.

    Raises:
        SimulationError: none is found.
    """
    cut = open_loop(loop.diagram, context, loop.scenario.dt, PORT)
    omega = np.geomspace(*BAND, POINTS)
    loci = np.linalg.eigvals(-cut.response(omega) / SETTLED_WITH)
    found = [crossing for k in range(POINTS - 1) for crossing in _crossings(omega[k : k + 2], loci[k : k + 2])]
    if not found:
        raise SimulationError("contact: no Kf > 0 brings force control to its border")
    return min(found)


def _crossings(omega: FloatArray, loci: Any) -> list[tuple[float, float]]:
    """(Kf, omega) where an eigenvalue, followed to its nearest neighbour, crosses the negative real axis."""
    found = []
    for here in loci[0]:
        there = loci[1][np.argmin(np.abs(loci[1] - here))]
        if here.imag * there.imag < 0.0:
            share = here.imag / (here.imag - there.imag)
            real = here.real + share * (there.real - here.real)
            if real < 0.0:
                found.append((float(-1.0 / real), float(omega[0] + share * (omega[1] - omega[0]))))
    return found


def simulated_border(loop: Loop, context: Any, guess: float) -> float:
    """Kf between one at which a kick dies away and one at which it grows, by bisection.

    Raises:
        SimulationError: both ends of the search judge alike.
    """
    low, high = guess / REACH, guess * REACH
    if not dies_away(loop, context, low) or dies_away(loop, context, high):
        raise SimulationError(f"contact: no border between Kf = {low:.3g} and {high:.3g} in simulation")
    for _ in range(ROUNDS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if dies_away(loop, context, middle) else (low, middle)
    return float(np.sqrt(low * high))


def dies_away(loop: Loop, context: Any, kf: float) -> bool:
    """Whether a kick of all joints dies away at this Kf."""
    own = context.Clone()
    dynamics: Any = loop.diagram.GetSubsystemByName("inverse_dynamics")
    scenario = replace(loop.scenario, gains=replace(loop.scenario.gains, kf=kf))
    dynamics.set_gains(dynamics.GetMyMutableContextFromRoot(own), torque_gains(scenario, loop.robot))
    speeds = speed_states(loop, own)
    return release(loop.diagram, own, scenario.dt, dict.fromkeys(speeds, KICK), LASTS).stable
