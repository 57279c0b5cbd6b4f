"""Faraji et al. (2015), Fig. 4b and c.

A joint that is held, law by law; and what a hand feels of a joint that should give way.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.diagrams.papers.faraji2015.sea_laws import BESIDE, LAWS, MOMENTUM, OBSERVER, PREDICTED, WHOLE, with_law
from drake_tc.diagrams.papers.faraji2015.sea_motor import true_motor
from drake_tc.loops.series_elastic.loop import SeaRecording, simulate_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.registry import sea_entry
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.types import TextTable, text_rows

MOVED = ((1.0, 2.2), (3.0, 4.2))
"""When the hand moves the joint at a constant speed, there and back [s]."""
SPEED = 0.5
"""Of the hand [rad/s]."""
WHOLE_MOTION = (0.3, 4.3)
"""From the hand's first turn to its last [s]."""
CORRECTIONS = (20.0, 30.0)
"""How fast the measured speed corrects the planned one of a link that is held against its motion [rad/s]."""
NOTES = (
    "Simulated. Held: the knee of the robot file, output clamped, 4 N m at 1 Hz, 3 N m of dry friction, 15 ms of delay;"
    " RMS of desired less true spring torque over three periods. Laws tuned by one rule: see C.bode.",
    "`but for the delay`: against the desired torque of 15 ms ago. The momentum observer"
    " does not know of the delay: it integrates against the present"
    " torque and overshoots ahead of it, which at 1 Hz is nearer to the present than an exact copy that is late.",
    "The predictor carries the desired torque over the whole delay here, as a sine of 1 Hz lets it; C.bode takes 8 ms.",
    "Transparency: no torque desired, a hand of 300 N m/rad takes the joint to and fro at 0.5 rad/s; its mean torque"
    " while the speed is constant, over the motor's friction at that speed without its back-EMF (3.75 N m). The turns"
    " are left out there: every law with an integrator has next to nothing at a constant speed. Over the whole motion,"
    " turns at 5 rad/s^2 included, the RMS of the hand's torque is above 10 % of that friction for every law.",
    "Not tuned by the rule, in a table of their own: a law nearer to the printed one (the last step's friction, the"
    " measured speed, no spring terms, kp = 0.3; but it knows the delay), and the momentum observer at half its gain.",
    "Caught: a free link's planned motion, and a hand of 40 N m/rad that holds it; RMS of desired less true torque.",
)


def friction_at(scenario: SeaScenario, speed: float) -> float:
    """Dry and viscous friction without the back-EMF [N m]."""
    motor = true_motor(scenario)
    return float(motor.coulomb + motor.viscous * speed)


BY_HAND = (
    "hand's torque at constant speed [N m]",
    "hand's largest torque [N m]",
    "hand's torque, RMS over the whole motion [N m]",
)
"""What a hand feels of a law."""


def _caught(speed: float, seed: int) -> float:
    """RMS torque error [N m] of a link that is held against its planned motion."""
    text = f"{{control: {{speed_bandwidth: {speed}}}}}"
    run = simulate_sea(sea_entry().scenario("caught", text=text).changed(seed=seed))
    return float(run.rms(run.torque_error))


