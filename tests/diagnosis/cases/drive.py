# ruff: noqa: E501  (one row of the table a line)
"""Drives: their scale, limits, integrators, windings and supplies; the rotor's inertia; servos with an inside."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit
from scipy.signal import lfilter, lsim

from drake_tc.logs.record import Run

from ..coarse_pendulum import LENGTH, MASS, ROTOR, pendulum
from ..log_files import Change
from ..rigs import COMMAND, Joint, Logged, Motion, Waves, record, servo, sines
from ..stick_slip import GRAVITY, JOINT, Servo
from .case import ANY, NULL, Case, Is, Record
from .recorders import SHIFTS, changed, logs_of, recorder

NOTHING: frozenset[str] = frozenset()
QUIET = Joint(torque_noise=0.05, encoder_step=1e-5)

# ---- scale

TORQUE = Joint(drive="torque", gain=1.0, torque_noise=0.05, encoder_step=1e-5)
WEAK = replace(TORQUE, gain=1.2)
GEARED = Joint(gain=1.0 / (0.07 * 100.0), torque_noise=0.05, encoder_step=1e-5)
KP, KD = 500.0, 4.0
STIFF = servo(gain=1.0 / KP, torque_noise=0.05, encoder_step=1e-5, viscous=6.0 + KD)
STRONG = replace(STIFF, gain=STIFF.gain / 1.15, viscous=6.0 + 1.15 * KD)
GAINS = {"proportional_gain": KP, "derivative_gain": KD}


def wrong(error: float) -> dict[str, dict[str, Is]]:
    return {"servo_gain": {"gain_error": Is(error, 0.0, 0.005)}}


SCALE = [
    Case("drive: a torque drive is told in N m", logs_of(TORQUE), values={"drive.gain": Is(1.0, 5e-3)}),
    Case("drive: a torque drive of another scale", logs_of(WEAK), values={"drive.gain": Is(1.2, 5e-3)}),
    Case("drive: a torque drive of another scale than declared", logs_of(WEAK, rig={"drive_gain": 1.0}), wrong(1.0 / 1.2 - 1.0)),
    Case("drive: right constants of a motor", logs_of(GEARED, rig={"torque_constant": 0.07, "gear_ratio": 100.0})),
    Case("drive: wrong constants of a motor", logs_of(GEARED, rig={"torque_constant": 0.08, "gear_ratio": 100.0}), wrong(0.07 / 0.08 - 1.0)),
    Case("drive: declared gains of a servo", logs_of(STIFF, rig=GAINS), values={"viscous.viscous": Is(10.0, 0.02)}),
    Case("drive: a servo that is stronger than declared", logs_of(STRONG, rig=GAINS), {"servo_gain": {}}),
    Case("drive: a right declared gain", logs_of(QUIET, rig={"drive_gain": 0.08})),
    Case("drive: a declared gain 12 % too small", logs_of(QUIET, rig={"drive_gain": 0.08 * 0.88}), wrong(-0.12)),
    Case("drive: a declared gain 15 % too large", logs_of(QUIET, rig={"drive_gain": 0.08 * 1.15}), wrong(0.15)),
]  # fmt: skip

# ---- windings, bridges, supplies

VOLTAGE = replace(QUIET, drive="voltage", gain=0.4)
BACK_EMF = 1.2


def delivering(joint: Joint, drive: Callable[[Motion, np.ndarray], np.ndarray]) -> Joint:
    """The joint whose drive acts on `drive(motion, effort)` instead of the effort; the load takes the difference."""

    def changed(m: Motion) -> np.ndarray:
        effort = joint.gain * (m.tau + joint.inertia * m.a + joint.viscous * m.v + joint.coulomb * np.sign(m.v))
        return np.asarray((drive(m, effort) - effort) / joint.gain)

    return replace(joint, sensor=changed)


def supply(time: np.ndarray) -> np.ndarray:
    return np.asarray(24.0 + 3.0 * np.sin(1.3 * time))


def celsius(time: np.ndarray) -> np.ndarray:
    return np.asarray(25.0 + 60.0 * np.sin(np.pi * time / 16.0) ** 2)


def lagging(m: Motion, effort: np.ndarray) -> np.ndarray:
    """R i + k_e qdot of T di/dt + i = (V - k_e qdot)/R."""
    response = effort - BACK_EMF * m.v
    _, lagged, _ = lsim(([1.0], [0.02, 1.0]), response - response[0], m.time)
    return np.asarray(lagged + response[0] + BACK_EMF * m.v)


def warm(m: Motion, effort: np.ndarray) -> np.ndarray:
    """R_25 i + k_e qdot of R i = V - k_e qdot, R = R_25 (1 + 0.0039 (T - 25))."""
    return np.asarray((effort - BACK_EMF * m.v) / (1.0 + 0.0039 * (celsius(m.time) - 25.0)) + BACK_EMF * m.v)


def with_column(name: str, values: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda table: table.assign(**{f"joint/{name}": values(table["time"].to_numpy())})


WINDINGS = [
    Case("drive: a supply that sags",
         logs_of(delivering(VOLTAGE, lambda m, y: y * supply(m.time) / 24.0), with_column("supply_voltage", supply)),
         {"supply_sag": {"supply_sensitivity": 1.0}}),
    Case("drive: a bridge at full duty",
         logs_of(delivering(VOLTAGE, lambda m, y: np.clip(y, -0.25 * supply(m.time), 0.25 * supply(m.time))),
                 with_column("supply_voltage", supply)),
         {"saturation": {"limit_per_volt": 0.25}}),
    Case("drive: a winding that warms", logs_of(delivering(VOLTAGE, warm), with_column("temperature", celsius)),
         {"winding_temperature": {"resistance_per_kelvin": 0.0039, "back_emf": BACK_EMF}}),
    Case("drive: a winding that lags", logs_of(delivering(VOLTAGE, lagging)), {"current_lag": {"lag": 0.02, "back_emf": BACK_EMF}}),
    Case("drive: a dead zone", logs_of(delivering(QUIET, lambda m, y: np.sign(y) * np.maximum(np.abs(y) - 0.05, 0.0))),
         {"deadzone": {"deadzone": Is(0.05, 0.1)}}, verdicts=ANY - NULL),
]  # fmt: skip

# ---- integral action

RATE = 1.5
SERVO = servo(torque_noise=0.05)
HANGING = replace(SERVO, encoder_noise=5e-5, torque_noise=0.0, extra=lambda m: 8.0 * np.sin(m.q) + 0.3 * m.a - m.tau)
"""Without the hand that pushes the other joint: a pendulum of 8 N m and 0.3 kg m^2."""


def integrating(joint: Joint, charges: tuple[float, ...], rig: dict[str, object], early: int = 0) -> Record:
    """y + RATE (I_0 + int y dt) = K (tau + ...), by the bilinear transform; RATE I_0 is `charge` first needs.

    `early`: samples by which the goal is logged before the servo acts on it.
    """

    def run(number: int, seed: int) -> Run:
        made = record(joint, f"run_{number}", SHIFTS[number], 1000 * seed + number)
        need = made.columns["joint/position_command"] - made.columns["joint/position"]
        half, need = 0.5 * RATE * joint.period, need - charges[number] * need[0]
        start = need[:1] * (1.0 - 1.0 / (1.0 + half))
        effort = lfilter([1.0, -1.0], [1.0 + half, half - 1.0], need, zi=start)[0]
        goal = made.columns["joint/position"] + effort
        return changed(made, position_command=np.append(goal[early:], np.full(early, goal[-1])))

    return recorder({"joint": "joint", "drive": "position_servo"} | rig, run)


def strong(number: int, seed: int) -> Run:
    """A pendulum on a servo with an integral rate of 8/s, above the frequencies of its motion."""
    joint, rate = servo(inertia=0.05, viscous=0.2, coulomb=1.0, duration=40.0), 8.0
    time = joint.times()
    q, v, a = sines(time, ((0.11, 0.6, 0.0), (0.17, 0.4, 0.9)), SHIFTS[number])
    need = joint.gain * (8.0 * np.sin(q) + joint.inertia * a + joint.viscous * v + joint.coulomb * np.sign(v))
    half = 0.5 * rate * joint.period
    start = need[:1] * (1.0 - 1.0 / (1.0 + half))
    effort = lfilter([1.0, -1.0], [1.0 + half, half - 1.0], need, zi=start)[0]
    torque = 8.0 * np.sin(q) + 0.1 * np.random.default_rng([seed, number]).standard_normal(time.size)
    return joint.run(
        f"run_{number}", {"joint/position": q, "joint/torque": torque, "joint/position_command": q + effort}
    )


KNOWN: dict[str, object] = {"declared": {"rotor_inertia": SERVO.inertia}}
RATES = {"servo_integrator": {"integral_rate": Is(RATE, 0.01)}}
OF_HANGING = {"load.inertia": Is(0.3 + SERVO.inertia, 0.01)}


def unknown(form: str) -> dict[str, object]:
    return {"load": {"unknown": form}, "drive_gain": SERVO.gain}


INTEGRATORS = [
    Case("drive: integral action that begins at zero", integrating(SERVO, (0.0, 0.0, 0.0), KNOWN), RATES,
         values={"drive.gain": Is(SERVO.gain, 0.01), "viscous.viscous": 6.0}),
    Case("drive: integral action that holds a load at first", integrating(SERVO, (1.0, 1.6, 0.7), KNOWN), RATES,
         values={"drive.gain": Is(SERVO.gain, 0.01), "viscous.viscous": 6.0}),
    Case("drive: integral action on a goal that is logged early", integrating(SERVO, (1.0, 1.6, 0.7), KNOWN, early=2),
         RATES | {"delay": {"delay": Is(0.004, 0.05)}}, values={"drive.gain": Is(SERVO.gain, 0.01), "viscous.viscous": 6.0}),
    Case("drive: integral action under an unknown pendulum", integrating(HANGING, (1.0, 1.6, 0.7), unknown("pendulum")), RATES,
         values=OF_HANGING | {"load.moment": Is(8.0, 0.01)}),
    Case("drive: integral action under a smooth load", integrating(HANGING, (1.0, 1.6, 0.7), unknown("smooth")), RATES, values=OF_HANGING),
    Case("drive: integral action above the frequencies of the motion",
         recorder({"joint": "joint", "drive": "position_servo", "declared": {"rotor_inertia": 0.05}}, strong),
         {"servo_integrator": {"integral_rate": Is(8.0, 0.02)}}, values={"drive.gain": Is(2e-3, 0.02)}),
    Case("drive: a declared integrator is accepted",
         integrating(SERVO, (1.0, 1.6, 0.7), {"declared": {"rotor_inertia": SERVO.inertia, "servo_integrator": None}}),
         values={"servo_integrator.integral_rate": Is(RATE, 0.02)}),
    Case("drive: a declared integrator of a known rate is accepted",
         integrating(SERVO, (0.0, 0.0, 0.0), {"declared": {"rotor_inertia": SERVO.inertia, "servo_integrator": RATE}})),
]  # fmt: skip

# ---- limits

LIMIT, ZERO, FINE = 0.11, 0.33, 2e-4
LIMITED = Servo(
    period=0.01, duration=20.0, stiffness=12.0, inertia=0.004, viscous=0.25, coulomb=0.2, mass=1.1, length=0.12
)
MOMENT = LIMITED.mass * GRAVITY * LIMITED.length


def limited(number: int, seed: int) -> Run:
    """J a = K clip(q_d - q) - m g l sin(q - z) - F_v v - F_c sign v, with rest as a state."""
    t, rng = LIMITED.times(), np.random.default_rng(40 + 3 * seed + number)
    waves = [(a, f * rng.uniform(0.8, 1.3), rng.uniform(0.0, 6.3)) for a, f in ((0.9, 0.13), (0.45, 0.37), (0.15, 0.9))]
    command = np.minimum(t, 1.0) * sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in waves)
    total = LIMITED.inertia + LIMITED.mass * LIMITED.length**2
    q, v, position = float(command[0]), 0.0, np.empty(t.size)
    for k, wanted in enumerate(command.tolist()):
        position[k] = q
        for _ in range(round(LIMITED.period / FINE)):
            drive = LIMITED.stiffness * min(max(wanted - q, -LIMIT), LIMIT)
            faster = v + FINE * (drive - MOMENT * np.sin(q - ZERO) - LIMITED.viscous * v) / total
            v = np.sign(faster) * max(abs(faster) - FINE * LIMITED.coulomb / total, 0.0)
            q += FINE * v
    read = LIMITED.encoder(position, rng)
    return LIMITED.run(f"run_{number}", {f"{JOINT}/position": read, f"{JOINT}/position_command": command})


UNWEIGHED = {"joint": JOINT, "drive": "position_servo", "load": "unknown", "drive_gain": 1.0 / LIMITED.stiffness}
LIMITS = [
    Case("drive: a limit that takes most of the effort away", recorder(UNWEIGHED, limited), {"saturation": {"limit": Is(LIMIT, 0.02)}},
         verdicts=ANY, values={"load.moment": Is(MOMENT, 0.02), "load.zero": Is(ZERO, 0.0, 0.02)}, seeds=(0, 1)),
]  # fmt: skip

# ---- the rotor's inertia, on a joint whose load is a pendulum and nothing else

STEP = 2e-5
MANY = ((0.19, 0.26, 4.4), (0.36, 0.19, 0.7), (0.98, 0.11, 2.3), (0.74, 0.13, 3.1), (0.2, 0.25, 2.6), (0.58, 0.15, 3.5),
        (0.63, 0.14, 4.4), (0.28, 0.21, 5.7))  # fmt: skip
FAST = tuple((0.6 + 0.775 * k, 0.05, phase) for k, phase in enumerate((0.2, 1.9, 3.3, 4.1, 5.6)))
HUNG = Joint(drive="position_servo", gain=2e-3, encoder_step=STEP, encoder_noise=0.3 * STEP, torque_noise=0.02)
SLOW = replace(HUNG, period=0.02, duration=40.0, encoder_step=4e-4, encoder_noise=1e-4)
NOISY = Joint(period=5e-4, duration=8.0, gain=0.1, viscous=3.0, coulomb=2.0, encoder_step=3e-5, torque_noise=0.02)


def hanging(joint: Joint, waves: Waves = MANY, held: int = 1, eccentric: float = 0.0, **keys: object) -> Record:
    """A pendulum of 5 N m and 0.5 kg m^2, its torque measured; an encoder that errs by `eccentric` cos q [rad]."""

    def run(number: int, seed: int) -> Run:
        rng, time = np.random.default_rng([seed, number]), joint.times()
        q, v, a = sines(time, waves, 0.37 * number + 0.11 * seed)
        load = 0.5 * a + 5.0 * np.sin(q)
        effort = joint.gain * (load + joint.inertia * a + joint.viscous * v + joint.coulomb * np.sign(v))
        read = joint.encoder(q, rng)
        columns = {
            "joint/position": read + eccentric * np.cos(read),
            "joint/torque": load + joint.torque_noise * rng.standard_normal(time.size),
            f"joint/{COMMAND[joint.drive]}": effort + (q if joint.drive == "position_servo" else 0.0),
        }
        return joint.run(f"run_{number}", columns)

    return recorder({"joint": "joint", "drive": joint.drive, "command_hold": False} | keys, run, held=held)


def inertia(joint: Joint, within: float = 0.02) -> dict[str, dict[str, Is]]:
    return {"rotor_inertia": {"rotor_inertia": Is(joint.inertia, within)}}


FITTED = {"declared": ["rotor_inertia"]}
CURRENT: dict[str, object] = {
    "joint": "joint",
    "drive": "current",
    "load": {"pendulum": {"mass": MASS, "length": LENGTH}},
}


def coarse(extra: Callable[[np.ndarray, np.ndarray], np.ndarray], **keys: object) -> Record:
    """The pendulum with a 12-bit encoder."""
    return recorder(CURRENT | keys, lambda number, seed: pendulum((0.0, 0.4, 0.7)[number] + 0.13 * seed, extra))


ROTORS = [
    *(Case(f"drive: a fitted rotor, noise of {share} steps", hanging(replace(HUNG, encoder_noise=share * STEP), **FITTED),
           values={"rotor_inertia.rotor_inertia": Is(HUNG.inertia, 0.02)}) for share in (0.1, 0.3, 1.0)),
    Case("drive: an undeclared rotor beside a known gain", hanging(HUNG, drive_gain=HUNG.gain), inertia(HUNG)),
    Case("drive: an undeclared rotor, one held-out run", hanging(HUNG), inertia(HUNG)),
    Case("drive: an undeclared rotor, four held-out runs", hanging(HUNG, held=4), inertia(HUNG)),
    Case("drive: an undeclared rotor at 50 Hz", hanging(SLOW), inertia(SLOW, 0.05)),
    Case("drive: an undeclared rotor at 50 Hz, four held-out runs", hanging(SLOW, held=4), inertia(SLOW, 0.05)),
    Case("drive: an eccentricity of the encoder is no rotor", hanging(replace(HUNG, inertia=0.0), eccentric=4e-3),
         {"encoder_eccentricity": {"eccentricity_cosine": Is(4e-3, 0.02)}}),
    Case("drive: intervals of a noisy rotor", hanging(NOISY, FAST, **FITTED),
         values={key: Is(value, 0.0, interval=True) for key, value in (
             ("drive.gain", 0.1), ("viscous.viscous", 3.0), ("coulomb.coulomb", 2.0), ("rotor_inertia.rotor_inertia", 0.3))}),
    Case("drive: a pendulum with a coarse encoder", coarse(lambda q, v: 0.0 * q, declared=["rotor_inertia"]), values={"drive.gain": Is(1.0 / 0.9, 5e-3)}),
    Case("drive: a rotor and a ripple of two periods, a coarse encoder", coarse(lambda q, v: 0.3 * np.cos(9.0 * q + 0.4)),
         inertia(Joint(inertia=ROTOR), 0.08) | {"torque_ripple": {"cycles_per_turn": Is(9.0, 0.01)}}),
    Case("drive: a constant torque beside a load 3 % too large",
         coarse(lambda q, v: 0.25 - 0.03 * MASS * 9.81 * LENGTH * np.sin(q), declared={"rotor_inertia": ROTOR}),
         allowed=[frozenset({each, *more}) for each in ("asymmetric_friction", "effort_bias", "encoder_offset")
                  for more in ((), ("payload",), ("rotor_inertia",))]),
]  # fmt: skip

# ---- position servos with an inside: a tick, a filtered rate, a current loop


@njit
def _inside(
    command, every, tick, kp, kd, rate_filter, current_loop, limit, inertia, moment, viscous, coulomb, static, fine
):
    """Position (T,) and mean torque over each period before its sample (T,), of a servo that computes once a tick."""
    q, v, filtered, torque, asked, mean = command[0], 0.0, 0.0, 0.0, 0.0, 0.0
    before = q
    out = np.empty((2, command.size))
    for k in range(command.size):
        out[0, k], out[1, k], mean = q, mean, 0.0
        for n in range(every):
            if n % tick == 0:
                rate = (q - before) / (tick * fine)
                before = q
                filtered += (rate - filtered) * (1.0 - np.exp(-tick * fine / rate_filter))
                asked = min(max(kp * (command[k] - q) - kd * filtered, -limit), limit)
            torque += (asked - torque) * (1.0 - np.exp(-fine / current_loop))
            mean += torque / every
            drive = torque - moment * np.sin(q) - viscous * v
            if v == 0.0 and abs(drive) <= static:
                continue
            direction = np.sign(v) if v != 0.0 else np.sign(drive)
            faster = v + fine * (drive - coulomb * direction) / inertia
            v = 0.0 if faster * direction < 0.0 else faster
            q += fine * v
    return out


def inside(
    rate_hz: float,
    kd: float = 0.0,
    load: object = "pendulum",
    rotor: object = "known",
    limit: float = 1e9,
    averaged: bool = False,
    **keys: object,
) -> Record:
    """A servo of 60 N m/rad (tick 0.2 ms, rate filter 0.6 ms, current loop 0.1 ms) on a pendulum of 4 N m; commands are
    held for a period of the log. `averaged`: logged as a current drive whose current is the mean over the period.
    """
    kp, total, gravity, own = 60.0, 0.16, 4.0, 0.06
    fine, period = 2e-5, 1.0 / rate_hz

    def run(number: int, seed: int) -> Run:
        rng, log = np.random.default_rng([seed, number]), Logged(period=period, duration=24.0)
        time = log.times()
        waves = [
            (a, f * rng.uniform(0.8, 1.25), rng.uniform(0.0, 6.3)) for a, f in ((0.6, 0.15), (0.35, 0.41), (0.12, 1.1))
        ]
        command = np.minimum(time, 1.0) * sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in waves)
        numbers = (kp, kd, 6e-4, 1e-4, limit, total, gravity, 0.5, 0.3, 0.3, fine)
        q, torque = _inside(command, round(period / fine), round(2e-4 / fine), *numbers)
        read = np.round(q / 2e-5) * 2e-5
        effort = {"joint/current": 0.5 * torque} if averaged else {"joint/position_command": command}
        return log.run(f"run_{number}", {"joint/position": read, **effort})

    length = (total - own) / (gravity / 9.81)
    hung = {"pendulum": {"mass": gravity / (9.81 * length), "length": length}}
    declared = {"known": {"rotor_inertia": own}, "fitted": ["rotor_inertia"], "none": None}[str(rotor)]
    rig: dict[str, object] = {"joint": "joint", "drive": "current" if averaged else "position_servo"}
    rig |= {"load": hung if load == "pendulum" else load, "declared": declared} | keys
    return recorder({key: value for key, value in rig.items() if value is not None}, run)


OF_INSIDE = {"coulomb.coulomb": Is(0.3, 0.1), "drive.gain": Is(1.0 / 60.0, 0.02)}
INSIDE = [
    Case("drive: a servo with an inside at 500 Hz", inside(500.0), values=OF_INSIDE, seeds=(0, 1)),
    Case("drive: a servo with an inside at 1 kHz", inside(1000.0), values=OF_INSIDE),
    Case("drive: a servo with an inside at 333 Hz", inside(1.0 / 3e-3), values=OF_INSIDE),
    Case("drive: a servo with an inside and a derivative gain", inside(500.0, kd=1.5), values=OF_INSIDE),
    Case("drive: a servo with an inside whose gains are declared",
         inside(500.0, kd=1.5, proportional_gain=60.0, derivative_gain=1.5), values={"coulomb.coulomb": Is(0.3, 0.1)}),
    Case("drive: a servo with an inside whose rotor is fitted", inside(500.0, kd=1.5, rotor="fitted"), values={"rotor_inertia.rotor_inertia": Is(0.06, 0.0, 0.01)}),
    Case("drive: a servo with an inside under an unknown load", inside(500.0, load="unknown", rotor="none", drive_gain=1.0 / 60.0),
         values={"load.moment": Is(4.0, 0.02), "load.inertia": Is(0.16, 0.05)}),
    Case("drive: a servo with an inside and a limit", inside(500.0, limit=2.6), {"saturation": {"limit": Is(2.6 / 60.0, 0.05)}}, verdicts=ANY - NULL),
    Case("drive: currents that are averaged over the period", inside(500.0, averaged=True),
         values={"coulomb.coulomb": Is(0.3, 0.1), "viscous.viscous": Is(0.5, 0.1), "drive.gain": Is(0.5, 0.02)}),
    Case("drive: currents averaged over a period of 10 ms", inside(100.0, averaged=True),
         values={"coulomb.coulomb": Is(0.3, 0.1), "viscous.viscous": Is(0.5, 0.1), "drive.gain": Is(0.5, 0.02)}),
]  # fmt: skip

CASES = [*SCALE, *WINDINGS, *INTEGRATORS, *LIMITS, *ROTORS, *INSIDE]
