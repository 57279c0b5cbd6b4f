"""Faraji et al. (2015), Fig. 4a: how the spring's torque follows the desired one over frequency, law by law."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.analysis.frequency_response import FrequencyResponse, Sweep, bandwidth, swept_sine
from drake_tc.analysis.release import settled_at
from drake_tc.analysis.sampled import linearise
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.sea_laws import (
    INPUT,
    LAWS,
    OBSERVER,
    OUTPUT,
    PI,
    PREDICTED,
    at_rest,
    margins_of,
    with_law,
)
from drake_tc.loops.series_elastic.scenario import SeaScenario, sliding_sea
from drake_tc.registry import sea_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.report.plots.run_plot import draw_bode
from drake_tc.types import FloatArray, TextTable, text_rows

BAND = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
"""[Hz], the paper's."""
ABOVE = (12.0, 14.0, 17.0, 22.0, 30.0, 38.0, 44.0, 50.0)
"""For the bandwidth [Hz]."""
AMPLITUDE = 2.0
"""Of the desired torque [N m]; at 50 Hz the motor needs 22 of its 24 V for it."""
AT = 0.3
"""When the sines begin [s]."""
SHOWN = (OBSERVER, "feedforward", "feedforward + P", "momentum observer", PI, PREDICTED)
HAND: Mapping[str, float] = {"stiffness": 2000.0, "damping": 10.0}
"""A hand in place of the clamp [N m/rad, N m s/rad]: the joint turns a tenth further than the law reckons with."""
PI_LINEAR = "PI: -3 dB bandwidth by the linear prediction [Hz]"
HAND_SIZE, HAND_OFF = "largest | |H| | [dB]", "phase off the pure delay [deg]"
NOTES = (
    "Simulated: the knee of the robot file, output clamped, 2 N m sines on 3 N m of dry friction, the controllers'"
    " models off by 2 to 3 % (dry friction by 10 %), encoder steps and noise as in diagrams/sea_joint.scenario.yaml.",
    "All laws are tuned by one rule: as much gain as leaves a sensitivity peak of at most 2 and a delay margin of 5 ms"
    " on top of the loop's 15 ms (sea_laws.py). The feedforward alone has no gain to tune, and its"
    " sensitivity peak breaks the rule. The paper's PI is its maker's, with gains of its own.",
    "Bandwidths are of 2 N m on 3 N m of dry friction; by the linear prediction, without that friction, PI is faster."
    " A bandwidth of 50 Hz is a floor: the response has not dropped at the highest frequency.",
    "The feedforward laws share the desired speed and the deflection of the spring, which the printed law lacks.",
)


def measured(scenario: SeaScenario, frequencies: tuple[float, ...]) -> FrequencyResponse:
    """Torque over desired torque, with friction and noise."""
    resting = at_rest(scenario)
    loop, context = settled_at(sea_entry(), resting, AT, (INPUT, OUTPUT))
    sweep = Sweep(frequencies, AMPLITUDE, 0.4, 0.5)
    return swept_sine(loop.diagram, context, resting.dt, (INPUT, OUTPUT), sweep)


def predicted(scenario: SeaScenario, frequency_hz: FloatArray) -> FrequencyResponse:
    """The same of the linearised diagram, dry friction sliding."""
    plain = sliding_sea(at_rest(scenario))
    loop, context = settled_at(sea_entry(), plain, AT, (INPUT, OUTPUT))
    system = linearise(loop.diagram, context, plain.dt, inputs=(INPUT.port,), outputs=(OUTPUT.port,))
    response = system.response(2.0 * np.pi * frequency_hz)[:, 0, 0]
    return FrequencyResponse(frequency_hz, response, np.full(frequency_hz.size, np.nan))


def lag_deg(found: FrequencyResponse) -> FloatArray:
    """(F,) phase lag [deg]; followed from 2 Hz on, where no law is half a turn late."""
    return np.asarray(-np.degrees(found.unwrapped().phase))


def width_hz(found: FrequencyResponse) -> float:
    """-3 dB bandwidth [Hz]; where it never drops, the highest measured frequency; NaN if H is not about 1 at 2 Hz."""
    one = bandwidth(found)
    return float("nan") if one is None else one.hz


