# ruff: noqa: E501  (one row of the table a line)
"""Friction and other torques of one joint whose load is measured, what only some runs have, and what is no effect."""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from drake_tc.logs.record import Run

from .. import stick_slip
from ..rigs import Extra, Joint, Motion, motion, record, servo
from ..stick_slip import Servo
from .case import ANY, NULL, RED, Case, Is, Record
from .recorders import changed, logs_of, recorder
from .timing import hung

NOTHING: frozenset[str] = frozenset()
NOISY = Joint(torque_noise=0.25)
QUIET = Joint(torque_noise=0.05, encoder_step=1e-5)
PLAIN = Joint(duration=12.0, period=4e-3, torque_noise=0.2)


def drag(m: Motion) -> np.ndarray:
    return 1.2 * m.v * np.abs(m.v)


def ripple(m: Motion) -> np.ndarray:
    return 0.9 * np.cos(9.0 * m.q + 0.4)


def constant(size: float) -> Extra:
    return lambda m: size * np.ones_like(m.q)


def square(m: Motion) -> np.ndarray:
    """A ripple whose form is beyond the library."""
    return 2.0 * np.sign(np.sin(40.0 * m.q))


def gear_loss(m: Motion) -> np.ndarray:
    """15 % of the load's torque while the joint drives the load, 35 % while the load drives the joint."""
    return np.asarray(np.where(m.tau * m.v > 0.0, 0.15, 0.35) * np.abs(m.tau) * np.sign(m.v))


def of_motor(m: Motion) -> np.ndarray:
    """Friction of a tenth of the torque on the motor's side, friction included: M = T + 0.1 |M| sign(v)."""
    rest = m.tau + QUIET.inertia * m.a + QUIET.viscous * m.v + QUIET.coulomb * np.sign(m.v)
    return np.asarray(rest / (1.0 - 0.1 * np.sign(rest * m.v)) - rest)


DRAG = {"quadratic_viscous": {"quadratic_viscous": Is(1.2, 0.02)}}
PLANTED = [
    Case("friction: nothing is missing", logs_of(NOISY), seeds=(0, 1, 2, 3), values={"viscous.viscous": 6.0, "coulomb.coulomb": 3.0, "drive.gain": Is(0.08, 0.02)}),
    Case("friction: quadratic", logs_of(replace(NOISY, extra=drag)), DRAG, seeds=(0, 1)),
    Case("friction: Stribeck", logs_of(replace(NOISY, extra=lambda m: 2.0 * np.exp(-((m.v / 0.2) ** 2)) * np.sign(m.v))),
         {"stribeck": {"stribeck": Is(2.0, 0.15), "stribeck_velocity": Is(0.2, 0.2)}}),
    Case("friction: ripple", logs_of(replace(NOISY, extra=ripple)), {"torque_ripple": {"cycles_per_turn": Is(9.0, 0.01)}}),
    Case("friction: grows with the load", logs_of(replace(NOISY, extra=lambda m: 0.15 * np.abs(m.tau) * np.sign(m.v))),
         {"load_dependent_friction": {"load_friction": 0.15}}),
    Case("friction: ripple and quadratic", logs_of(replace(NOISY, extra=lambda m: ripple(m) + drag(m))), DRAG | {"torque_ripple": {"cycles_per_turn": Is(9.0, 0.01)}}),
    Case("friction: a declared quadratic friction is not missing",
         logs_of(replace(NOISY, extra=drag), rig={"declared": {"rotor_inertia": 0.3, "quadratic_viscous": 1.2}}),
         values={"viscous.viscous": Is(6.0, 0.02)}),
    Case("friction: a gear that is hard to back-drive", logs_of(replace(QUIET, extra=gear_loss)),
         {"directional_efficiency": {"driving_friction": 0.15, "backdriven_friction": 0.35}}),
    Case("friction: grows with the torque on the motor's side", logs_of(replace(QUIET, extra=of_motor)),
         allowed=(frozenset({"load_dependent_friction"}), frozenset({"directional_efficiency"})), verdicts=ANY - NULL),
    Case("friction: only viscous friction differs by direction",
         logs_of(replace(NOISY, extra=lambda m: 1.2 * m.v * np.sign(m.v))),
         {"asymmetric_friction": {"viscous_asymmetry": Is(1.2, 0.1)}}),
    Case("friction: a load over the position",
         logs_of(replace(QUIET, extra=lambda m: 2.0 * np.exp(-(((m.q - 0.2) / 0.2) ** 2)))), {"position_dependent_load": {}},
         verdicts=ANY - NULL),
    Case("friction: a ripple of another form is left", logs_of(replace(servo(torque_noise=0.05), extra=square)),
         never=frozenset({"servo_integrator"}), verdicts=ANY - NULL),
]  # fmt: skip


