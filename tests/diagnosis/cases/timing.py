# ruff: noqa: E501  (one row of the table a line)
"""Ages, holds and delays of the channels, and clocks that scatter."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from drake_tc.logs.record import Run

from ..log_files import Change
from ..rigs import WAVES, Joint, Logged, motion, record, servo, sines
from ..stick_slip import JOINT, Servo, simulated
from .case import ANY, NULL, RED, Case, Is, Record
from .recorders import changed, logs_of, recorder

NOTHING: frozenset[str] = frozenset()
DELAY, LAG = frozenset({"delay"}), frozenset({"current_lag"})
SHIFTS = (0.0, 0.4, 0.7)
QUIET = Joint(torque_noise=0.05, encoder_step=1e-5)

# ---- goals that are written and held once a cycle, and logged at another instant of the cycle

PARTS, CYCLE = 5, 0.01
LIGHT = Servo(
    period=CYCLE / PARTS, duration=25.0, stiffness=12.0, inertia=0.02, viscous=0.7, coulomb=0.12, mass=0.5, length=0.18
)


def hung(true: Servo, **keys: object) -> dict[str, object]:
    """The rig file of a position servo under its pendulum."""
    load = {"pendulum": {"mass": true.mass, "length": true.length}}
    declared = {"rotor_inertia": true.inertia}
    document = {"joint": JOINT, "drive": "position_servo", "load": load, "declared": declared} | keys
    return {key: value for key, value in document.items() if value is not None}


def goals(after: int, **keys: object) -> Record:
    """Each goal is logged `after` fifths of a cycle after it was written; negative: before."""
    logged = Servo(period=CYCLE, duration=LIGHT.duration)
    waves = ((0.15, 0.6, 0.0), (0.37, 0.5, 1.1), (0.61, 0.35, 2.3))

    def run(number: int, seed: int) -> Run:
        goal = np.repeat(sines(logged.times(), waves, SHIFTS[number])[0], PARTS)
        acting = np.concatenate([np.full(max(-after, 0), goal[0]), goal])[: goal.size]
        position = LIGHT.encoder(simulated(LIGHT, acting), np.random.default_rng([seed, number]))
        first = max(after, 0)
        columns = {f"{JOINT}/position": position[first::PARTS], f"{JOINT}/position_command": goal[first::PARTS]}
        return logged.run(f"run_{number}", columns)

    return recorder(hung(LIGHT, **keys), run)


GOALS = [
    Case("timing: a goal logged after it was written is no delay", goals(1), values={"viscous.viscous": Is(0.7, 0.02)}),
    Case(
        "timing: a goal logged before it is written is no delay", goals(-2), values={"viscous.viscous": Is(0.7, 0.02)}
    ),
    Case(
        "timing: the same goal is late where the rig file states the hold",
        goals(-2, command_hold=True),
        {"delay": {"delay": Is(0.4 * CYCLE, 0.0, 6e-4)}},
        verdicts=ANY,
    ),
    Case(
        "timing: a goal one cycle late beyond its hold",
        goals(-5),
        {"delay": {"delay": Is(CYCLE, 0.6)}},
        verdicts=ANY,
    ),
]

# ---- commands that are held or not, of a servo that is integrated in fine steps

HELD = Servo(period=0.01, duration=25.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.05, length=0.15)
SLOW_GOALS = Servo(
    period=0.02, duration=30.0, encoder_step=1e-6, stiffness=8.0, inertia=0.004, viscous=0.2, coulomb=0.05, mass=0.4,
    length=0.15,
)  # fmt: skip
FINE = 2e-4


def commanded(true: Servo, waves: object = WAVES, *, held: bool = True, late: float = 0.0, **keys: object) -> Record:
    """A servo under goals that are held for a logged period, or follow a curve, and act `late` seconds later."""

    def run(number: int, seed: int) -> Run:
        shift = SHIFTS[number] + 0.13 * seed
        time = true.times()
        sent = sines(time, waves, shift)[0]
        if held:
            position = simulated(true, sines(np.maximum(time - late, 0.0), waves, shift)[0])
        else:
            fine = replace(true, period=FINE)
            position = simulated(fine, sines(fine.times(), waves, shift)[0])[:: round(true.period / FINE)]
        read = true.encoder(position, np.random.default_rng([seed, number]))
        return true.run(f"run_{number}", {f"{JOINT}/position": read, f"{JOINT}/position_command": sent})

    return recorder(hung(true, **keys), run)


FITTED = {"declared": ["rotor_inertia"]}
VISCOUS = Is(0.25, 0.0, HELD.stiffness * FINE + 2e-3, interval=True)
"""The integrator's first-order step costs up to K h; what the logs leave of the age is in the interval."""
LATE = replace(HELD, coulomb=0.12)
LATE_WAVES = ((0.15, 0.45, 0.0), (0.37, 0.45, 1.1), (0.61, 0.25, 2.3), (0.93, 0.12, 0.4))
COMMANDS = [
    Case("timing: a command held at 100 Hz", commanded(HELD, **FITTED), values={"viscous.viscous": VISCOUS}),
    Case(
        "timing: a continuous command at 100 Hz",
        commanded(HELD, held=False, **FITTED),
        values={"viscous.viscous": VISCOUS},
    ),
    Case(
        "timing: a hold that the rig file denies is a delay or friction, and nothing else",
        commanded(HELD, command_hold=False, **FITTED),
        allowed=(NOTHING, DELAY),
        verdicts=ANY,
    ),
    Case(
        "timing: a goal held for 20 ms adds no inertia",
        commanded(SLOW_GOALS, ((0.23, 0.5, 0.0), (0.71, 0.4, 1.1), (1.9, 0.15, 2.3)), command_hold=True, **FITTED),
        values={"rotor_inertia.rotor_inertia": Is(0.004, 0.0, 0.2 * 8.0 * 0.02**2 / 12.0)},
        seeds=(0, 1),
    ),
    Case(
        "timing: a late goal and an undeclared rotor are told from a lag",
        commanded(LATE, LATE_WAVES, late=0.02, declared=None),
        {"delay": {"delay": Is(0.02, 0.0, 1e-3)}, "rotor_inertia": {"rotor_inertia": 0.008}},
        verdicts=ANY,
    ),
]

