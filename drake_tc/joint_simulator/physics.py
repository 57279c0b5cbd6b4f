"""The simulator of a batch of joints: every column (a run of a rig) in one time loop.

One mass:   (J + J_l) a = tau_m - g s - B v - x - tau_l,          tau = J_l a + tau_l
Two masses:  J a = tau_m - g s - B v - x - tau,   J_l a_l = tau - tau_l,   tau from the gear
    tau_m = y*/K,   tau_l = m g l sin(q_l) + hand,   s: bristle state, g: sliding level, x: further torques
Semi-implicit Euler, v[n+1] = v[n] + dt a, q[n+1] = q[n] + dt v[n+1]: first order, stable for dt w < 2.
Temperature: C dT/dt = (g s + B_g v) v + 0.002 tau_m^2 - (T - T_ambient) C/150 s.

The gear between motor and link where it is not rigid: a gap, a soft spring, or both, between two masses.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.joint_simulator import terms_joint, terms_load
from drake_tc.joint_simulator.reference import LOG_PERIOD, Motion, make_motion
from drake_tc.joint_simulator.spec import BlindError, DivergedError, RigSpec
from drake_tc.joint_simulator.terms import Stage, State, Term, build_terms
from drake_tc.joint_simulator.terms_joint import step_bristle
from drake_tc.types import FloatArray, IntArray

TERMS: Mapping[str, tuple[type[Term], ...]] = {
    "rotor_inertia": (),
    "stribeck": (terms_joint.Stribeck,),
    "quadratic_viscous": (terms_joint.QuadraticViscous,),
    "load_dependent_friction": (terms_joint.LoadDependent,),
    "asymmetric_friction": (terms_joint.AsymmetricLevel, terms_joint.AsymmetricViscous),
    "presliding_hysteresis": (terms_joint.SlowBristle,),
    "position_dependent_friction": (terms_joint.PositionDependent,),
    "thermal_friction": (terms_joint.ThermalLevel, terms_joint.ThermalViscous),
    "torque_ripple": (terms_load.TorqueRipple,),
    "cable_spring": (terms_load.CableSpring,),
    "backlash": (),
    "elasticity": (),
    "deadzone": (terms_joint.Deadzone,),
    "saturation": (terms_joint.Saturation,),
    "servo_integrator": (terms_joint.ServoIntegrator,),
    "velocity_sign_switch": (terms_joint.VelocitySignSwitch,),
    "delay": (),
    "command_delay": (terms_joint.CommandDelay,),
    "effort_delay": (terms_joint.EffortDelay,),
    "current_lag": (terms_joint.CurrentLag,),
    "payload": (),
    "torque_sensor_bias": (),
    "torque_sensor_gain": (),
    "torque_sensor_drift": (),
    "encoder_offset": (),
    "encoder_eccentricity": (),
    "touch": (terms_load.Touch,),
    "periodic_disturbance": (terms_load.PeriodicDisturbance,),
    "unrecorded_supply_sag": (terms_joint.SupplySag,),
    "position_velocity_friction": (terms_load.PositionTimesVelocity,),
    "detent": (terms_load.Detent,),
    "ageing": (terms_load.Ageing,),
    "triangular_cam": (terms_load.TriangularCam,),
    "random_disturbance": (terms_load.RandomDisturbance,),
    "long_touch": (terms_load.LongTouch,),
    "wandering_sensor": (),
    "end_stop": (terms_load.EndStop,),
    "load_times_speed": (terms_load.LoadTimesSpeed,),
    "drive_dropout": (terms_load.DriveDropout,),
    "friction_jump": (terms_load.FrictionJump,),
}
"""Terms of the simulator that make up each cause; causes of sensors and transmission have none."""


def simulated_causes(spec: RigSpec) -> dict[str, Mapping[str, float]]:
    """The rig's causes as the simulator names them: a delay acts on q_d in a servo, on the effort elsewhere."""
    delay = "command_delay" if spec.joint.drive == "position_servo" else "effort_delay"
    return {delay if cause == "delay" else cause: values for cause, values in spec.causes.items()}


RIGID_STIFFNESS = 4e5  # [N m/rad], of a gear that has a gap but is otherwise stiff
DAMPING_RATIO = 0.5


