"""The torque laws in the figures of Faraji et al. (2015), tuned by one rule, and their scenarios.

The rule: as much gain as leaves a sensitivity peak of at most 2 and a delay margin of at least 5 ms (a third of the
delay that the loop has already), the loop cut at the voltage, the joint clamped, dry friction sliding, the controllers'
models off as in the scenario. Gain is kp for the laws with P, the observer's K without P for the momentum observer, as
it was published, and kp and ki together for PI, whose zero stands on the clamped joint's slow pole (7.7 rad/s).
The feedforward alone has no gain to tune by it, and breaks it: its speed feedback (20 rad/s) leaves a peak of 3.84.
`margins_of` computes what each law has; a test holds the rule, and that a tenth more gain breaks it.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import yaml

from drake_tc.analysis.frequency_response import Channel
from drake_tc.analysis.release import settled_at
from drake_tc.analysis.sampled import open_loop
from drake_tc.control.stability_margins import Margins, frequency_grid, margins
from drake_tc.errors import SimulationError
from drake_tc.loops.series_elastic.scenario import SeaScenario, sliding_sea
from drake_tc.registry import sea_entry

OBSERVER, MOMENTUM, PI = "observer + P", "momentum observer", "PI"
PREDICTED = "observer + P, predictor"
WHOLE = "observer + P, predictor over the whole delay"
LAWS: dict[str, Mapping[str, Any]] = {
    OBSERVER: {"mode": "observer", "kp": 4.0},
    "last step's friction + P": {"mode": "last_step_friction", "kp": 4.0},
    "feedforward": {"mode": "feedforward"},
    "feedforward + P": {"mode": "feedforward_p", "kp": 8.6},
    MOMENTUM: {"mode": "momentum_observer", "kp": 0.0, "momentum_gain": 63.0},
    "momentum observer + P": {"mode": "momentum_observer", "kp": 2.0, "momentum_gain": 46.0},
    PI: {"mode": "pi", "kp": 5.4, "ki": 41.5},
    PREDICTED: {"mode": "observer", "kp": 4.0, "horizon": 0.008},
    WHOLE: {"mode": "observer", "kp": 4.0, "horizon": 0.015},
}
"""Name to what it changes of the scenario's `control`; the rest all share."""
NO_GAIN = "feedforward"
"""The law that the rule cannot tune."""
GAINS: Mapping[str, tuple[str, ...]] = {MOMENTUM: ("momentum_gain",), PI: ("kp", "ki")}
"""What counts as a law's gain, where it is not kp alone."""
PRINTED, SLOWER = "nearer to the printed law", "momentum observer, K = 30"
BESIDE: dict[str, Mapping[str, Any]] = {
    PRINTED: {
        "mode": "last_step_friction",
        "kp": 0.3,
        "speed_bandwidth": 1000.0,
        "reference_window": 0.0,
        "spring_time": 0.0,
    },
    SLOWER: {"mode": "momentum_observer", "kp": 0.0, "momentum_gain": 30.0},
}
"""Laws to compare with that the rule has not tuned. The first has the last step's friction, the measured speed and no
spring terms, as printed; it keeps the voltage that was felt and P against the torque of a delay ago, without which it
is unstable or worse."""
LARGEST_PEAK, LEAST_DELAY_MARGIN = 2.0, 5e-3
INPUT, OUTPUT = Channel("reference:y0"), Channel("actuators:transmitted_torque")


def with_law(name: str, scenario: str, seed: int = 0, **changes: Any) -> SeaScenario:
    """A committed scenario of the joint under a law.

    Args:
        name: Of LAWS or BESIDE.
        scenario: Of the scenario file.
        seed: Of all random numbers.
        **changes: Laid over the scenario, as its YAML.
    """
    control = {**(LAWS | BESIDE)[name], **changes.pop("control", {})}
    text = yaml.safe_dump({"control": control, **changes})
    found: SeaScenario = sea_entry().scenario(scenario, text=text).changed(seed=seed)
    return found


def at_rest(scenario: SeaScenario) -> SeaScenario:
    """The scenario with a reference of zero: where responses are measured from."""
    return replace(scenario, reference=replace(scenario.reference, offset=0.0, amplitude=0.0))


def margins_of(name: str, factor: float = 1.0) -> Margins:
    """Of a law on the clamped joint, cut at the voltage.

    Args:
        name: Of LAWS.
        factor: On its gain, see GAINS.

    Raises:
        SimulationError: the closed loop is unstable.
    """
    gains = {key: factor * float(LAWS[name][key]) for key in GAINS.get(name, ("kp",)) if key in LAWS[name]}
    plain = sliding_sea(at_rest(with_law(name, "held", control=gains)))
    loop, context = settled_at(sea_entry(), plain, 0.2, (INPUT, OUTPUT))
    cut = open_loop(loop.diagram, context, plain.dt, "torque_control:voltage")
    if not cut.closed().radius_but_for_drift() < 1.0:
        raise SimulationError(f"law {name!r}: expected a stable loop; its spectral radius is not below 1")
    return margins(cut.loop_response(0), plain.dt, frequency_grid(plain.dt, 0.5, 400))