# ---- a sampled loop that sets a current once a period

PERIOD = 5e-3
INERTIA, MOMENT, MASS = 0.05, 3.2, 2.0
ENCODER = 2 * np.pi / 2**16
ARM = {"mass": MASS, "length": MOMENT / (MASS * 9.81), "inertia": 0.14}
DRIVEN = {"joint": "joint", "drive": "current", "load": {"pendulum": ARM}, "declared": {"rotor_inertia": INERTIA}}


def looped(shift: float, late: float = 0.0, *, averaged: bool = False) -> Run:
    """A PD loop [A] on a pendulum; the current acts `late` after it is recorded, and is held for a period.

    With `averaged`, the recorded current is the mean over the period before the sample.
    """
    count, each, gain, total = round(25.0 / PERIOD), round(PERIOD / 2.5e-4), 0.25, INERTIA + 0.14
    q, v, fine = 0.0, 0.0, 2.5e-4
    wait = [0.0] * (round(late / fine) + 1)
    position, current, mean = np.empty(count), np.empty(count), 0.0
    for k in range(count):
        t = k * PERIOD
        waves = ((0.7, 0.19, 0.0), (0.5, 0.47, 1.1), (0.25, 0.83, 2.3))
        goal = min(t, 1.0) * sum(a * np.sin(2 * np.pi * f * (t + shift) + p) for a, f, p in waves)
        measured = ENCODER * round(q / ENCODER)
        asked = gain * (40.0 * (goal - measured) - 2.0 * v)
        position[k], current[k], mean = measured, mean if averaged else asked, 0.0
        for _ in range(each):
            wait.append(asked)
            acts = wait.pop(0)
            mean += acts / each
            faster = v + fine * (acts / gain - MOMENT * np.sin(q) - 0.35 * v) / total
            v = np.sign(faster) * max(abs(faster) - fine * 0.3 / total, 0.0)
            q += fine * v
    logged = Logged(period=PERIOD, duration=25.0)
    return logged.run("run", {"joint/position": position, "joint/current": current})


