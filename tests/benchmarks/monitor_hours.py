"""False alarms and delays of `ModelMonitor` at 1 kHz, and what a tick costs, on joints by closed-form motions.

Every stage is noisy: velocity, acceleration, load torque and effort have noise with the correlation of filters, the
friction of the model is a few percent off, and a ripple of the gear is not modelled. The monitor is calibrated on a
sound minute, and knows of a push by nothing but its own residual. `monitored_loops` has the torque loops of two robots.
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.loops.recording import Progress
from drake_tc.watch.health import health_of
from drake_tc.watch.monitor import CAUSES, ModelMonitor
from tests.benchmarks.figures import BenchmarkRow

DT, CHUNK_S, BEGIN_S, WAIT_S = 1e-3, 5.0, 20.0, 40.0
SPARSE = 1
"""Ticks from row to row of a calibration."""
ROOM = 25.0
CHANGES: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "friction +10 %": ("friction", {"friction": 0.1}),
    "friction +20 %": ("friction", {"friction": 0.2}),
    "friction +50 %": ("friction", {"friction": 0.5}),
    "torque constant -10 %": ("torque_constant", {"torque_constant": 0.1}),
    "payload of 5 % of the rating": ("payload", {"payload": 2.5}),
    "effort 5 ms late": ("delay", {"delay": 5e-3}),
    "backlash of 0.5 mrad": ("backlash", {"backlash": 5e-4}),
    "backlash of 1 mrad": ("backlash", {"backlash": 1e-3}),
    "torque sensor 1 N m off": ("bias", {"bias": 1.0}),
    "collision": ("push", {"push": 40.0}),
}


@dataclass(frozen=True)
class Joints:
    """Numbers (n,) of n joints; phases, frequencies [Hz] and sizes [rad] (3, n) of their motion."""

    gain: np.ndarray
    servo: np.ndarray
    inertia: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray
    link: np.ndarray
    gravity: np.ndarray
    misfit: np.ndarray
    ripple: np.ndarray
    phase: np.ndarray
    frequency: np.ndarray
    size: np.ndarray

    @classmethod
    def drawn(cls, rng: np.random.Generator, count: int) -> "Joints":
        """Current drives and position servos in turn."""
        servo = np.arange(count) % 2 == 1
        return cls(
            np.where(servo, rng.uniform(1e-4, 2.2e-4, count), rng.uniform(0.06, 0.12, count)), servo,
            rng.uniform(0.2, 0.4, count), rng.uniform(4.0, 10.0, count), rng.uniform(2.0, 6.0, count),
            rng.uniform(0.4, 1.2, count), rng.uniform(8.0, 26.0, count), rng.normal(0.0, 0.015, count),
            rng.uniform(0.05, 0.2, count), rng.uniform(0.0, 2.0 * np.pi, (3, count)),
            rng.uniform(0.1, 0.8, (3, count)), rng.uniform(0.1, 0.35, (3, count)),
        )  # fmt: skip

    def models(self) -> list[ActuatorModel]:
        """What is known of them."""
        return [
            ActuatorModel(
                f"joint_{i}", Drive("position_servo" if self.servo[i] else "current", float(self.gain[i])),
                (
                    EffectValue("rotor_inertia", {"rotor_inertia": float(self.inertia[i])}),
                    EffectValue("viscous", {"viscous": float(self.viscous[i])}),
                    EffectValue("coulomb", {"coulomb": float(self.coulomb[i])}),
                ),
            )
            for i in range(self.gain.size)
        ]  # fmt: skip

    def motion(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, v, a (T, n)."""
        w = 2.0 * np.pi * self.frequency
        angle = t[:, None, None] * w + self.phase
        return (
            np.sum(self.size * np.sin(angle), axis=1),
            np.sum(self.size * w * np.cos(angle), axis=1),
            np.sum(-self.size * w**2 * np.sin(angle), axis=1),
        )


