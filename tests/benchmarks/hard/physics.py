"""One geared joint and its drive, simulated with a small fixed step.

The rotor (inertia J, joint side) has all friction; the link hangs on it rigidly, or through play and a spring:

    J a_m = tau_drive - friction - spring - ripple - tau_gear,      J_l a_l = tau_gear - m g l sin(q_l) - external

Dry friction is a bristle (Dahl, exponent 1): dz = (v / s_0) (1 - z sign v) dt with |z| <= 1, and a damping of the
bristle that vanishes while the joint slides. Every torque is on the joint's side of the gear.
"""

from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
STEP = 1e-4
"""Internal step [s]."""
KEPT = 2
"""One of so many steps is kept."""
SERVO, CURRENT, VOLTAGE = 0, 1, 2
DRIVES = {"position_servo": SERVO, "current": CURRENT, "voltage": VOLTAGE}
GRAVITY = 9.81


class Joint(NamedTuple):
    """Everything that the simulation needs of one joint; the second block holds the causes, zero if absent."""

    drive: int = SERVO
    gain: float = 1e-3  # effort for 1 N m
    rotor: float = 0.1  # kg m^2
    link: float = 0.1  # kg m^2
    moment: float = 1.0  # m g l [N m]
    viscous: float = 0.1
    coulomb: float = 0.1
    bristle: float = 1e-4  # travel [rad]
    bristle_damping: float = 1e-4  # [s]
    small_stribeck: float = 0.0
    small_stribeck_velocity: float = 0.1
    derivative: float = 0.0  # servo's damping [N m s/rad]
    rate_filter: float = 5e-4  # s
    current_loop: float = 1e-4  # s
    tick: float = 5e-4  # s
    back_emf: float = 0.0  # V s/rad
    outer_stiffness: float = 0.0  # of the controller around a current or voltage drive [N m/rad]
    outer_damping: float = 0.0
    # causes
    stribeck: float = 0.0
    stribeck_velocity: float = 0.1
    stribeck_exponent: float = 1.0
    quadratic_viscous: float = 0.0
    load_friction: float = 0.0
    coulomb_asymmetry: float = 0.0
    viscous_asymmetry: float = 0.0
    presliding: float = 0.0
    presliding_travel: float = 0.05
    friction_cosine: float = 0.0
    friction_sine: float = 0.0
    friction_cycles: float = 1.0
    coulomb_per_kelvin: float = 0.0
    viscous_per_kelvin: float = 0.0
    thermal_rate: float = 1e-6
    ripple_cosine: float = 0.0
    ripple_sine: float = 0.0
    ripple_cycles: float = 1.0
    spring_stiffness: float = 0.0
    spring_preload: float = 0.0
    payload_moment: float = 0.0
    payload_inertia: float = 0.0
    backlash: float = 0.0
    compliance: float = 0.0
    deadzone: float = 0.0
    limit: float = 1e9
    integral_rate: float = 0.0
    switch: float = 0.0
    delay: float = 0.0
    lag: float = 0.0


class Traces(NamedTuple):
    """What happened, one value every `KEPT` steps; efforts in the drive's unit, torques in N m."""

    time: Array
    q: Array
    v: Array
    a: Array
    rotor_v: Array
    rotor_a: Array
    torque: Array  # tau_gear, what the link needs
    slide: Array  # bristle: sign of the velocity, smooth at reversals
    soft: Array  # the soft bristle of presliding hysteresis
    command: Array  # position command as sent
    effort: Array  # command minus position of the rotor, current or voltage, as sent
    acting: Array  # gain times the drive's torque
    after_gap: Array  # rotor minus link [rad]
    delay_part: Array  # effort that each cause takes, in the order of the drive's stages
    integral: Array
    deadzone_part: Array
    saturation_part: Array
    switched: Array
    lag_part: Array
    celsius: Array
    pressed: Array  # load torque that load-dependent friction follows: that of the step before

    def at(self, name: str, time: Array) -> Array:
        """A trace at other times, linear in between."""
        return np.interp(time, self.time, getattr(self, name))