def driven(late: float = 0.0, change: Callable[[Run], Run] = lambda run: run, *, averaged: bool = False) -> Record:
    def run(number: int, seed: int) -> Run:
        made = looped(SHIFTS[number] + 0.17 * seed, late, averaged=averaged)
        return replace(change(made), name=f"run_{number}")

    return recorder(DRIVEN, run)


def recorded_late(samples: int, column: str = "current") -> Callable[[Run], Run]:
    """The column as it was so many samples before; its first sample is repeated."""

    def change(run: Run) -> Run:
        values = run.columns[f"joint/{column}"]
        return changed(run, **{column: np.concatenate([np.full(samples, values[0]), values[: values.size - samples]])})

    return change


def later(column: str, samples: int) -> Change:
    """As `recorded_late`, of a table."""
    name = f"joint/{column}"
    return lambda table: table.assign(**{name: table[name].shift(samples).bfill()})


def stepped(late: float) -> Record:
    """A servo on a pendulum; its goal jumps, is held for the 2 ms of the log, and arrives `late`."""
    stiffness, period, fine, step, total = 12.0, 2e-3, 1e-4, ENCODER / 16.0, 0.02

    def run(number: int, seed: int) -> Run:
        goals = np.repeat(np.random.default_rng([seed, number]).uniform(-1.2, 1.2, 15), 500)
        q, v, position = 0.0, 0.0, np.empty(goals.size)
        wait = [0.0] * (round(late / fine) + 1)
        for k, goal in enumerate(goals.tolist()):
            position[k] = step * round(q / step)
            for _ in range(round(period / fine)):
                wait.append(goal)
                faster = v + fine * (stiffness * (wait.pop(0) - q) - 1.3 * np.sin(q) - 0.35 * v) / total
                v = np.sign(faster) * max(abs(faster) - fine * 0.15 / total, 0.0)
                q += fine * v
        logged = Logged(period=period, duration=goals.size * period)
        return logged.run(f"run_{number}", {"joint/position": position, "joint/position_command": goals})

    rig = {"joint": "joint", "drive": "position_servo", "load": "unknown", "drive_gain": 1.0 / stiffness}
    return recorder(rig, run)


FRICTION = {"viscous.viscous": 0.35, "coulomb.coulomb": 0.3}
EFFORTS = [
    Case("timing: half a period of hold of a current is no delay", driven()),
    Case("timing: a current that is averaged over the period", driven(averaged=True), values=FRICTION),
    Case("timing: a current three periods late", driven(3 * PERIOD), {"delay": {"delay": Is(3.25 * PERIOD, 0.0, 0.35 * PERIOD)}}, verdicts=ANY),
    Case("timing: a current that is logged two samples late", driven(0.0, recorded_late(2)), values=FRICTION),
    Case("timing: a current that is logged four samples late", driven(0.0, recorded_late(4)), values=FRICTION),
    Case("timing: half a hold of a goal at 500 Hz is no delay", stepped(0.0), values={"viscous.viscous": Is(0.35, 0.02)}),
    Case("timing: a goal 3 ms late at 500 Hz", stepped(3e-3), {"delay": {"delay": Is(3.5e-3, 0.0, 1e-3)}}, verdicts=ANY),
    Case("timing: a current one sample late beside a torque sensor is an age or a delay", logs_of(QUIET, later("current", 1)), allowed=(NOTHING, DELAY)),
    Case("timing: a current one sample early beside a torque sensor is an age or a delay", logs_of(QUIET, later("current", -1)), allowed=(NOTHING, DELAY)),
    Case(
        "timing: a command 12 ms late",
        logs_of(servo(torque_noise=0.05, encoder_step=1e-5), lambda table: at(table, "position_command", 0.012)),
        {"delay": {"delay": 0.012}},
    ),
    Case("timing: a torque sensor 6 ms late", logs_of(QUIET, lambda table: at(table, "torque", -0.006)), {"delay": {"delay": 0.006}}),
]  # fmt: skip


def at(table: pd.DataFrame, column: str, ahead: float) -> pd.DataFrame:
    """The table with the column as it is so much later."""
    time, name = table["time"].to_numpy(), f"joint/{column}"
    return table.assign(**{name: CubicSpline(time, table[name])(np.maximum(time + ahead, 0.0))})


