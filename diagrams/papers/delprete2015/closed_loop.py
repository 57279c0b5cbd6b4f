"""Beyond Del Prete and Mansard (2015): robust TSID in the full simulator, with floor, geared drives, friction and
sensors; four forms.

The torque error is what the drives make of the torques, not a noise; the controllers reckon with the Sigma that the
robot's own torque estimates showed in a run of its own. Runs differ in the masses of the links and in all random
numbers, which the four forms share.
"""

import os
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from drake_tc.analysis.sweep import processes, sweep
from drake_tc.diagrams.papers.delprete2015.setup import robot
from drake_tc.diagrams.papers.delprete2015.torque_safety import wilson
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.loops.whole_body.references import KnotSpec
from drake_tc.loops.whole_body.running import TsidRecording, contact_misses, joint_misses, simulate_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.report.figure_row import Progress, Reproduction, evaluated
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.tsid.law import Status
from drake_tc.types import TextTable

RUNS = 20
FORMS = ("classic", "individual", "rectangle", "box")
SCENARIO = Path(__file__).resolve().parents[2] / "humanoid_tsid.scenario.yaml"
AMPLITUDES = (0.05, 0.055, 0.06, 0.065, 0.07, 0.075)
"""Of the sway to either side, at which each form is tried with the right masses [m]."""
TIMES = (0.6, 2.2, 3.8)
"""When the centre of mass leaves the middle, is at one end, and at the other [s]: as in tests 1 and 2."""
BEGIN = 0.6
"""The drives take over before; limits count from here on [s]."""
WINDOW = 10
"""Contact forces are means of so many samples: a limit counts as missed by what lasts 10 ms."""
TOLERANCE = 1.0
"""Of the rows of the contacts' cones [N, N m]: what contact that gives way adds and a cone does not know."""
LEAST, MOST = 0.97, 1.03
"""Factors on the masses and inertias of the plant's links."""

NOTES = (
    "Tests 1 and 2's sway, shorter: to one side, to the other, 1.6 s each, 2 cm lower. The amplitude follows from the"
    " classic form alone: the least of those tried at which it misses a limit with the right masses.",
    "Simulated: soles on a floor that gives way, position-servo drives with friction under torque control, realistic"
    " encoders, gyro and F/T sensors, the state estimated, 1 kHz.",
    "A run is clean where, from 0.6 s on, no true contact force (means over 10 ms) misses a cone of the controller by"
    " more than 1 N or 1 N m, no joint its range, speed or torque, and the robot stands.",
)


@dataclass(frozen=True)
class Outcome:
    """One run.

    Attributes:
        force: Share of the samples at which the true contact forces missed a cone of the controller [-].
        joints: The same for the joints' positions, velocities and torques beyond their limits [-].
        fallback: Share of the ticks whose torque was the fallback [-].
        fell: Whether the robot fell, or the simulation ended early.
    """

    force: float
    joints: float
    fallback: float
    fell: bool

    @property
    def clean(self) -> bool:
        """Whether it kept every limit at every sample."""
        return not (self.fell or self.force > 0.0 or self.joints > 0.0)


def sway(
    form: str,
    sigma: tuple[float, ...] | None,
    seed: int,
    masses: Mapping[str, float],
    amplitude: float,
) -> TsidScenario:
    """The scenario of one run: state estimated, torques through the drives."""
    base = TsidScenario.load(SCENARIO, "whole_chain")
    ends = ((0.0, 0.0, 0.0), (0.0, amplitude, -0.02), (0.0, -amplitude, -0.02))
    changes: dict[str, Any] = {"formulation": {"measure": form}}
    if sigma is not None:
        changes["sigma"] = list(sigma)
    return base.changed(
        changes=changes, motion={"com": KnotSpec(TIMES, ends)}, duration=TIMES[-1] + 0.2, seed=seed, masses=masses
    )


def identified_sigma(seed: int) -> tuple[float, ...]:
    """(n,) RMS of what the robot's sensors say of each joint's torque minus what was desired, classic form [N m]."""
    recording = simulate_tsid(sway("classic", None, seed, {}, AMPLITUDES[0]))
    late = recording.time >= BEGIN
    error = (recording["estimated_torque"] - recording["torque"])[late]
    return tuple(np.sqrt(np.mean(error**2, axis=0)).tolist())


def outcome(recording: TsidRecording) -> Outcome:
    """Which limits of the controller the true motion missed."""
    late = recording.time >= BEGIN
    fell = recording.fell is not None or bool(recording.time[-1] < recording.scenario.duration - 0.01)
    if not late.any():
        return Outcome(1.0, 1.0, 1.0, True)
    force = contact_misses(recording, window=WINDOW)[late] > TOLERANCE
    joints = np.any([missed[late] > 0.0 for missed in joint_misses(recording).values()], axis=0)
    fallback = recording.status(Status.FALLBACK)[late] > 0.0
    return Outcome(float(force.mean()), float(joints.mean()), float(fallback.mean()), fell)