def celsius(time: np.ndarray, of: int) -> np.ndarray:
    """A joint that warms from 20 degrees, by another course in every run."""
    return np.asarray(20.0 + (25.0 + 5.0 * of) * (1.0 - np.exp(-time / (4.0 + 2.0 * of))))


def warming(joint: Joint, by: float, constant_by: float = 0.0) -> Record:
    """Friction that loses the share `by` of its size with each degree above 25, and a torque constant of which
    `constant_by` is lost.
    """

    def run(number: int, seed: int) -> Run:
        shift = 0.9 * number
        made, m = record(joint, f"run_{number}", shift, 1000 * seed + number), motion(joint, shift)
        degrees = celsius(m.time, number)
        less = by * (degrees - 25.0) * (joint.viscous * m.v + joint.coulomb * np.sign(m.v))
        current = (made.columns["joint/current"] - joint.gain * less) / (1.0 - constant_by * (degrees - 25.0))
        return changed(made, current=current, temperature=degrees)

    return recorder({"joint": "joint", "drive": "current", "declared": {"rotor_inertia": joint.inertia}}, run)


WARM = replace(QUIET, duration=24.0)
TEMPERATURE = [
    Case("friction: falls as the joint warms", warming(WARM, 0.012), {"thermal_friction": {}}),
    Case("friction: a torque constant that falls as the joint warms", warming(WARM, 0.0, 0.003), never=frozenset({"thermal_friction"}), verdicts=ANY - NULL),
    Case("friction: a joint that warms without any change", warming(WARM, 0.0)),
]  # fmt: skip