# ---- a torque sensor that is late by more than its torque takes to change


def sensed(late: float) -> Record:
    """A pendulum with stiction under a PD loop; the torque between gear and link is recorded `late` [s]."""
    gain, rotor, link, moment, viscous, coulomb, fine = 0.125, 0.9, 0.5, 20.0, 4.0, 5.0, 2e-4
    log = Logged(period=2e-3, duration=16.0)

    def run(number: int, seed: int) -> Run:
        shift, time = (0.0, 0.7, 1.3)[number] + 0.31 * seed, log.times()
        goal = 0.5 * np.sin(0.9 * time + shift) + 0.25 * np.sin(4.1 * time + 2.0 * shift)
        rate, q, v, out = np.gradient(goal, log.period), float(goal[0]), 0.0, np.empty((3, time.size))
        for k in range(time.size):
            current = gain * (270.0 * (goal[k] - q) + 30.0 * (rate[k] - v) + moment * np.sin(q))
            for step in range(round(log.period / fine)):
                drive = current / gain - viscous * v - moment * np.sin(q)
                sticks = v == 0.0 and abs(drive) <= coulomb
                direction = np.sign(v) if v != 0.0 else np.sign(drive)
                acceleration = 0.0 if sticks else (drive - coulomb * direction) / (rotor + link)
                if step == 0:
                    out[:, k] = q, current, link * acceleration + moment * np.sin(q)
                faster = v + fine * acceleration
                v = 0.0 if faster * v < 0.0 else faster
                q += fine * v
        noise = 0.1 * np.random.default_rng([seed, number]).standard_normal(time.size)
        torque = np.interp(time - late, time, out[2]) + noise
        return log.run(f"run_{number}", {"joint/position": out[0], "joint/current": out[1], "joint/torque": torque})

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": rotor}}, run)


OF_SENSED = {"viscous.viscous": 4.0, "coulomb.coulomb": 5.0}
SENSORS = [
    Case("timing: a torque sensor in time", sensed(0.0), verdicts=ANY, values=OF_SENSED),
    Case("timing: a torque logged 20 ms late", sensed(0.02), allowed=(NOTHING, DELAY), verdicts=ANY, values=OF_SENSED),
    Case("timing: a torque logged 30 ms late", sensed(0.03), allowed=(NOTHING, DELAY), verdicts=ANY, values=OF_SENSED),
]

# ---- clocks

WRITTEN, TICK = 0.01, 1e-3
STEERED = Servo(period=TICK, duration=30.0, stiffness=12.0, inertia=0.008, viscous=0.25, coulomb=0.05, length=0.15)


def scattered(period: float, late: float = 0.0, tick: float = TICK) -> Record:
    """Goals of 100 Hz that act `late` seconds after they are held, logged every `period` by another clock.

    Where the period is a multiple of that of the goals, the logger reads them up to a tenth of its period away.
    """

    def run(number: int, seed: int) -> Run:
        rng = np.random.default_rng([number, seed, round(1e4 * period)])
        fine = replace(STEERED, period=tick)
        goal = sines(np.arange(0.0, STEERED.duration, WRITTEN), WAVES, SHIFTS[number])[0]
        held, wait, every = np.repeat(goal, round(WRITTEN / tick)), round(late / tick), round(period / tick)
        acting = np.concatenate([np.full(wait, held[0]), held[: held.size - wait]])
        at = np.arange(every, held.size - every, every)
        aside = rng.uniform(-1.0, 1.0, at.size) if tick == TICK else np.zeros(at.size)
        read = held[at + np.round(0.1 * every * aside).astype(int)]
        logged = replace(STEERED, period=every * tick, duration=at.size * every * tick)
        position = logged.encoder(simulated(fine, acting)[at], rng)
        return logged.run(f"run_{number}", {f"{JOINT}/position": position, f"{JOINT}/position_command": read})

    return recorder(hung(STEERED), run)