def held_values(
    runs: Mapping[str, SeaRecording], moved: Mapping[str, SeaRecording], caught: Mapping[float, float]
) -> dict[str, float]:
    """The figures of C.held.

    Args:
        runs: Law to its run on the clamped joint.
        moved: Law to its run with a hand.
        caught: `speed_bandwidth` to the torque error of the link that is held.
    """
    error = {name: run.rms(run.torque_error) for name, run in runs.items()}
    late = {name: run.rms(run.delayed_torque_error) for name, run in runs.items()}
    friction = friction_at(runs[OBSERVER].scenario, SPEED)
    by_hand = {name: (hand_torque(run), largest_torque(run), motion_rms(run)) for name, run in moved.items()}
    values = {
        "torque RMSE, observer + P over momentum observer": error[OBSERVER] / error[MOMENTUM],
        "the same but for the delay": late[OBSERVER] / late[MOMENTUM],
        "torque RMSE, observer + P with predictor of 15 ms over momentum observer": error[WHOLE] / error[MOMENTUM],
        "transparency, observer + P: hand's torque over friction at 0.5 rad/s": by_hand[OBSERVER][0] / friction,
    }
    values |= {f"{name}: torque RMSE [N m]": value for name, value in error.items()}
    values |= {f"{name}: torque RMSE but for the delay [N m]": value for name, value in late.items()}
    for name, felt in by_hand.items():
        values |= {f"{name}: {key}": value for key, value in zip(BY_HAND, felt, strict=True)}
        values[f"{name}: hand's torque over friction"] = felt[0] / friction
        values[f"{name}: hand's torque over friction, RMS over the whole motion"] = felt[2] / friction
    return values | {f"caught, speed_bandwidth {speed:g}: RMSE [N m]": value for speed, value in caught.items()}


def held(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.held: torque errors of every law on the clamped joint; transparency."""
    runs: dict[str, SeaRecording] = {}
    moved: dict[str, SeaRecording] = {}
    names = [*LAWS, *BESIDE]
    for number, name in enumerate(names):
        if progress:
            progress(name, number / (len(names) + 1))
        runs[name] = simulate_sea(with_law(name, "held", seed))
        if name in LAWS and name not in (PREDICTED, WHOLE):
            moved[name] = simulate_sea(with_law(name, "hand", seed))
    if progress:
        progress("caught", len(names) / (len(names) + 1))
    caught = {speed: _caught(speed, seed) for speed in CORRECTIONS}
    values = held_values(runs, moved, caught)

    def shown(name: str) -> tuple[str, ...]:
        keys = ("torque RMSE [N m]", "torque RMSE but for the delay [N m]", *BY_HAND)
        found = [values.get(f"{name}: {key}") for key in keys]
        return (name, *("-" if value is None else f"{value:.3f}" for value in found))

    headings = ("law", "RMSE [N m]", "but for the delay", "hand, constant speed [N m]", "largest", "RMS over all")
    tables = (
        TextTable("clamped at 1 Hz, and moved by a hand", headings, tuple(shown(name) for name in LAWS)),
        TextTable("not tuned by the rule", headings[:3], tuple(shown(name)[:3] for name in BESIDE)),
        TextTable(
            "caught: torque RMSE [N m]",
            ("speed_bandwidth [rad/s]", "RMSE"),
            text_rows([f"{speed:g}" for speed in CORRECTIONS], [list(caught.values())]),
        ),
    )

    def draw(figure: Any) -> None:
        axes = figure.subplots(3, 1, sharex=True, sharey=True)
        for axis, name in zip(axes, (OBSERVER, WHOLE, MOMENTUM), strict=True):
            run = runs[name]
            axis.plot(run.time, run["reference_torque"], "k--", label="desired")
            axis.plot(run.time, run["spring_torque"], label=name)
            axis.set_xlim(1.0, 4.0)
            axis.set_ylabel("torque [N m]")
            axis.legend(loc="upper right")
        axes[-1].set_xlabel("time [s]")

    return Reproduction("C.held", evaluated(values, expectations("c_held")), tables, NOTES, {"c_held": draw})


def hand_torque(run: SeaRecording) -> float:
    """Mean torque that the hand gives along its motion [N m], over both ways; its size."""
    means = []
    for begin, end in MOVED:
        inside = (run.time >= begin) & (run.time < end)
        means.append(abs(float(np.mean(run["hand_torque"][inside]))))
    return float(np.mean(means))


def largest_torque(run: SeaRecording) -> float:
    """Largest torque of the hand, at its turns [N m]."""
    return float(np.abs(run["hand_torque"]).max())


def motion_rms(run: SeaRecording) -> float:
    """RMS of the hand's torque over its whole motion, turns included [N m]."""
    inside = (run.time >= WHOLE_MOTION[0]) & (run.time < WHOLE_MOTION[1])
    return float(np.sqrt(np.mean(run["hand_torque"][inside] ** 2)))
