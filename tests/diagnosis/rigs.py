"""Joints by inverse dynamics: the motion is a closed form, and the effort is what the torque balance asks for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.effects.base import Context, DriveKind
from drake_tc.effects.library import effect
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, parse_rig

COMMAND = {"position_servo": "position_command", "current": "current", "voltage": "voltage", "torque": "torque_command"}
WAVES = ((0.13, 0.5, 0.0), (0.41, 0.35, 1.1), (0.83, 0.15, 2.3))
"""(frequency [Hz], amplitude [rad], phase) of the motion."""


@dataclass(frozen=True)
class Motion:
    """Time and what moves, (T,) each; `tau` is the load on the link side."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray


Extra = Callable[[Motion], np.ndarray]
Waves = Sequence[tuple[float, float, float]]


@dataclass(frozen=True)
class Logged:
    """How a joint is logged."""

    period: float = 2e-3
    duration: float = 16.0
    encoder_noise: float = 0.0
    encoder_step: float = 0.0

    def times(self) -> np.ndarray:
        """(T,) [s]."""
        return np.arange(round(self.duration / self.period)) * self.period

    def encoder(self, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """The position (T,) [rad] with the encoder's noise and in its steps."""
        noisy = q + self.encoder_noise * rng.standard_normal(q.size)
        return np.asarray(np.round(noisy / self.encoder_step) * self.encoder_step if self.encoder_step else noisy)

    def run(self, name: str, columns: dict[str, np.ndarray]) -> Run:
        """A run in which every sample is usable."""
        time = self.times()
        return Run(name, None, time, self.period, columns, np.zeros(time.size, dtype=np.int64))


@dataclass(frozen=True)
class Joint(Logged):
    """True numbers of a joint, and how it is logged; `extra` is torque that the declared model does not have."""

    drive: DriveKind = "current"
    gain: float = 0.08
    inertia: float = 0.3
    viscous: float = 6.0
    coulomb: float = 3.0
    torque_noise: float = 0.0
    extra: Extra | None = None
    sensor: Extra | None = None


def sines(time: np.ndarray, waves: Waves, shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(q, v, a), (T,) each: sines of (frequency [Hz], size [rad], phase [rad]), 10 s times `shift` later."""
    q, v, a = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
    for frequency, size, phase in waves:
        w = 2 * np.pi * frequency
        angle = w * time + phase + shift * frequency * 10.0
        q, v, a = q + size * np.sin(angle), v + size * w * np.cos(angle), a - size * w**2 * np.sin(angle)
    return q, v, a


def motion(joint: Joint, shift: float = 0.0) -> Motion:
    time = joint.times()
    q, v, a = sines(time, WAVES, shift)
    hand = 4.0 * np.sin(2 * np.pi * 0.29 * time + 0.7 + shift)  # so that the load is no function of the angle
    return Motion(time, q, v, a, 8.0 * np.sin(q) + 0.3 * a + hand)


def record(joint: Joint, name: str = "run", shift: float = 0.0, seed: int = 0, label: str = "joint") -> Run:
    """y = K (tau + J a + F_v v + F_c sign v + extra); the sensors' noise comes on top."""
    rng = np.random.default_rng(seed)
    m = motion(joint, shift)
    need = m.tau + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v)
    effort = joint.gain * (need + (joint.extra(m) if joint.extra else 0.0))
    position = joint.encoder(m.q, rng)
    torque = m.tau + (joint.sensor(m) if joint.sensor else 0.0)
    torque = torque + joint.torque_noise * rng.standard_normal(m.q.size)
    command = COMMAND[joint.drive]
    columns = {
        f"{label}/position": position,
        f"{label}/torque": torque,
        f"{label}/{command}": effort + (m.q if joint.drive == "position_servo" else 0.0),
    }
    return joint.run(name, columns)


def rig_of(joint: Joint, label: str = "joint") -> Rig:
    declared = {"rotor_inertia": joint.inertia} if joint.inertia else {}
    return parse_rig({"joint": label, "drive": joint.drive, "declared": declared})


@dataclass(frozen=True)
class Problem:
    """What every stage of the diagnosis works on."""

    samples: Samples
    context: Context
    columns: Columns
    declared: tuple[Term, ...]
    baseline: Fit


def problem(joint: Joint, seed: int = 0, runs: int = 1) -> Problem:
    made = [record(joint, f"run{k}", 0.37 * k, seed + 1000 * k) for k in range(runs)]
    rig = rig_of(joint)
    samples = build_samples(made, rig, "joint")
    context = context_of(samples, rig, "joint")
    declared = (Term(effect("viscous")), Term(effect("coulomb")))
    first = Columns(samples)
    columns = first.with_model(declared, fit(first, declared).beta, servo=joint.drive == "position_servo")
    return Problem(samples, context, columns, declared, fit(columns, declared))


def floor_of(p: Problem) -> float:
    """The noise floor under the baseline's coefficients [effort]."""
    return p.baseline.gain * p.samples.floor.torque(float(p.baseline.beta[0]), float(p.baseline.beta[1]))


def servo(**changes: object) -> Joint:
    """The same joint under a position servo of 500 N m/rad."""
    return replace(Joint(drive="position_servo", gain=2e-3), **changes)  # type: ignore[arg-type]