def strokes(rng: np.random.Generator, seconds: float, fine: float) -> np.ndarray:
    """Minimum-jerk strokes [rad], one in four of them several times as fast as the others."""
    out, here = [np.zeros(round(0.03 / fine))], 0.0
    while sum(map(len, out)) * fine < seconds:
        goal, fast = rng.uniform(-1.0, 1.0), rng.choice([0.4, 0.6, 0.8, 4.0])
        s = np.arange(count := round(max(1.875 * abs(goal - here) / fast, 0.25) / fine)) / count
        out.append(here + (goal - here) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
        here = goal
    return np.concatenate(out)[: round(seconds / fine)]


Torque = Callable[[np.ndarray, np.ndarray], np.ndarray]


def stroked(
    scatter: float,
    extra: Torque | None = None,
    held: Torque | None = None,
    period: float = 4e-3,
    true_stamps: bool = False,
) -> Record:
    """A pendulum under a current drive, read at t_k + delta_k and stamped t_k, or, with `true_stamps`, t_k + delta_k."""
    fine, seconds, inertia, moment, gain = 1e-4, 30.0, 0.25, 3.0, 0.5
    length = moment / 9.81

    def run(number: int, seed: int) -> pd.DataFrame:
        q, rng = strokes(np.random.default_rng([seed, number]), seconds, fine), np.random.default_rng([seed, number, 1])
        time, v = np.arange(q.size) * fine, np.gradient(q, fine)
        torque = inertia * np.gradient(v, fine) + moment * np.sin(q) + 0.4 * v + 0.6 * np.sign(v) * (np.abs(v) > 1e-4)
        act = held if held is not None and number == 2 else extra
        torque = torque + (act(time, v) if act is not None else 0.0)
        stamps = np.arange(0.02, seconds - 0.02, period)
        aside = (scatter * rng.standard_normal(stamps.size)).clip(-0.45 * period, 0.45 * period)
        at = stamps + aside
        position = np.interp(at, time, q) + 2e-6 * rng.standard_normal(stamps.size)
        current = gain * np.interp(at, time, torque) + 0.01 * rng.standard_normal(stamps.size)
        told = (at if true_stamps else stamps).round(6)
        return pd.DataFrame({"time": told, "joint/position": position, "joint/current": current})

    rig = {
        "joint": "joint",
        "drive": "current",
        "load": {"pendulum": {"mass": 1.0, "length": length}},
        "declared": {"rotor_inertia": inertia - length**2},
        "drive_gain": gain,
    }
    return recorder(rig, run)


def touch(time: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.asarray(0.25 * ((time > 12.2) & (time < 13.0)))


def stribeck(time: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.asarray(0.25 * np.sign(v) * np.exp(-((v / 0.08) ** 2)) * (np.abs(v) > 1e-4))


ENCODER_12 = 2.0 * np.pi / 4096.0


def polled(*, jitter: bool) -> Change:
    """A 12-bit encoder; with `jitter` the clock's steps vary by 10 %."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        time = table["time"].to_numpy()
        period = float(time[1] - time[0])
        if jitter:
            time = time + 0.1 * period * np.random.default_rng(time.size).standard_normal(time.size).clip(-3.0, 3.0)
        smooth = {name: np.interp(time, table["time"], table[name]) for name in table.columns if name != "time"}
        error = smooth["joint/position_command"] - smooth["joint/position"]
        q = np.round(smooth["joint/position"] / ENCODER_12) * ENCODER_12
        return pd.DataFrame({"time": time, **smooth, "joint/position": q, "joint/position_command": q + error})

    return change


COARSE = servo(duration=24.0, period=5.3e-3, torque_noise=0.05)


def lost(row: int) -> Callable[[Run], Run]:
    """The log without one of its rows."""

    def change(run: Run) -> Run:
        columns = {name: np.delete(values, row) for name, values in run.columns.items()}
        return replace(run, time=np.delete(run.time, row), columns=columns, segment=run.segment[:-1])

    return change


CLOCKS = [
    Case("timing: goals of another clock, logged as often", scattered(0.01)),
    Case("timing: goals of another clock, logged at a quarter of their rate", scattered(0.04)),
    Case("timing: goals 40 ms late beside another clock", scattered(0.01, 0.04), {"delay": {"delay": Is(0.04, 0.0, 0.01)}}, verdicts=ANY, seeds=(0, 1)),
    Case("timing: clocks of goals and log that drift apart", scattered(0.0102, tick=2e-4), verdicts=NULL | RED),
    Case("timing: fast strokes whose instants scatter by 0.1 ms", stroked(1e-4)),
    Case("timing: fast strokes without scatter", stroked(0.0)),
    Case("timing: a touch of a held-out run beside scatter", stroked(1e-4, held=touch), verdicts=RED),
    Case("timing: a Stribeck friction beside scatter", stroked(1e-4, stribeck), {"stribeck": {"stribeck": Is(0.25, 0.15)}}),
    Case("timing: stamps that scatter by 0.3 ms at 1 kHz", stroked(3e-4, period=1e-3, true_stamps=True)),
    Case("timing: instants that scatter by 0.3 ms at 1 kHz", stroked(3e-4, period=1e-3)),
    Case("timing: a coarse encoder on an even clock", logs_of(COARSE, polled(jitter=False))),
    Case("timing: a coarse encoder on a clock that jitters", logs_of(COARSE, polled(jitter=True))),
    Case("timing: a row lost while the joint starts", driven(0.0, lost(40)), values=FRICTION),
    Case("timing: runs of two periods", logs_of([QUIET, replace(QUIET, period=5e-3), QUIET])),
]  # fmt: skip

# ---- channels on slower clocks: each row repeats their last sample

SPIKED = Logged(period=5e-3, duration=60.0)


def spikes(topic: float) -> Record:
    """A load that jumps by up to 15 N m about once a second and decays in 30 ms, and its torque from a slower topic."""

    def run(number: int, seed: int) -> Run:
        rng, time = np.random.default_rng([seed, number]), SPIKED.times()
        begins, sizes = rng.uniform(0.0, 60.0, 60), rng.uniform(-15.0, 15.0, 60)

        def load(at: np.ndarray) -> np.ndarray:
            since = at[:, None] - begins
            decay = np.exp(-np.maximum(since, 0.0) / 0.03) * (since >= 0.0)
            return np.asarray(3.0 * np.sin(2.1 * at) + np.sum(sizes * decay, axis=1))

        q, v, _ = sines(time, ((0.13, 0.5, 0.0), (0.41, 0.35, 1.1)), float(rng.uniform(0.0, 3.0)))
        columns = {
            "joint/position": q + 1e-5 * rng.standard_normal(q.size),
            "joint/current": 0.25 * (load(time) + 0.8 * v + np.sign(v)) + 2e-3 * rng.standard_normal(q.size),
            "joint/torque": load(topic * np.floor(time / topic)),
        }
        return SPIKED.run(f"run_{number}", columns)

    return recorder({"joint": "joint", "drive": "current"}, run)


def slow_encoder(spacing: int, noise: float, step: float) -> Record:
    """The encoder is read every `spacing` samples, and its last reading repeated."""
    joint = Joint(duration=30.0, inertia=3.0, torque_noise=0.05)

    def run(number: int, seed: int) -> Run:
        made = record(joint, f"run_{number}", SHIFTS[number], 1000 * seed + number)
        exact = motion(joint, SHIFTS[number]).q[::spacing]
        rng = np.random.default_rng([seed, number])
        read = replace(joint, encoder_noise=noise, encoder_step=step).encoder(exact, rng)
        return changed(made, position=np.repeat(read, spacing)[: made.time.size])

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 3.0}}, run)


GREEN_OR_LOUD = NULL | {"unexplained_residual", "cannot_tell"}
SLOWER = [
    Case("timing: a torque with spikes from a topic of 60 Hz in a log of 200 Hz", spikes(1.0 / 60.0), verdicts=GREEN_OR_LOUD,
         values={"drive.gain": 0.25}, seeds=(0, 1)),
    Case("timing: an encoder read every second sample", slow_encoder(2, 2e-4, 0.0), verdicts=GREEN_OR_LOUD),
    Case("timing: a coarse encoder read every fifth sample", slow_encoder(5, 2e-4, 2e-4), verdicts=GREEN_OR_LOUD),
]  # fmt: skip

CASES = [*GOALS, *COMMANDS, *EFFORTS, *SENSORS, *CLOCKS, *SLOWER]
