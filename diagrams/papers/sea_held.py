"""Paper C, Fig. 4b and c: a joint that is held, law by law; and what a hand feels of a joint that should give way."""

from typing import Any

import numpy as np
from drake_tc.diagrams.papers.reproduction import Progress, Reproduction, TextTable, expectations, judged, text_rows
from drake_tc.diagrams.papers.sea_laws import LAWS, MOMENTUM, OBSERVER, PREDICTED, WHOLE, with_law
from drake_tc.diagrams.papers.sea_motor import true_motor
from drake_tc.diagrams.sea.running import SeaRecording, simulate_sea
from drake_tc.diagrams.sea.scenario import SeaScenario

MOVED = ((1.0, 2.2), (3.0, 4.2))
"""When the hand moves the joint at a constant speed, there and back [s]."""
SPEED = 0.5
"""Of the hand [rad/s]."""
NOTES = (
    "Simulated. Held: the knee of the robot file, output clamped, 4 N m at 1 Hz, 3 N m of dry friction, 15 ms of delay;"
    " RMS of wanted less true spring torque over three periods. Laws tuned by one rule: see C.bode.",
    "`but for the delay`: against the wanted torque of 15 ms ago. A law that follows 4 N m at 1 Hz exactly, 15 ms late,"
    " has 0.27 N m of RMS error. The momentum observer does not know of the delay: it integrates against the present"
    " torque and overshoots ahead of it, which at 1 Hz is nearer to the present than an exact copy that is late.",
    "The predictor carries the wanted torque over the whole delay here, as a sine of 1 Hz lets it; C.bode takes 8 ms.",
    "Transparency: no torque wanted, a hand of 300 N m/rad takes the joint to and fro at 0.5 rad/s; its mean torque"
    " while the speed is constant, over the motor's friction at that speed without its back-EMF (3.75 N m).",
)


def friction_at(scenario: SeaScenario, speed: float) -> float:
    """Dry and viscous friction without the back-EMF [N m]."""
    motor = true_motor(scenario)
    return float(motor.coulomb + motor.viscous * speed)


def held(seed: int = 0, progress: Progress | None = None) -> Reproduction:
    """C.held: torque errors of every law on the clamped joint; transparency."""
    runs: dict[str, SeaRecording] = {}
    by_hand: dict[str, float] = {}
    peaks: dict[str, float] = {}
    for number, name in enumerate(LAWS):
        if progress:
            progress(name, number / len(LAWS))
        runs[name] = simulate_sea(with_law(name, "held", seed))
        if name not in (PREDICTED, WHOLE):
            moved = simulate_sea(with_law(name, "hand", seed))
            by_hand[name], peaks[name] = hand_torque(moved), float(np.abs(moved["hand_torque"]).max())
    error = {name: run.rms(run.torque_error) for name, run in runs.items()}
    late = {name: run.rms(run.delayed_torque_error) for name, run in runs.items()}
    friction = friction_at(runs[OBSERVER].scenario, SPEED)
    values = {
        "torque RMSE, observer + P over momentum observer": error[OBSERVER] / error[MOMENTUM],
        "the same but for the delay": late[OBSERVER] / late[MOMENTUM],
        "torque RMSE, observer + P with predictor of 15 ms over momentum observer": error[WHOLE] / error[MOMENTUM],
        "transparency, observer + P: hand's torque over friction at 0.5 rad/s": by_hand[OBSERVER] / friction,
    }
    values |= {f"{name}: torque RMSE [N m]": value for name, value in error.items()}
    values |= {f"{name}: torque RMSE but for the delay [N m]": late[name] for name in by_hand}
    values |= {f"{name}: hand's torque over friction": value / friction for name, value in by_hand.items()}
    names = list(by_hand)
    columns = [[source[name] for name in names] for source in (error, late, by_hand, peaks)]
    headings = ("law", "RMSE [N m]", "but for the delay", "hand at 0.5 rad/s [N m]", "its largest torque")
    shown = TextTable("clamped at 1 Hz, and moved by a hand", headings, text_rows(names, columns, ".3f"))

    def draw(figure: Any) -> None:
        axes = figure.subplots(3, 1, sharex=True, sharey=True)
        for axis, name in zip(axes, (OBSERVER, WHOLE, MOMENTUM), strict=True):
            run = runs[name]
            axis.plot(run.time, run["reference_torque"], "k--", label="wanted")
            axis.plot(run.time, run["spring_torque"], label=name)
            axis.set_xlim(1.0, 4.0)
            axis.set_ylabel("torque [N m]")
            axis.legend(loc="upper right")
        axes[-1].set_xlabel("time [s]")

    return Reproduction("C.held", judged(values, expectations("c_held")), (shown,), NOTES, {"c_held": draw})


def hand_torque(run: SeaRecording) -> float:
    """Mean torque that the hand gives along its motion [N m], over both ways; its size."""
    means = []
    for begin, end in MOVED:
        inside = (run.time >= begin) & (run.time < end)
        means.append(abs(float(np.mean(run["hand_torque"][inside]))))
    return float(np.mean(means))
