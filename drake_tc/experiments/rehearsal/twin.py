"""A simulated twin of a recorded joint: its declared model, its motions, its sensors and its noise.

The twin is simulated by `joint_simulator`, which shares no formula with the diagnosis: bristle friction, two masses
where the gear has play or gives, a drive in continuous time. What a log does not tell (break-away length, heat
capacity) has typical values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from drake_tc.config.joint_units import JointType
from drake_tc.diagnosis.problem.prepared import Prepared, prepare_joint
from drake_tc.errors import ParamsError, SimulationError
from drake_tc.experiments.check.effects import JointEffects, joint_effects
from drake_tc.experiments.check.run import with_loads
from drake_tc.experiments.fitted import rig_alone
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.joint_simulator.measurement import CLEAN_COLUMNS, clean_log, coloured_noise, measured
from drake_tc.joint_simulator.physics import CHANNELS, Batch, Record
from drake_tc.joint_simulator.reference import LOG_PERIOD, Motion
from drake_tc.joint_simulator.spec import Joint, RigSpec, Sensors
from drake_tc.logs.loads import Pendulum, unknown_form
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

STEP = 2e-4
"""Integration step [s]."""
FARTHEST = 3.0
"""Travel of a simulation over that of the log, above which it has run away."""


@dataclass(frozen=True, eq=False)
class TwinRun:
    """One run as the twin repeats it: reference [rad] and load by hand [N m] at `LOG_PERIOD`, logged at `time` [s]."""

    name: str
    motion: Motion
    time: FloatArray


def integrated(specs: Sequence[RigSpec], runs: Sequence[TwinRun]) -> list[Record]:
    """Run i of joint i, all in one time loop; a motion that is shorter than the longest one rests at its end.

    Raises:
        SimulationError: A joint ran away.
    """
    size = max(run.motion.position.size for run in runs)
    motions = [_held(run.motion, size) for run in runs]
    lasting = [replace(spec, duration=float((size - 1) * LOG_PERIOD)) for spec in specs]
    batch = Batch(lasting, ["sine"] * len(lasting), motions, STEP)
    reference = np.stack([motion.position for motion in motions], axis=1)
    batch.state.q[:] = reference[0]
    batch.link_q = batch.state.q.copy()
    kept = batch.integrate(round(LOG_PERIOD / STEP), 1)
    travel = np.max(np.abs(kept[CHANNELS.index("position")] - reference[:-1]), axis=0)
    span = np.maximum(np.ptp(reference, axis=0), 0.1)
    for spec, run, bad in zip(specs, runs, ~(travel < FARTHEST * span), strict=True):
        if bad:
            names = ", ".join(sorted(spec.causes)) or "no effect"
            raise SimulationError(f"run {run.name}: the simulated joint with {names} runs away; choose a smaller size")
    out = []
    for i, (spec, run) in enumerate(zip(lasting, runs, strict=True)):
        count = run.motion.position.size - 1
        own = replace(spec, duration=float(count * LOG_PERIOD))
        out.append(Record(own, run.name, {name: kept[k, :count, i] for k, name in enumerate(CHANNELS)}))
    return out


def _held(motion: Motion, size: int) -> Motion:
    """The motion with its last position and load held until it has `size` samples."""
    more = size - motion.position.size
    position, load = (np.pad(x, (0, more), mode="edge") for x in (motion.position, motion.load))
    return Motion(position, np.pad(motion.velocity, (0, more)), load)


def on_clock(time: FloatArray, reference: FloatArray, hand: FloatArray) -> Motion:
    """A reference (T,) [rad] and a load (T,) [N m] at times (T,) [s], on the simulator's clock."""
    count = int(np.ceil(time[-1] / LOG_PERIOD)) + 2
    grid: FloatArray = np.asarray(np.arange(count) * LOG_PERIOD, dtype=np.float64)
    q = np.interp(grid, time, reference)
    return Motion(q, np.gradient(q, LOG_PERIOD), np.interp(grid, time, hand))


SMOOTHING = 0.03
"""Width of the kernel that frees references and loads of their noise [s]."""
BREAK_AWAY: Mapping[JointType, float] = {"revolute": 1.5e-4, "prismatic": 1.5e-5}
"""Break-away length of the simulated joint [rad or m]."""
HEAT_CAPACITY, BANDWIDTH = 40.0, 27.0
"""Of the simulated joint: heat capacity [J/K], outer loop of a current drive [rad/s]."""
LEAST_INERTIA = 0.02
"""Rotor over whole inertia where the rig file declares none."""