@dataclass(frozen=True)
class TwoMassGear:
    """tau = k d + c ddot outside the gap, where d = (q_m - q_l) -/+ half gap; it can push but not pull.

    Attributes:
        index: (m,) columns with two masses.
        half_gap: (m,) [rad].
        stiffness: k (m,) [N m/rad].
        damping: c (m,) [N m s/rad].
    """

    index: IntArray
    half_gap: FloatArray
    stiffness: FloatArray
    damping: FloatArray

    @classmethod
    def of(cls, specs: list[RigSpec]) -> "TwoMassGear":
        """The gears of all columns that have `backlash` or `elasticity`."""
        index = np.array([i for i, spec in enumerate(specs) if spec.link_side], dtype=np.int64)
        gap = np.zeros(index.size)
        stiffness = np.full(index.size, RIGID_STIFFNESS)
        damping = np.zeros(index.size)
        for row, i in enumerate(index):
            causes, joint = specs[i].causes, specs[i].joint
            if "backlash" in causes:
                gap[row] = causes["backlash"]["half_gap"]
            if "elasticity" in causes:
                stiffness[row] = 1.0 / causes["elasticity"]["compliance"]
            reduced = 1.0 / (1.0 / joint.rotor_inertia + 1.0 / joint.link_inertia)
            damping[row] = 2.0 * DAMPING_RATIO * np.sqrt(stiffness[row] * reduced)
        return cls(index, gap, stiffness, damping)

    def torque(self, twist: FloatArray, rate: FloatArray) -> FloatArray:
        """Transmitted torque (m,) from q_m - q_l and its rate.

        The contact only pushes: where k d + c ddot would pull the teeth together, the torque is zero. Without
        a gap the spring is bilateral.
        """
        depth = twist - np.clip(twist, -self.half_gap, self.half_gap)
        torque = self.stiffness * depth + self.damping * rate * (depth != 0.0)
        pulling = (self.half_gap > 0.0) & (torque * depth < 0.0)
        return np.asarray(np.where(pulling, 0.0, torque))


CHANNELS = (
    "position",
    "velocity",
    "acceleration",
    "motor_position",
    "command",
    "effort",
    "torque",
    "bristle",
    "temperature",
    "motor_velocity",
)


FARTHEST = 1.6  # [rad]: references stay within 0.8


@dataclass(frozen=True)
class Record:
    """The clean truth of one run at 1 kHz; every array (T,).

    Attributes:
        spec: The rig.
        run: The run.
        channels: `CHANNELS` by name. `position`, `velocity`, `acceleration` are on the side whose encoder is
            logged; `command` is q_d [rad] or the effort; `effort` the commanded effort, before any cause
            inside the drive; `torque` the torque transmitted to the link [N m].
    """

    spec: RigSpec
    run: str
    channels: dict[str, FloatArray]

    @property
    def time(self) -> FloatArray:
        """(T,) [s]."""
        return np.asarray(np.arange(self.channels["position"].size) * LOG_PERIOD, dtype=np.float64)


def simulate(specs: list[RigSpec], runs: list[str], step: float = 1e-4, record_every: int = 1) -> list[Record]:
    """Simulate `runs[i]` of `specs[i]` for all i at once.

    Args:
        specs: One rig a column; a rig may appear several times. All of one duration.
        runs: The run of each column.
        step: Integration step [s]; divides 1 ms.
        record_every: Keep each such millisecond.

    Raises:
        BlindError: Lengths or durations that differ, or a step that does not divide 1 ms.
        DivergedError: A joint left +-1.6 rad, or is not a number any more.
    """
    if len(specs) != len(runs) or len({spec.duration for spec in specs}) != 1:
        raise BlindError(
            f"simulate: expected one run per rig and one duration, got {len(specs)} rigs, {len(runs)} runs"
        )
    substeps = round(LOG_PERIOD / step)
    if abs(substeps * step - LOG_PERIOD) > 1e-12:
        raise BlindError(f"step: expected a divisor of {LOG_PERIOD} s, got {step}")
    motions = [make_motion(spec, run) for spec, run in zip(specs, runs, strict=True)]
    batch = Batch(specs, runs, motions, step)
    kept = batch.integrate(substeps, record_every)
    wild = ~(np.max(np.abs(kept[CHANNELS.index("position")]), axis=0) < FARTHEST)
    if wild.any():
        raise DivergedError(sorted({spec.name for spec, bad in zip(specs, wild, strict=True) if bad}))
    return [
        Record(spec, run, {name: kept[k, :, i].astype(np.float64) for k, name in enumerate(CHANNELS)})
        for i, (spec, run) in enumerate(zip(specs, runs, strict=True))
    ]