def bode(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.bode: magnitude, phase and bandwidth of every law; the predictor; what the linear analysis says."""
    found: dict[str, FrequencyResponse] = {}
    for number, name in enumerate(SHOWN):
        if progress:
            progress(name, number / (len(SHOWN) + 1))
        found[name] = measured(with_law(name, "held", seed), BAND + ABOVE)
    if progress:
        progress("held by a hand", len(SHOWN) / (len(SHOWN) + 1))
    scenario = with_law(OBSERVER, "held", seed)
    by_hand = measured(with_law(OBSERVER, "held", seed, hand=dict(HAND)), BAND)
    linear = predicted(scenario, found[OBSERVER].frequency_hz)
    values = bode_values(found, by_hand, linear, scenario.delay)
    values[PI_LINEAR] = width_hz(predicted(with_law(PI, "held", seed), np.geomspace(BAND[0], ABOVE[-1], 60)))
    responses = {**found, "linear, observer + P": linear}
    of_laws = _of_laws(found, values)
    tables = (_table("|H| [dB]", responses), _table("phase lag [deg]", responses), of_laws, _margins())
    curves = {name: one.unwrapped() for name, one in responses.items()}

    def draw(figure: Any) -> None:
        draw_bode(figure, curves, "spring torque over desired torque, clamped joint", delay=scenario.delay)

    return Reproduction("C.bode", evaluated(values, expectations("c_bode")), tables, NOTES, {"c_bode": draw})


def bode_values(
    found: Mapping[str, FrequencyResponse], by_hand: FrequencyResponse, linear: FrequencyResponse, delay: float
) -> dict[str, float]:
    """The figures of C.bode from the responses."""
    band = slice(0, len(BAND))
    best = found[OBSERVER]
    pure = 360.0 * delay * best.frequency_hz[band]
    values = {}
    for name, one in found.items():
        lag = lag_deg(one)[band]
        values[f"{name}: largest | |H| |, 2 to 10 Hz [dB]"] = float(np.abs(one.magnitude_db[band]).max())
        if name != PREDICTED:
            values[f"{name}: phase off the pure delay, largest, 2 to 10 Hz [deg]"] = float(np.abs(lag - pure).max())
        values[f"{name}: -3 dB bandwidth [Hz]"] = width_hz(one)
    values["bandwidth, observer + P over PI"] = width_hz(best) / width_hz(found[PI])
    share = lag_deg(found[PREDICTED])[band] / lag_deg(best)[band]
    values["phase lag with the predictor over without, largest, 2 to 10 Hz"] = float(share.max())
    values["measured off linear, observer + P, 2 to 10 Hz [dB]"] = float(
        np.abs(best.magnitude_db - linear.magnitude_db)[band].max()
    )
    apart, off = np.abs(lag_deg(best) - lag_deg(linear))[band], np.abs(lag_deg(by_hand) - pure)
    values["measured off linear, observer + P, 2 to 10 Hz [deg]"] = float(apart.max())
    values[f"held by a hand of 2000 N m/rad: {HAND_SIZE}"] = float(np.abs(by_hand.magnitude_db).max())
    values[f"held by a hand of 2000 N m/rad: {HAND_OFF}"] = float(off.max())
    return values


def _table(title: str, responses: Mapping[str, FrequencyResponse]) -> TextTable:
    magnitude = title.startswith("|H|")
    numbers = [(one.magnitude_db if magnitude else lag_deg(one)).tolist() for one in responses.values()]
    rows = text_rows([f"{f:g} Hz" for f in BAND + ABOVE], numbers, ".2f" if magnitude else ".1f")
    return TextTable(title, ("frequency", *responses), rows)


def _of_laws(found: Mapping[str, FrequencyResponse], values: Mapping[str, float]) -> TextTable:
    """The figures law by law."""
    rows = []
    for name, one in found.items():
        width = bandwidth(one)
        off = values.get(f"{name}: phase off the pure delay, largest, 2 to 10 Hz [deg]")
        shown = "-" if width is None else f"{'> ' if width.at_least else ''}{width.hz:.1f}"
        size = f"{values[f'{name}: largest | |H| |, 2 to 10 Hz [dB]']:.2f}"
        rows.append((name, size, "-" if off is None else f"{off:.1f}", shown))
    by_hand = [values[f"held by a hand of 2000 N m/rad: {what}"] for what in (HAND_SIZE, HAND_OFF)]
    rows.append((f"{OBSERVER}, held by a hand", f"{by_hand[0]:.2f}", f"{by_hand[1]:.1f}", "-"))
    rows.append((f"{PI}, linear", "-", "-", f"{values[PI_LINEAR]:.1f}"))
    headings = ("law", "largest | |H| | [dB]", "off the pure delay [deg]", "-3 dB [Hz]")
    return TextTable("2 to 10 Hz; bandwidth", headings, tuple(rows))


def _margins() -> TextTable:
    rows = []
    for name in LAWS:
        m = margins_of(name)
        rows.append((name, f"{m.sensitivity_peak:.2f}", f"{1e3 * m.delay_margin:.1f}", f"{m.gain_margin:.2f}"))
    headings = ("law", "sensitivity peak", "delay margin [ms]", "gain margin")
    return TextTable("margins on top of the 15 ms", headings, tuple(rows))