@dataclass(frozen=True, eq=False)
class SimulatedJoint:
    """A joint that the independent simulator runs and measures.

    Attributes:
        joint: Name.
        spec: The joint without any cause.
        zero: Position at which the load hangs [rad]; the simulation counts from it.
        position_noise: White noise of the encoder beyond its steps [rad].
        extra_noise: Noise of the torque beyond its white noise [N m].
        extra_time: Its correlation time [s].
        recorded: Optional columns that the logs have.
    """

    joint: str
    spec: RigSpec
    zero: float = 0.0
    position_noise: float = 0.0
    extra_noise: float = 0.0
    extra_time: float = 0.0
    recorded: frozenset[str] = frozenset()

    def simulated(self, causes: Mapping[str, Mapping[str, float]], seed: int, runs: Sequence[TwinRun]) -> list[Run]:
        """The runs of the joint with causes, as the simulator names them, and with a seed of its noise.

        Raises:
            SimulationError: The joint ran away.
        """
        records = integrated([self.with_causes(causes, seed)] * len(runs), runs)
        return [
            self.measured(record, run, np.random.default_rng([seed, number, 5]))
            for number, (record, run) in enumerate(zip(records, runs, strict=True))
        ]

    def with_causes(self, causes: Mapping[str, Mapping[str, float]], seed: int) -> RigSpec:
        """The joint with causes, and with its sensors' seed."""
        motor = "motor_position" in self.recorded
        joint = self.spec.joint
        if "rotor_inertia" in causes:
            joint = replace(joint, rotor_inertia=joint.rotor_inertia + causes["rotor_inertia"]["inertia"])
        return replace(self.spec, joint=joint, causes=dict(causes), seed=seed, motor_position=motor)

    def measured(self, record: Record, run: TwinRun, rng: np.random.Generator) -> Run:
        """What the user's logger would have written of a simulated run."""
        log = clean_log(record)
        clean = pd.DataFrame({name: np.interp(run.time, log.time, getattr(log, name)) for name in CLEAN_COLUMNS})
        clean.insert(0, "time", run.time)
        clean["position"] += self.zero + rng.normal(0.0, self.position_noise, len(clean))
        clean["motor_position"] += self.zero
        if record.spec.joint.drive == "position_servo":
            clean["command"] += self.zero
        table = measured(clean, record.spec, rng)
        named = {str(name): table[name].to_numpy(float) for name in table}
        columns = {f"{self.joint}/{name.partition('/')[2]}": values for name, values in named.items() if "/" in name}
        extra = coloured_noise(run.time, self.extra_noise, self.extra_time, rng)
        torque = f"{self.joint}/torque"
        if torque in columns:
            columns[torque] = columns[torque] + extra
        if "temperature" not in self.recorded:
            columns.pop(f"{self.joint}/temperature", None)
        steps = {f"{self.joint}/position": record.spec.sensors.encoder_step}
        period = float(np.median(np.diff(run.time)))
        return Run(run.name, None, run.time, period, columns, np.zeros(run.time.size, dtype=np.int64), steps=steps)


@dataclass(frozen=True, eq=False)
class Twin:
    """The simulated twin of a recorded joint.

    Attributes:
        simulator: The joint.
        rig: Of this joint alone, with a measured or a pendulum's load.
        runs: Its runs, in the order of the logs.
        effects: What the logs show of each effect. prepared: Their rows.
    """

    simulator: SimulatedJoint
    rig: Rig
    runs: tuple[TwinRun, ...]
    effects: JointEffects
    prepared: Prepared = field(repr=False)