def point(trial: tuple[tuple[float, ...], float], seed: int) -> tuple[Outcome, ...]:
    """All forms on one robot with wrong masses, for `sweep`; the trial is sigma and the amplitude."""
    sigma, amplitude = trial
    rng = np.random.default_rng(seed)
    links = read_urdf(robot().urdf).links
    masses = {link: float(rng.uniform(LEAST, MOST)) for link in links}
    noise = int(rng.integers(2**31))
    return tuple(outcome(simulate_tsid(sway(form, sigma, noise, masses, amplitude))) for form in FORMS)


def wider(trial: tuple[tuple[float, ...], float], seed: int) -> tuple[Outcome, ...]:
    """All forms at one amplitude with the right masses, for `sweep`."""
    sigma, amplitude = trial
    noise = int(np.random.default_rng(seed).integers(2**31))
    return tuple(outcome(simulate_tsid(sway(form, sigma, noise, {}, amplitude))) for form in FORMS)


def closed_loop(seed: int = 0, progress: Progress | None = None, executor: Executor | None = None) -> Reproduction:
    """B.closed_loop: shares of runs that keep every limit; through any Executor, else all processors here."""
    if executor is None:
        with processes(os.cpu_count() or 1) as pool:
            return closed_loop(seed, progress, pool)
    if progress:
        progress("a run that identifies Sigma", 0.0)
    sigma = identified_sigma(seed)
    trials = [(sigma, amplitude) for amplitude in AMPLITUDES]
    swept: list[tuple[Outcome, ...]] = sweep(wider, trials, executor=executor, chunk=1, seed=seed, progress=progress)
    robots = [(sigma, informative_amplitude(swept))] * RUNS
    found: list[tuple[Outcome, ...]] = sweep(point, robots, executor=executor, chunk=1, seed=seed, progress=progress)
    return reproduction(found, swept)


def informative_amplitude(swept: list[tuple[Outcome, ...]]) -> float:
    """The least of `AMPLITUDES` at which the classic form misses a limit with the right masses, or the largest [m]."""
    missed = (amplitude for amplitude, outcomes in zip(AMPLITUDES, swept, strict=True) if not outcomes[0].clean)
    return next(missed, AMPLITUDES[-1])


def reproduction(found: list[tuple[Outcome, ...]], swept: list[tuple[Outcome, ...]]) -> Reproduction:
    """Of all robots, and of the right one at `AMPLITUDES`; one Outcome a form."""
    values = {"amplitude of the sway [cm]": 100.0 * informative_amplitude(swept)}
    lines = []
    for number, form in enumerate(FORMS):
        runs = [outcomes[number] for outcomes in found]
        clean = sum(one.clean for one in runs)
        low, high = (100.0 * bound for bound in wilson(clean, len(runs)))
        values[f"runs that keep every limit, {form}"] = 100.0 * clean / len(runs)
        values[f"samples with a missed contact limit, {form}"] = 100.0 * float(np.mean([one.force for one in runs]))
        values[f"runs that fell, {form}"] = float(sum(one.fell for one in runs))
        lines.append(
            (
                form,
                f"{100.0 * clean / len(runs):.0f} [{low:.0f}, {high:.0f}]",
                f"{values[f'samples with a missed contact limit, {form}']:.3f}",
                f"{100.0 * float(np.mean([one.joints for one in runs])):.3f}",
                f"{100.0 * float(np.mean([one.fallback for one in runs])):.3f}",
                f"{sum(one.fell for one in runs)}",
            )
        )
    for number, form in enumerate(FORMS[1:], 1):
        better = sum(outcomes[number].clean and not outcomes[0].clean for outcomes in found)
        worse = sum(outcomes[0].clean and not outcomes[number].clean for outcomes in found)
        values[f"robots kept by {form} alone"] = float(better)
        values[f"robots kept by classic but not by {form}"] = float(worse)
        values[f"chance of as many, {form}"] = float(binomtest(better, max(better + worse, 1), 0.5, "greater").pvalue)
    widest = {
        form: max((a for a, past in _kept(swept, number) if past), default=0.0) for number, form in enumerate(FORMS)
    }
    for form in FORMS:
        values[f"widest sway kept, {form} [cm]"] = 100.0 * widest[form]
    for form in FORMS[1:]:
        values[f"widest sway kept, {form} minus classic"] = 100.0 * (widest[form] - widest["classic"])
    headings = ("", "keep every limit [% and 95 %]", "contact missed [%]", "joints missed [%]", "fallback [%]", "fell")
    table = TextTable(f"{len(found)} robots, each under all forms", headings, tuple(lines))
    amplitudes = [f"{100.0 * amplitude:.1f} cm" for amplitude in AMPLITUDES]
    misses = [
        (form, *(f"{100.0 * outcomes[number].force:.2f}" for outcomes in swept)) for number, form in enumerate(FORMS)
    ]
    wide = TextTable("right masses: contact missed [%] by amplitude", ("", *amplitudes), tuple(misses))
    return Reproduction("B.closed_loop", evaluated(values, expectations("b_closed_loop")), (table, wide), NOTES)


def _kept(swept: list[tuple[Outcome, ...]], number: int) -> list[tuple[float, bool]]:
    """Each amplitude, and whether the form kept every limit there and at all smaller ones."""
    clean = np.logical_and.accumulate([outcomes[number].clean for outcomes in swept])
    return list(zip(AMPLITUDES, clean.tolist(), strict=True))