class Batch:
    """Arrays (n,) of a batch's parameters, its terms and its state."""

    def __init__(self, specs: list[RigSpec], runs: list[str], motions: list[Motion], dt: float) -> None:
        def column(name: str) -> FloatArray:
            return np.array([float(getattr(spec.joint, name)) for spec in specs])

        self.dt = dt
        self.gain, self.coulomb, self.breakaway = column("gain"), column("coulomb"), column("breakaway")
        self.damping, self.viscous = column("damping"), column("viscous")
        self.rotor, self.link, self.gravity = column("rotor_inertia"), column("link_inertia"), column("gravity")
        self.capacity, self.ambient = column("heat_capacity"), column("ambient")
        payloads = [spec.causes.get("payload", {}) for spec in specs]
        self.link = self.link + np.array([p.get("mass", 0.0) * p.get("arm", 0.0) ** 2 for p in payloads])
        self.gravity = self.gravity + np.array([9.81 * p.get("mass", 0.0) * p.get("arm", 0.0) for p in payloads])
        self.servo = np.array([spec.joint.drive == "position_servo" for spec in specs])
        inertia, bandwidth = column("rotor_inertia") + column("link_inertia"), column("bandwidth")
        self.stiffness = np.where(self.servo, 1.0, self.gain * inertia * bandwidth**2)
        tracking = np.maximum(1.6 * inertia * bandwidth - self.damping, 0.0)
        self.tracking = np.where(self.servo, 0.0, self.gain * tracking)
        self.gear = TwoMassGear.of(specs)
        renamed = [replace(spec, causes=simulated_causes(spec)) for spec in specs]
        self.terms: dict[Stage, list[Term]] = build_terms(TERMS, renamed, runs, dt)
        self.reference = np.stack([m.position for m in motions], axis=1)
        self.rate = np.stack([m.velocity for m in motions], axis=1)
        self.hand = np.stack([m.load for m in motions], axis=1)
        n = len(specs)
        self.state = State(
            time=0.0,
            q=np.zeros(n),
            v=np.zeros(n),
            a=np.zeros(n),
            bristle=np.zeros(n),
            transmitted=np.zeros(n),
            temperature=self.ambient.copy(),
        )
        self.link_q, self.link_v, self.link_a = np.zeros(n), np.zeros(n), np.zeros(n)

    def _through(self, stage: Stage, x: FloatArray) -> FloatArray:
        """A quantity after all causes of its stage; `x` is overwritten."""
        for term in self.terms[stage]:
            x[term.index] = term.apply(self.state, x[term.index])
        return x

    def integrate(self, substeps: int, every: int) -> FloatArray:
        """Run to the end; returns (channels, T, n)."""
        samples = self.reference.shape[0] - 1
        kept = np.empty((len(CHANNELS), -(-samples // every), self.gain.size))
        with np.errstate(all="ignore"):
            for k in range(samples):
                at = self.reference[k], self.rate[k], self.hand[k]
                slope = tuple((x[k + 1] - x[k]) / substeps for x in (self.reference, self.rate, self.hand))
                for j in range(substeps):
                    command, rate, hand = (x + j * dx for x, dx in zip(at, slope, strict=True))
                    effort = self._forces(command, rate, hand)
                    if j == 0 and k % every == 0:
                        kept[:, k // every] = self._row(command, effort)
                    self._advance()
        return kept

    def _forces(self, command: FloatArray, rate: FloatArray, hand: FloatArray) -> FloatArray:
        """Accelerations at this instant; returns the asked effort y (n,)."""
        state = self.state
        received = self._through("command", command.copy())
        asked = self.stiffness * (command - state.q) + self.tracking * (rate - state.v)
        acted = self._through("effort", asked + self.stiffness * (received - command))
        motor = self._through("motor", acted / self.gain)
        state.bristle = step_bristle(state.bristle, state.v, self.breakaway, self.dt)
        level = self._through("level", self.coulomb.copy())
        extra = self._through("torque", np.zeros(self.gain.size))
        friction = level * state.bristle
        drive = motor - friction - self.damping * state.v - extra
        load = self.gravity * np.sin(self.link_q) + hand
        state.a = (drive - load) / (self.rotor + self.link)
        transmitted = self.link * state.a + load
        self.link_a = state.a
        two = self.gear.index
        if two.size:
            torque = self.gear.torque(state.q[two] - self.link_q[two], state.v[two] - self.link_v[two])
            self.link_a = state.a.copy()
            state.a[two] = (drive[two] - torque) / self.rotor[two]
            self.link_a[two] = (torque - load[two]) / self.link[two]
            transmitted[two] = torque
        state.transmitted = transmitted
        self._motor, self._heat = motor, (friction + self.viscous * state.v) * state.v
        return asked

    def _advance(self) -> None:
        state, dt = self.state, self.dt
        heating = (np.abs(self._heat) + 0.002 * self._motor**2) / self.capacity
        state.temperature = state.temperature + dt * (heating - (state.temperature - self.ambient) / 150.0)
        state.v = state.v + dt * state.a
        state.q = state.q + dt * state.v
        if self.gear.index.size:
            two = self.gear.index
            self.link_v[two] += dt * self.link_a[two]
            self.link_q[two] += dt * self.link_v[two]
            one = np.ones(self.gain.size, dtype=bool)
            one[two] = False
            self.link_q[one] = state.q[one]
        else:
            self.link_q = state.q
        state.time += dt

    def _row(self, command: FloatArray, effort: FloatArray) -> FloatArray:
        """One sample of `CHANNELS`, (channels, n)."""
        state, two = self.state, self.gear.index
        side = [state.q.copy(), state.v.copy(), self.link_a]
        if two.size:
            side[0][two], side[1][two] = self.link_q[two], self.link_v[two]
        logged = np.where(self.servo, command, effort)
        rest = [state.q, logged, effort, state.transmitted, state.bristle, state.temperature, state.v]
        return np.stack([*side, *rest])