def coloured(
    rng: np.random.Generator, shape: tuple[int, int], rms: float, time_s: float, last: np.ndarray
) -> np.ndarray:
    """First-order noise (T, n) that goes on from `last` (n,), which is written."""
    from scipy.signal import lfilter

    keep = float(np.exp(-DT / time_s))
    drive = rms * np.sqrt(1.0 - keep**2) * rng.standard_normal(shape)
    out, _ = lfilter([1.0], [1.0, -keep], drive, axis=0, zi=keep * last[None, :])
    last[:] = out[-1]
    return np.asarray(out)


def readings(
    joints: Joints, seconds: float, rng: np.random.Generator, change: Mapping[str, float], at: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Chunks of time (T,) and readings (T, 6, n); the change begins `at` [s]."""
    n = joints.gain.size
    lasts = [np.zeros(n) for _ in range(4)]
    for begin in np.arange(0.0, seconds, CHUNK_S):
        t = begin + DT * np.arange(round(CHUNK_S / DT))
        q, v, a = joints.motion(t)
        late = change.get("delay", 0.0)
        on = (t >= at)[:, None]
        pulse = np.clip(1.0 - np.abs((t - at - 0.1) / 0.1), 0.0, None)[:, None] * change.get("push", 0.0)

        def needed(q: np.ndarray, v: np.ndarray, a: np.ndarray, on: np.ndarray = on) -> np.ndarray:
            load = joints.gravity * np.sin(q) + joints.link * a + on * change.get("payload", 0.0) * np.sin(q + 0.4)
            friction = joints.viscous * v + joints.coulomb * np.tanh(v / 0.01)
            friction = friction * (1.0 + joints.misfit + on * change.get("friction", 0.0))
            return np.asarray(load + joints.inertia * a + friction + joints.ripple * np.sin(24.0 * q))

        torque = needed(q, v, a)
        if late:
            torque = np.where(on, needed(*joints.motion(t - late)), torque)
        torque = torque / (1.0 - on * change.get("torque_constant", 0.0)) + on * change.get("bias", 0.0) + pulse
        gap = np.where(joints.servo, 0.5 * change.get("backlash", 0.0), 0.0)
        passed = joints.gravity * np.sin(q) + joints.link * a  # of the link: friction is that of the motor's side
        effort = joints.gain * torque + on * gap * np.sign(passed)
        noise = [
            coloured(rng, v.shape, rms, 0.01, last) for rms, last in zip((0.005, 0.3, 0.15, 0.2), lasts, strict=True)
        ]
        load = passed + noise[2]
        effort = effort + joints.gain * noise[3]
        yield t, np.stack([q, v + noise[0], a + noise[1], load, effort, np.full_like(v, np.nan)], axis=1)


def calibrated(joints: Joints, seed: int, seconds: float = 60.0) -> ModelMonitor:
    """A monitor with the health of a sound run, of a minute unless told otherwise."""
    rng = np.random.default_rng([seed, 1])
    seen = np.concatenate([chunk[::SPARSE, :5] for _, chunk in readings(joints, seconds, rng, {}, 1e9)])
    return health_of(joints.models(), seen, SPARSE * DT).monitor(joints.models())


@dataclass(frozen=True)
class Watched:
    """By joint: motion from the change to the right and to the first cause [s], and causes named before."""

    right: np.ndarray
    any_cause: np.ndarray
    early: np.ndarray
    pushed: np.ndarray
    last_cause: np.ndarray


def watched(joints: Joints, monitor: ModelMonitor, change: str, seconds: float, seed: int) -> Watched:
    """Run the monitor over one change, or over none."""
    expected, sizes = CHANGES.get(change, ("none", {}))
    codes = [k + 1 for k, name in enumerate(CAUSES) if name.startswith(expected)]
    n, rng = joints.gain.size, np.random.default_rng([seed, 2, len(change)])
    memory, shown = monitor.start()
    table, warm = shown.reshape(n, -1), np.full(n, ROOM)
    right, first = np.full(n, np.inf), np.full(n, np.inf)
    early, pushed, moved = np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n)
    before = np.zeros(n)
    at = BEGIN_S if sizes else np.inf
    for t, chunk in readings(joints, seconds, rng, sizes, at):
        for k in range(t.size):
            needed = monitor.needed(chunk[k], warm)
            monitor.tick(chunk[k], needed, memory, shown)
            cause = table[:, 1]
            if t[k] < at:
                early += (cause > 0.0) & (before <= 0.0)
            else:
                moved += DT * (np.abs(chunk[k, 1]) > 0.05)
                first = np.where(np.isinf(first) & (cause > 0.0), moved, first)
                right = np.where(np.isinf(right) & np.isin(cause, codes), moved, right)
                pushed |= cause < 0.0
            before = cause.copy()
    return Watched(right, first, early, pushed, before)


def monitor_rows(count: int, hours: float, seed: int, progress: Progress) -> list[BenchmarkRow]:
    """Rows of `python -m tests.benchmarks monitor`."""
    rng = np.random.default_rng([seed, 0])
    joints = Joints.drawn(rng, count)
    monitor = calibrated(joints, seed)
    rows = [*_cost(count)]
    for number, change in enumerate(CHANGES):
        progress(change, 0.5 * number / len(CHANGES))
        found = watched(joints, monitor, change, BEGIN_S + WAIT_S, seed)
        which = joints.servo if "backlash" in change else np.ones(count, dtype=bool)
        if change == "collision":
            rows.append(BenchmarkRow.share("collision: told as a push", found.pushed.tolist(), "min", 0.95))
            rows.append(
                BenchmarkRow.share("collision: told as a change", np.isfinite(found.any_cause).tolist(), "max", 0.0)
            )
            continue
        delay = found.right[which]
        rows.append(BenchmarkRow.share(f"{change}: right cause within 40 s", np.isfinite(delay).tolist()))
        rows.append(
            BenchmarkRow.share(f"{change}: any cause within 40 s", np.isfinite(found.any_cause[which]).tolist())
        )
        first = found.any_cause[which]
        rows.append(BenchmarkRow.of_values(f"{change}: motion until noticed", "s", first[np.isfinite(first)]))
        rows.append(BenchmarkRow.of_values(f"{change}: motion until the right cause", "s", delay[np.isfinite(delay)]))
        if change == "friction +20 %":
            soon = (found.any_cause <= 2.0).tolist()
            rows.append(BenchmarkRow.share("friction +20 %: noticed within 2 s of motion", soon, "min", 1.0))
    progress("hours without a change", 0.5)
    still = watched(joints, monitor, "", 3600.0 * hours / count, seed)
    rows.append(BenchmarkRow("joint-hours without a change", hours, "h"))
    rows.append(BenchmarkRow("false alarms in these", float(still.early.sum()), "", 0.0, "max"))
    return rows


def _cost(count: int) -> list[BenchmarkRow]:
    """What a tick costs a joint, of six joints."""
    joints = Joints.drawn(np.random.default_rng(0), 6)
    monitor = ModelMonitor(joints.models(), 0.5, 0.01)
    memory, shown = monitor.start()
    _, chunk = next(readings(joints, CHUNK_S, np.random.default_rng(1), {}, np.inf))
    warm, spent = np.full(6, ROOM), []
    for row in chunk:
        begin = time.perf_counter()
        needed = monitor.needed(row, warm)
        monitor.tick(row, needed, memory, shown)
        spent.append(time.perf_counter() - begin)
    found = BenchmarkRow.of_values("a joint's tick, of six", "us", np.array(spent[100:]), 1e6 / 6.0)
    return [BenchmarkRow(found.name, found.value, "us", 5.0, "max", p99=found.p99, n=found.n)]