def twin_of(rig: Rig, runs: Sequence[Run], joint: str) -> Twin:
    """The twin of a joint from its logs.

    Args:
        rig: Of the logs.
        runs: Read, in the order in which they are to be repeated.
        joint: Which.

    Raises:
        IdentificationError: Runs that cannot identify the declared model.
        ParamsError: The rig file does not give the load.
    """
    if unknown_form(rig.load[joint]) is not None:
        raise ParamsError(
            f"joint {joint}: expected a known load to simulate, got load: unknown; give the rig file "
            f"load: {{pendulum: {{mass: ..., length: ...}}}}, or record {joint}/torque"
        )
    loaded, rig_used = with_loads(rig, runs)
    prepared = prepare_joint(loaded, [], rig_used, joint)
    found = joint_effects(prepared)
    load = rig_used.load[joint]
    zero = load.zero if isinstance(load, Pendulum) else 0.0
    inertia, gravity = _link(prepared, load)
    by_name = {run.name: run for run in loaded}
    repeated = tuple(_twin_run(by_name[run.name], rig_used, joint, (inertia, gravity, zero)) for run in runs)
    resolution = prepared.train.samples.resolution
    white = max(resolution.position_noise**2 - resolution.position_step**2 / 12.0, 0.0)
    extra = max(found.fitted.balance.left**2 - found.fitted.balance.floor**2, 0.0)
    simulator = SimulatedJoint(
        joint=joint,
        spec=_spec_of(prepared, found, load, (inertia, gravity)),
        zero=zero,
        position_noise=float(np.sqrt(white)),
        extra_noise=float(np.sqrt(extra)),
        extra_time=0.5 * found.fitted.seconds / found.fitted.balance.independent,
        recorded=prepared.context.recorded,
    )
    return Twin(simulator, rig_alone(rig_used, joint), repeated, found, prepared)


def _link(prepared: Prepared, load: object) -> tuple[float, float]:
    """(inertia [kg m^2], m g l [N m]) of the link: declared, or what the measured torque follows; (mass [kg], 0)."""
    if isinstance(load, Pendulum):
        return load.inertia, load.weight
    s, rows = prepared.train.samples.signals, prepared.train.samples.rows
    slides = prepared.context.units.slides  # its weight does not follow the position, and is replayed
    follows = np.ones(rows.size) if slides else np.sin(s.position[rows])
    beta = np.linalg.lstsq(np.column_stack([s.acceleration[rows], follows]), s.load_torque[rows], rcond=None)[0]
    whole = float(s.rotor_inertia) + max(float(beta[0]), 0.0)
    return max(float(beta[0]), 0.05 * whole, 1e-6), 0.0 if slides else max(float(beta[1]), 0.0)


def _spec_of(prepared: Prepared, found: JointEffects, load: object, link: tuple[float, float]) -> RigSpec:
    numbers, samples = found.fitted.numbers, prepared.train.samples
    rotor = max(numbers.rotor, LEAST_INERTIA * link[0])
    warm = prepared.context.temperature_span[0]
    joint = Joint(
        drive=prepared.context.drive,  # type: ignore[arg-type]
        gain=numbers.gain,
        servo_damping=0.0,
        viscous=numbers.viscous,
        coulomb=numbers.coulomb,
        breakaway=BREAK_AWAY[prepared.context.joint_type],
        rotor_inertia=rotor,
        link_inertia=link[0],
        gravity=link[1],
        heat_capacity=HEAT_CAPACITY,
        ambient=float(warm) if np.isfinite(warm) else 25.0,
        bandwidth=BANDWIDTH,
    )
    resolution = samples.resolution
    sensors = Sensors(
        encoder_step=max(resolution.position_step, 1e-9),
        torque_noise=resolution.torque_noise,
        torque_noise_time=resolution.torque_correlation_time,
    )
    pendulum = (load.mass, load.length) if isinstance(load, Pendulum) else None
    return RigSpec("twin", "null", "twin", "", joint, 0, sensors=sensors, pendulum=pendulum)


def _twin_run(run: Run, rig: Rig, joint: str, link: tuple[float, float, float]) -> TwinRun:
    """Reference and load of a recorded run on the simulator's clock, freed of noise."""
    inertia, gravity, zero = link
    kernel = CommonKernel(max(SMOOTHING, 4.0 * run.period), run.period)
    position = run.columns[f"{joint}/position"]
    servo = rig.drive[joint] == "position_servo"
    reference = run.columns[rig.command_column(joint)] if servo else kernel.smooth(position)
    hand = np.zeros_like(position)
    if not isinstance(rig.load[joint], Pendulum):
        own = inertia * kernel.second_derivative(position) + gravity * np.sin(kernel.smooth(position))
        hand = kernel.smooth(run.columns[f"{joint}/torque"]) - own
    time = run.time - run.time[0]
    return TwinRun(run.name, on_clock(time, reference - zero, hand), time)
