"""The torque laws of paper C's figures, tuned by one rule, and their scenarios.

The rule: as much gain as leaves a sensitivity peak of at most 2 and a delay margin of at least 5 ms (a third of the
delay that the loop has already), the loop cut at the voltage, the joint clamped, dry friction sliding, the controllers'
models off as in the scenario. Gain is kp for the laws with P, the observer's K without P for the momentum observer, as
it was published, and kp and ki together for PI, whose zero stands on the clamped joint's slow pole (7.7 rad/s).
`margins_of` computes what each law has; a test holds the rule.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import yaml
from drake_tc.diagrams.registry import sea_entry
from drake_tc.diagrams.runs.settled import settled_at
from drake_tc.diagrams.sea.linear import sliding_sea
from drake_tc.diagrams.sea.scenario import SeaScenario

from drake_tc.analysis.frequency_response import Channel
from drake_tc.analysis.margins import Margins, frequency_grid, margins
from drake_tc.analysis.sampled import open_loop
from drake_tc.errors import SimulationError

OBSERVER, MOMENTUM, PI = "observer + P", "momentum observer", "PI"
PREDICTED = "observer + P, predictor"
WHOLE = "observer + P, predictor over the whole delay"
LAWS: Mapping[str, Mapping[str, Any]] = {
    OBSERVER: {"mode": "observer", "kp": 4.0},
    "last step's friction + P": {"mode": "observer_as_printed", "kp": 4.0},
    "feedforward": {"mode": "feedforward"},
    "feedforward + P": {"mode": "feedforward_p", "kp": 8.6},
    MOMENTUM: {"mode": "momentum_observer", "kp": 0.0, "momentum_gain": 63.0},
    "momentum observer + P": {"mode": "momentum_observer", "kp": 2.0, "momentum_gain": 46.0},
    PI: {"mode": "pi", "kp": 5.4, "ki": 41.5},
    PREDICTED: {"mode": "observer", "kp": 4.0, "horizon": 0.008},
    WHOLE: {"mode": "observer", "kp": 4.0, "horizon": 0.015},
}
"""Name to what it changes of the scenario's `control`; the rest all share."""
LARGEST_PEAK, LEAST_DELAY_MARGIN = 2.0, 5e-3
INPUT, OUTPUT = Channel("reference:y0"), Channel("actuators:transmitted_torque")


def with_law(name: str, scenario: str, seed: int = 0, **changes: Any) -> SeaScenario:
    """A committed scenario of the joint under a law.

    Args:
        name: Of LAWS.
        scenario: Of the scenario file.
        seed: Of all random numbers.
        **changes: Laid over the scenario, as its YAML.
    """
    text = yaml.safe_dump({"control": dict(LAWS[name]), **changes})
    found: SeaScenario = sea_entry().scenario(scenario, text=text).changed(seed=seed)
    return found


def at_rest(scenario: SeaScenario) -> SeaScenario:
    """The scenario with no torque wanted: where responses are measured from."""
    return replace(scenario, wanted=replace(scenario.wanted, offset=0.0, amplitude=0.0))


def margins_of(name: str) -> Margins:
    """Of a law on the clamped joint, cut at the voltage.

    Raises:
        SimulationError: the closed loop is unstable.
    """
    plain = sliding_sea(at_rest(with_law(name, "held")))
    loop, context = settled_at(sea_entry(), plain, 0.2, (INPUT, OUTPUT))
    cut = open_loop(loop.diagram, context, plain.dt, "torque_control:voltage")
    if not cut.closed().radius_but_for_drift() < 1.0:
        raise SimulationError(f"law {name!r}: wanted a stable loop; its spectral radius is not below 1")
    return margins(cut.loop_response(0), plain.dt, frequency_grid(plain.dt, 0.5, 400))
