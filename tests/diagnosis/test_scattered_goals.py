"""Goals that are written and logged by two clocks: a sample is one goal or the next, and nothing is missing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.joint import diagnose_joint
from drake_tc.diagnosis.noise_notes import NoiseOfRecordedEffort
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.logs.record import Run

from .rigs import WAVES, sines
from .stick_slip import JOINT, Servo, rig_of, simulated

WRITTEN = 0.01
"""Time for which a goal holds [s]."""
FINE = 1e-3
SERVO = Servo(period=FINE, duration=30.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.05, length=0.15)


def goals(shift: float) -> np.ndarray:
    """(T,) of the servo's clock, each held for `WRITTEN`."""
    return np.repeat(sines(np.arange(0.0, SERVO.duration, WRITTEN), WAVES, shift)[0], round(WRITTEN / FINE))


def run(shift: float, period: float, late: float) -> Run:
    """The servo under goals that act `late` seconds after they are held, logged every `period`.

    The logger reads goals of up to a tenth of its period before or after the instant at which one is written.
    """
    rng = np.random.default_rng([int(10 * shift), round(1e4 * period)])
    held = goals(shift)
    wait = round(late / FINE)
    acting = np.concatenate([np.full(wait, held[0]), held[: held.size - wait]])
    every = round(period / FINE)
    at = np.arange(every, held.size - every, every)
    read = at + np.round(0.1 * every * rng.uniform(-1.0, 1.0, at.size)).astype(int)
    logged = replace(SERVO, period=period, duration=at.size * period)
    encoder = logged.encoder(simulated(SERVO, acting)[at], rng)
    return logged.run(f"run{shift}", {f"{JOINT}/position": encoder, f"{JOINT}/position_command": held[read]})


def diagnosed(period: float, late: float = 0.0) -> JointResult:
    return of_runs([run(shift, period, late) for shift in (0.0, 0.4, 0.7)])


def of_runs(runs: Sequence[Run]) -> JointResult:
    """With a declared rotor inertia: a fitted one would take the form of a delay."""
    rig = replace(rig_of(SERVO), declared={JOINT: {"rotor_inertia": SERVO.inertia}})
    return diagnose_joint(runs[:2], runs[2:], rig, JOINT, DiagnosisOptions())


def test_scatter_of_the_goal_is_no_missing_effect():
    found = diagnosed(0.01)
    assert found.effects == ()
    assert found.verdict == "no_missing_effect"
    (note,) = (note for note in found.notes if isinstance(note, NoiseOfRecordedEffort))
    assert note.drive == "position_servo"