def gain_of(asked: object, joint: Joint) -> Record:
    """The log of a current drive whose current is `asked(current, position)` for the one that arrives."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{"joint/current": asked(table["joint/current"], table["joint/position"])})  # type: ignore[operator]

    return logs_of(joint, change)


def wandering(size: float) -> Extra:
    """A random walk of a torque sensor, to `size` [N m] (standard deviation) at the end of a run."""

    def walk(m: Motion) -> np.ndarray:
        steps = np.random.default_rng(round(1e6 * abs(float(m.q[0])))).standard_normal(m.q.size)
        return np.asarray(size * np.cumsum(steps) / np.sqrt(m.q.size))

    return walk


CLEAR = Joint(torque_noise=0.02)
LARGEST = 1.6
"""Of the current that arrives [A]."""
BESIDE_WALK = replace(QUIET, sensor=wandering(0.1))
NEIGHBOURS: dict[str, Extra] = {
    "cogging": lambda m: 0.8 * np.cos(18.0 * m.q),
    "friction over the angle": lambda m: 0.8 * np.cos(9.0 * m.q) * np.sign(m.v),
    "load-dependent friction": lambda m: 0.2 * np.abs(m.tau) * np.sign(m.v),
    "viscous friction over the angle": lambda m: 4.0 * np.sin(2.0 * m.q) * m.v,
}
UNCOMMON = [
    Case("friction: a torque constant that falls with the current",
         gain_of(lambda i, q: i / (1.0 - np.abs(i) / (6.0 * LARGEST)), CLEAR), {"drive_compression": {"half_effort": 6.0 * LARGEST}}),
    Case("friction: a torque constant that varies over two waves of the angle",
         gain_of(lambda i, q: i / (1.0 + 0.08 * np.cos(2.0 * q)), QUIET),
         {"gain_ripple": {"gain_cosine": Is(0.08, 0.1), "cycles_per_turn": 2.0}}),
    Case("friction: a torque constant that varies over eighteen waves of the angle",
         gain_of(lambda i, q: i / (1.0 + 0.05 * np.cos(18.0 * q) - 0.03 * np.sin(18.0 * q)), QUIET),
         {"gain_ripple": {"gain_cosine": Is(0.05, 0.1), "gain_sine": Is(-0.03, 0.1), "cycles_per_turn": Is(18.0, 0.01)}}),
    Case("friction: a torque constant that varies, beside a sensor that wanders",
         gain_of(lambda i, q: i / (1.0 + 0.15 * np.sin(4.0 * q + 0.5)), replace(CLEAR, sensor=wandering(0.05))),
         {"gain_ripple": {"cycles_per_turn": Is(4.0, 0.03)}}, verdicts=ANY - NULL, seeds=(0, 1)),
    *(Case(f"friction: {name} is no varying torque constant", logs_of(replace(QUIET, extra=extra)),
           never=frozenset({"gain_ripple"})) for name, extra in NEIGHBOURS.items()),
    *(Case(f"friction: {name} beside a sensor that wanders is no varying torque constant",
           logs_of(replace(BESIDE_WALK, extra=extra)), never=frozenset({"gain_ripple"})) for name, extra in NEIGHBOURS.items()),
]  # fmt: skip

# ---- what only some runs have


def random_torque(size: float, highest_hz: float) -> Extra:
    """Torque [N m RMS] from 0.3 Hz up to the highest frequency that no column records; another one in every run."""

    def extra(m: Motion) -> np.ndarray:
        rng = np.random.default_rng(round(1e6 * abs(float(m.q[0]))))
        f = np.fft.rfftfreq(m.time.size, float(m.time[1]))
        spectrum = np.where((f > 0.3) & (f < highest_hz), np.fft.rfft(rng.standard_normal(m.time.size)), 0.0)
        torque = np.fft.irfft(spectrum, m.time.size)
        return np.asarray(size * torque / np.std(torque))

    return extra


def touch(size: float) -> Extra:
    """A hand that rests on the link from 8 to 16 s [N m]."""

    def extra(m: Motion) -> np.ndarray:
        since, until = (1.0 / (1.0 + np.exp(-(m.time - t) / 0.05)) for t in (8.0, 16.0))
        return np.asarray(size * (since - until))

    return extra


LONG = replace(QUIET, duration=24.0)
DRAGGED, BIASED = replace(PLAIN, extra=drag), replace(PLAIN, extra=constant(1.5))
BOTH = replace(PLAIN, extra=lambda m: drag(m) + 1.0)
FLOOR = 0.012
"""Noise floor of `LONG` [N m]."""
SOME = [
    Case("friction: a random torque below 4 Hz", logs_of(replace(LONG, duration=16.0, extra=random_torque(45.0 * FLOOR, 4.0))), verdicts=RED),
    Case("friction: a random torque below 20 Hz", logs_of(replace(LONG, duration=16.0, extra=random_torque(45.0 * FLOOR, 20.0))), verdicts=RED),
    Case("friction: a touch of eight seconds in a training run", logs_of([replace(LONG, extra=touch(75.0 * FLOOR)), LONG, LONG]), verdicts=RED),
    Case("friction: a touch of eight seconds in a held-out run", logs_of([LONG, LONG, replace(LONG, extra=touch(75.0 * FLOOR))]), verdicts=RED),
    Case("friction: quadratic in all runs but the held-out one", logs_of([DRAGGED, DRAGGED, PLAIN]), verdicts=ANY),
    Case("friction: a constant torque of one training run in three", logs_of([BIASED, PLAIN, PLAIN, BIASED], train=3), verdicts=ANY),
    Case("friction: a constant torque of one training run in two", logs_of([BIASED, PLAIN, BIASED]), verdicts=ANY),
    Case("friction: a constant torque that the held-out run lacks", logs_of([BIASED, BIASED, PLAIN]), verdicts=ANY),
    Case("friction: quadratic in all runs, a constant torque in all but the held-out one",
         logs_of([BOTH, BOTH, BOTH, DRAGGED], train=3), {"quadratic_viscous": {}}, verdicts=ANY),
    Case("friction: a spring that pushes the joint away", logs_of(replace(PLAIN, extra=lambda m: -6.0 * m.q + 1.5)),
         never=frozenset({"cable_spring"}), verdicts=ANY - NULL),
    Case("friction: differs between the training runs", logs_of([NOISY, replace(NOISY, coulomb=4.5), NOISY]), verdicts=ANY),
]  # fmt: skip

# ---- a gain that depends on the direction, under friction that outweighs the load


def mostly_friction(number: int, seed: int) -> Run:
    joint = Joint(drive="position_servo", gain=2e-3, viscous=10.0, coulomb=20.0)
    shift = 0.9 * number + 0.17 * seed
    m = motion(joint, shift)
    torque = 0.3 * m.tau - 3.0
    need = torque + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v)
    effort = joint.gain * need * (1.0 + 0.14 * np.sign(m.v))
    noise = 0.02 * np.random.default_rng([seed, number]).standard_normal(m.q.size)
    return changed(record(joint, f"run_{number}", shift), torque=torque + noise, position_command=m.q + effort)


# ---- a joint that sticks


def stop_and_go(static: float) -> Record:
    """Ramps of effort at rest up to `static` [N m], each followed by a slide of one second in turn of direction."""
    joint, starts, rest, slide = Joint(torque_noise=0.02), 12, 700, 500

    def run(number: int, seed: int) -> Run:
        rng, period = np.random.default_rng([seed, number]), joint.period
        q, effort, position = [], [], 0.0
        s, travel = np.arange(1, slide + 1) / slide, 0.6 + 0.1 * number
        for k in range(starts):
            side = 1.0 if k % 2 == 0 else -1.0
            speed = travel * (1.0 - np.cos(2 * np.pi * s)) / (slide * period)
            pull = travel * 2 * np.pi * np.sin(2 * np.pi * s) / (slide * period) ** 2
            friction = joint.inertia * pull + joint.viscous * speed + joint.coulomb
            q += [np.full(rest, position), position + side * travel * (s - np.sin(2 * np.pi * s) / (2 * np.pi))]
            effort += [joint.gain * side * np.linspace(0.2, static, rest), joint.gain * side * friction]
            position += side * travel
        size = starts * (rest + slide)
        columns = {
            "joint/position": np.concatenate(q) + 1e-6 * rng.standard_normal(size),
            "joint/torque": joint.torque_noise * rng.standard_normal(size),
            "joint/current": np.concatenate(effort),
        }
        return replace(joint, duration=size * period).run(f"run_{number}", columns)

    rig = {"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 0.3}, "drive_gain": joint.gain}
    return recorder(rig, run)


def sticking(servo: Servo) -> Record:
    """A soft servo that sticks most of the time; the rotor inertia is fitted."""

    def run(number: int, seed: int) -> Run:
        train, held = stick_slip.runs_of(servo, seed)
        return [*train, *held][number]

    return recorder(hung(servo, declared=["rotor_inertia"]), run, train=3)


STICKS = frozenset({"static_friction"}), frozenset({"stribeck"}), frozenset({"presliding_hysteresis"}), NOTHING
REST = [
    Case("friction: a gain by direction under friction that outweighs the load",
         recorder({"joint": "joint", "drive": "position_servo", "declared": {"rotor_inertia": 0.3}}, mostly_friction),
         {"velocity_sign_switch": {}}, values={"coulomb.coulomb": Is(20.0, 0.5)}),
    Case("friction: a joint that sticks before it slides", stop_and_go(6.0), allowed=STICKS, verdicts=ANY, values={"coulomb.coulomb": 3.0}),
    Case("friction: a joint that slides as it breaks away", stop_and_go(3.0), values={"coulomb.coulomb": 3.0}),
    Case("friction: a soft servo that sticks", sticking(Servo()), verdicts=NULL | RED, values={"coulomb.coulomb": Is(0.16, 0.15), "drive.gain": Is(1.0 / 3.0, 0.05)}),
]  # fmt: skip

# ---- a geared joint whose friction outweighs its load


def geared(load: object, memory: float = 0.02, **changes: object) -> Record:
    """Ornstein-Uhlenbeck noise of 3 % on the current."""
    from ..pendulum_rig import Swing, record

    swing = Swing(duration=12.0, period=4e-3, moment=0.3, zero=0.0, constant=0.0, inertia=0.01, coulomb=1.5, viscous=0.5,
                  **changes)  # type: ignore[arg-type] # fmt: skip

    def run(number: int, seed: int) -> Run:
        made = record(swing, f"run_{number}", 1000 * seed + number, (0.0, 0.37, 1.3)[number])
        current = made.columns["joint/current"]
        pole = float(np.exp(-made.period / memory))
        noise = lfilter(
            [1.0], [1.0, -pole], np.random.default_rng([seed, number]).standard_normal(current.size + 5000)
        )[5000:]
        return changed(made, current=current + 0.03 * np.sqrt(np.mean(current**2)) * noise / np.std(noise))

    return recorder({"joint": "joint", "drive": "current", "load": load, "drive_gain": swing.gain}, run)


SMALL = {"pendulum": {"mass": 0.3 / (9.81 * 0.3), "length": 0.3}}
LOUD = frozenset({"unexplained_residual", "cannot_tell"})
GEARED = [
    Case("friction: coloured noise of the current under a small pendulum", geared(SMALL), verdicts=LOUD),
    Case("friction: coloured noise of the current under an unknown load", geared("unknown"), verdicts=LOUD),
    Case("friction: slow noise of the current under an unknown load", geared("unknown", 0.3), verdicts=LOUD),
    Case("friction: a torque of position and speed under a small pendulum",
         geared(SMALL, extra=lambda q, v, a: 0.25 * np.sin(3.0 * q) * np.tanh(v / 0.2) * np.abs(v)),
         allowed=(NOTHING, frozenset({"position_dependent_friction"})), verdicts=RED),
]  # fmt: skip

CASES = [*PLANTED, *TEMPERATURE, *UNCOMMON, *SOME, *REST, *GEARED]