def simulate(joint: Joint, reference: Array, rate: Array, external: Array, celsius: Array, start: float) -> Traces:
    """Traces of a run. Reference [rad], its rate [rad/s], external torque [N m] and temperature [°C] at every step."""
    out = np.zeros((len(Traces._fields), (reference.size + KEPT - 1) // KEPT))
    _run(joint, reference, rate, external, celsius, start, out)
    return Traces(*out)


@numba.njit(cache=True)
def _friction(j: Joint, v: float, q: float, s: float, soft: float, load: float, celsius: float) -> float:
    """All friction [N m] at rotor speed v; s is the stiff bristle."""
    speed = abs(v)
    level = j.coulomb + j.small_stribeck * np.exp(-speed / j.small_stribeck_velocity)
    if j.stribeck > 0.0:
        level += j.stribeck * np.exp(-((speed / j.stribeck_velocity) ** j.stribeck_exponent))
    if j.load_friction != 0.0:
        level += j.load_friction * abs(load)
    if j.friction_cosine != 0.0 or j.friction_sine != 0.0:
        angle = j.friction_cycles * q
        level += j.friction_cosine * np.cos(angle) + j.friction_sine * np.sin(angle)
    damping = j.viscous + j.quadratic_viscous * speed
    if j.coulomb_per_kelvin != 0.0 or j.viscous_per_kelvin != 0.0:
        warm = (1.0 - np.exp(-j.thermal_rate * (celsius - 25.0))) / j.thermal_rate
        level += j.coulomb_per_kelvin * warm
        damping += j.viscous_per_kelvin * warm
    total = level * s + damping * v + j.coulomb_asymmetry * abs(s) + j.viscous_asymmetry * speed
    return total + j.presliding * (soft - s)


@numba.njit(cache=True)
def _gear(j: Joint, twist: float, rate: float, stiffness: float, damping: float) -> float:
    """Torque through play and spring [N m]; teeth push and do not pull."""
    half = 0.5 * j.backlash
    if twist > half:
        return max(stiffness * (twist - half) + damping * rate, 0.0)
    if twist < -half:
        return min(stiffness * (twist + half) + damping * rate, 0.0)
    return 0.0


@numba.njit(cache=True)
def _run(j: Joint, reference: Array, rate: Array, external: Array, celsius: Array, start: float, out: Array) -> None:
    n, h = reference.size, STEP
    ticks = max(1, round(j.tick / h))
    late = round(j.delay / h)
    two = j.backlash > 0.0 or j.compliance > 0.0
    stiffness = 1.0 / j.compliance if j.compliance > 0.0 else j.link * 700.0**2
    damping = 2.0 * 0.08 * np.sqrt(stiffness * j.link)
    gravity0 = (j.moment + j.payload_moment) * np.sin(start)
    qm = start
    ql = start - (gravity0 / stiffness + 0.5 * j.backlash * np.sign(gravity0) if two else 0.0)
    vm = vl = am = al = 0.0
    s = z = soft = 0.0
    seen = qm
    slope = integral = acting = lagged = target = 0.0
    sent = np.zeros(n)
    load = gravity0
    deadzone_part = saturation_part = switched = delay_part = lag_part = 0.0
    filter_share = 1.0 - np.exp(-ticks * h / j.rate_filter)
    loop_share = 1.0 - np.exp(-h / j.current_loop)
    lag_share = 1.0 - np.exp(-h / j.lag) if j.lag > 0.0 else 1.0
    hold = 0.0
    if j.drive != SERVO:
        hold = acting = lagged = j.gain * gravity0
        sent[:] = hold
    for i in range(n):
        if i % ticks == 0 and j.drive == SERVO:
            slope += filter_share * ((qm - seen) / (ticks * h) - slope) if i > 0 else 0.0
            seen = qm
        elif i % ticks == 0:
            wish = j.outer_stiffness * (reference[i] - qm) + j.outer_damping * (rate[i] - vm)
            hold = j.gain * (wish + j.moment * np.sin(qm)) + j.back_emf * vm
        sent[i] = reference[i] - qm if j.drive == SERVO else hold
        # the effort on its way to the drive
        if j.drive == SERVO:
            old = reference[max(i - late, 0)]
            delay_part = reference[i] - old
            y = old - seen
        else:
            y = sent[max(i - late, 0)]
            delay_part = sent[i] - y
        integral += y * h
        y += j.integral_rate * integral
        arrived = y
        if j.deadzone > 0.0:
            arrived = np.sign(y) * max(abs(y) - j.deadzone, 0.0)
        deadzone_part = y - arrived
        kept = min(max(arrived, -j.limit), j.limit)
        saturation_part = arrived - kept
        switched = np.tanh(vm / 2e-3) * kept
        kept += j.switch * switched
        lag_part = 0.0
        if j.drive == SERVO:
            target = kept - j.gain * j.derivative * slope
        elif j.drive == CURRENT:
            lagged += lag_share * (kept - lagged)
            lag_part = kept - lagged
            target = lagged
        else:
            target = kept - j.back_emf * vm
        if j.drive == VOLTAGE and j.lag > 0.0:
            acting += lag_share * (target - acting)
            lag_part = target - acting
        else:
            acting += loop_share * (target - acting)
        # the joint
        torque = acting / j.gain
        pressed = load
        resist = _friction(j, vm, qm, s, soft, load, celsius[i])
        resist += j.spring_stiffness * qm + j.spring_preload + j.payload_moment * np.sin(qm)
        resist += j.ripple_cosine * np.cos(j.ripple_cycles * qm) + j.ripple_sine * np.sin(j.ripple_cycles * qm)
        rotor = j.rotor + j.payload_inertia
        if two:
            load = _gear(j, qm - ql, vm - vl, stiffness, damping)
            al = (load - j.moment * np.sin(ql) - external[i]) / j.link
            am = (torque - resist - load) / rotor
        else:
            fall = j.moment * np.sin(qm) + external[i]
            am = al = (torque - resist - fall) / (rotor + j.link)
            load = j.link * al + fall
        if i % KEPT == 0:
            k = i // KEPT
            out[0, k], out[1, k], out[2, k], out[3, k] = i * h, ql, vl, al
            out[4, k], out[5, k], out[6, k], out[7, k], out[8, k] = vm, am, load, s, soft
            out[9, k], out[10, k], out[11, k], out[12, k] = reference[i], sent[i], acting, qm - ql
            out[13, k], out[14, k], out[15, k], out[16, k] = delay_part, integral, deadzone_part, saturation_part
            out[17, k], out[18, k], out[19, k], out[20, k] = switched, lag_part, celsius[i], pressed
        vm += h * am
        qm += h * vm
        if two:
            vl += h * al
            ql += h * vl
        else:
            ql, vl = qm, vm
        way = np.sign(vm)
        moved = abs(vm) * h
        before = z
        z = way + (z - way) * np.exp(-moved / j.bristle)
        s = z + j.bristle_damping * (z - before) / h
        soft = way + (soft - way) * np.exp(-moved / j.presliding_travel)
