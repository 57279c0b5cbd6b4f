"""`ModelMonitor` in simulated torque loops of a leg and of an arm: what the controller knows, with noisy sensors.

The plant, its drives and its sensors are simulated; the monitor sees the readings through the filters and the torque
estimator of the loop. A changed joint is another one from the beginning, and its monitor is the one of the sound robot,
calibrated on a minute of another motion. A delay is time in motion: the other joints of the robot are sound.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.loops.fused import fuse
from drake_tc.loops.plant import add_pushes, add_robot_plant, set_masses
from drake_tc.loops.recording import Progress
from drake_tc.loops.scenarios import FilterSpec, PushSpec
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.sensing.spec import SensorFault
from drake_tc.watch.health import ModelHealth, health_of
from drake_tc.watch.in_loop import add_model_monitor
from drake_tc.watch.monitor import CAUSES
from tests.benchmarks.figures import BenchmarkRow
from tests.robot_files import joint_tag, link_tag, urdf, write_robot

LEG = Path(__file__).parents[2] / "models" / "hrp2_like" / "hrp2_like_leg.yaml"
DT, KNOT_S, LOG_S = 1e-3, 0.05, 5e-3
REST_S, CALIBRATION_S, CHANGED_S = 1.0, 60.0, 21.0
CHUNK_S = 1.0
"""After which a run is looked at."""
FRICTION_OFF, GAIN_OFF, MASS_OFF = 0.02, 0.005, 0.01
"""Standard deviations of the relative errors of what the controller knows."""
HITS = (6.0, 12.0, 18.0)
"""When a link is hit [s]."""
MOVING = 0.05
"""Speed from which a joint moves [rad/s]."""
JOINTS = 3
"""In which each change is made."""
SOON = 2.0
"""Time in motion within which more friction is to be noticed [s]."""


@dataclass(frozen=True)
class Change:
    """What is different in one joint.

    Attributes:
        right: Causes that are right to name; () for none.
        friction, gain: Factors of its friction and of its drive gain. gap: backlash [rad]. late: of all encoders [s].
        load: Whether the last link carries a payload. push: force on a link [N].
    """

    right: tuple[str, ...]
    friction: float = 1.0
    gain: float = 1.0
    gap: float = 0.0
    late: float = 0.0
    load: bool = False
    push: float = 0.0


CHANGES: Mapping[str, Change] = {
    "friction +10 %": Change(("friction",), friction=1.1),
    "friction +20 %": Change(("friction",), friction=1.2),
    "friction +50 %": Change(("friction",), friction=1.5),
    "torque constant -10 %": Change(("torque_constant",), gain=1.0 / 0.9),
    "backlash of 0.5 mrad": Change(("backlash",), gap=5e-4),
    "backlash of 1 mrad": Change(("backlash",), gap=1e-3),
    "encoders 5 ms late": Change(("delay",), late=5e-3),
    "payload of 5 % of the rating": Change(("payload_sin", "payload_cos"), load=True),
    "collision": Change((), push=120.0),
}


@dataclass(frozen=True, eq=False)
class Machine:
    """A robot and what its controller takes it for.

    Attributes:
        robot: With the masses of its file. models: of its drives, as the controller has them.
        drives, masses: What they are: friction, drive gains and masses differ by a few percent from robot to robot.
        tool, payload: The last link, and what it carries later [kg]. hit: the link that collides.
        senses_load: Whether a sensor tells the load of the tool, so that a payload is no change of the model.
        window: Of the filters. gains: Of the loop; None: its defaults.
    """

    name: str
    robot: Robot
    models: Mapping[str, ActuatorModel]
    drives: Mapping[str, ActuatorModel]
    masses: Mapping[str, float]
    tool: str
    payload: float
    hit: str
    senses_load: bool
    window: int
    gains: TorqueGains | None = None


def leg(rng: np.random.Generator) -> Machine:
    """Position servos, an IMU and a force/torque sensor above the foot."""
    robot = load_robot(LEG)
    models = load_models(str(robot.actuators))
    links = ("r_hip_yaw_link", "r_hip_roll_link", "r_thigh", "r_shank", "r_ankle", "r_ankle_roll_link", "r_foot")
    return Machine(
        "leg", robot, models, differing(models, rng), _masses(links, rng), "r_foot", 1.4, "r_shank", True, 80
    )


def arm(rng: np.random.Generator, folder: Path) -> Machine:
    """Four joints with current drives, encoders and no other sensors."""
    text = urdf(
        link_tag("upper", (0.0, 0.0, -0.2), 3.0, (0.05, 0.05, 0.01)),
        link_tag("fore", (0.0, 0.0, -0.15), 2.0, (0.025, 0.025, 0.005)),
        link_tag("wrist", (0.0, 0.0, -0.08), 1.0, (0.005, 0.005, 0.002)),
        link_tag("tool", (0.0, 0.0, -0.1), 1.0, (0.004, 0.004, 0.001)),
        joint_tag("shoulder", "base", "upper", axis=(0, 1, 0)),
        joint_tag("elbow", "upper", "fore", axis=(0, 1, 0), xyz=(0, 0, -0.4)),
        joint_tag("roll", "fore", "wrist", axis=(1, 0, 0), xyz=(0, 0, -0.3)),
        joint_tag("flange", "wrist", "tool", axis=(0, 1, 0), xyz=(0, 0, -0.15)),
    )
    joints, rated = ["shoulder", "elbow", "roll", "flange"], np.array([50.0, 30.0, 15.0, 10.0])
    posture = {"shoulder": 0.6, "elbow": 0.8, "roll": 0.3, "flange": 0.5}
    robot = load_robot(write_robot(folder, text, joints, posture=posture))
    models = {
        joint: ActuatorModel(
            joint,
            Drive("current", 4.0 / torque),
            (
                EffectValue("viscous", {"viscous": 0.06 * torque}),
                EffectValue("coulomb", {"coulomb": 0.05 * torque}),
                EffectValue("rotor_inertia", {"rotor_inertia": 0.006 * torque}),
            ),
        )
        for joint, torque in zip(joints, rated.tolist(), strict=True)
    }
    masses = _masses(("upper", "fore", "wrist", "tool"), rng)
    gains = TorqueGains(kp=np.full(4, 0.5), ki=np.zeros(4), ks=3.0 * rated, kd=0.3 * rated)
    return Machine("arm", robot, models, differing(models, rng), masses, "tool", 0.3, "fore", False, 40, gains)


def differing(models: Mapping[str, ActuatorModel], rng: np.random.Generator) -> dict[str, ActuatorModel]:
    """The drives of one robot of a series."""
    factors = {name: 1.0 + rng.normal(0.0, (FRICTION_OFF, GAIN_OFF)) for name in models}
    return {name: scaled(model, *factors[name]) for name, model in models.items()}


def scaled(model: ActuatorModel, friction: float, gain: float) -> ActuatorModel:
    """A drive with factors on its viscous and Coulomb friction and on its gain."""
    effects = tuple(
        replace(value, parameters={name: friction * number for name, number in value.parameters.items()})
        if value.key in ("viscous", "coulomb")
        else value
        for value in model.effects
    )
    return replace(model, drive=Drive(model.drive.kind, gain * model.drive.gain), effects=effects)


def _masses(links: Sequence[str], rng: np.random.Generator) -> dict[str, float]:
    return {link: 1.0 + MASS_OFF * float(rng.standard_normal()) for link in links}


def motion(machine: Machine, seconds: float, rng: np.random.Generator) -> Any:
    """Three sines a joint about the posture, within the joints' ranges; at rest for `REST_S`."""
    robot, limits = machine.robot, joint_limits(machine.robot)
    n, time = len(robot.joints), np.arange(0.0, seconds + 2.0 * KNOT_S, KNOT_S)
    room = np.clip(0.8 * np.minimum(robot.posture - limits.lower, limits.upper - robot.posture), 0.05, 0.35)
    frequency, phase = rng.uniform(0.1, 0.8, (3, n)), rng.uniform(0.0, 2.0 * np.pi, (3, n))
    begin = np.clip((time - REST_S) / REST_S, 0.0, 1.0)[:, None]
    waves = np.sin(2.0 * np.pi * frequency * time[:, None, None] + phase).sum(axis=1) / 3.0
    rest: Any = np.zeros(n)
    values: Any = (robot.posture + begin**2 * room * waves).T
    times: Any = time
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, values, rest, rest)


def changed(model: ActuatorModel, change: Change) -> ActuatorModel:
    """The drive of a joint that is not what it was."""
    found = scaled(model, change.friction, change.gain)
    if not change.gap:
        return found
    return replace(found, effects=(*found.effects, EffectValue("backlash", {"backlash": change.gap})))


@dataclass(frozen=True, eq=False)
class Watched:
    """What a monitor told of a run: time (T,), and by joint (T, n) its outputs and the speed `state`."""

    time: np.ndarray
    signals: Mapping[str, np.ndarray]

    def moved(self, joint: int) -> np.ndarray:
        """(T,) time in motion until then [s]."""
        return np.asarray(LOG_S * np.cumsum(np.abs(self.signals["state"][:, joint]) > MOVING))

    def until(self, joint: int, causes: Sequence[str]) -> float:
        """Time in motion until one of these causes is named [s]; infinite if none is."""
        codes = [CAUSES.index(cause) + 1 for cause in causes]
        named = np.isin(self.signals["cause"][:, joint], codes)
        return float(self.moved(joint)[int(np.argmax(named))]) if named.any() else np.inf

    def alarms(self) -> int:
        """How often a cause was named where there was none before, in all joints."""
        named = self.signals["cause"] > 0.0
        return int(np.sum(named[1:] & ~named[:-1]) + np.sum(named[0]))


def run(
    machine: Machine,
    seconds: float,
    seed: int,
    health: ModelHealth | None,
    change: tuple[int, Change] | None = None,
) -> Watched:
    """Simulate the loop and its monitor, of a changed joint until the right cause is named."""
    rng, builder, robot = np.random.default_rng([seed, 1]), DiagramBuilder(), machine.robot
    plant: Any = add_robot_plant(builder, robot, DT)
    for joint, position in zip(robot.joints, robot.posture, strict=True):
        plant.GetJointByName(joint).set_default_angle(position)
    drives, faults = dict(machine.drives), {}
    where, what = change or (0, Change(()))
    drives[robot.joints[where]] = changed(drives[robot.joints[where]], what)
    if what.late:
        faults = {"encoder": (SensorFault("late", value=what.late),)}
    if what.push:
        pushes = [PushSpec(machine.hit, begin, 0.15, force=(what.push, 0.0, 0.0)) for begin in HITS]
        add_pushes(builder, plant, pushes)
    spec = TorqueLoopSpec(dt=DT, seed=seed, faults=faults, filters=FilterSpec(window=machine.window))
    path = motion(machine, seconds, rng)
    loop = add_torque_loop(
        builder, plant, robot, drives, path, spec, gains=machine.gains, controller_models=machine.models
    )
    n = len(robot.joints)
    nothing = ModelHealth(robot.joints, np.ones(n), np.full(n, DT), np.zeros((n, len(CAUSES))))
    monitor = add_model_monitor(builder, loop, health or nothing)
    ports = {name: monitor.GetOutputPort(name) for name in ("cause", "change", "statistic")}
    ports["state"] = plant.get_state_output_port()
    if health is None:
        motion_port, effort = loop.signals["joint_estimate"], builder.GetSubsystemByName("effort_filter")
        ports |= {
            "motion": motion_port,
            "load": loop.signals["estimated_torque"],
            "effort": effort.GetOutputPort("value"),
        }
    logs = {name: LogVectorOutput(port, builder, LOG_S) for name, port in ports.items()}
    fuse(builder)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    masses = plant.GetMyMutableContextFromRoot(context)
    set_masses(plant, masses, machine.masses)
    if what.load:  # after the force/torque sensors were zeroed
        simulator.AdvanceTo(REST_S)
        body = plant.GetBodyByName(machine.tool)
        set_masses(plant, masses, {machine.tool: 1.0 + machine.payload / body.get_mass(masses)})
    codes = [CAUSES.index(cause) + 1 for cause in what.right]
    for time in np.arange(REST_S + CHUNK_S, seconds + 0.5 * CHUNK_S, CHUNK_S):
        simulator.AdvanceTo(float(time))
        if codes and np.isin(logs["cause"].FindLog(context).data()[where], codes).any() and time > SOON + REST_S:
            break
    signals = {name: np.asarray(log.FindLog(context).data().T) for name, log in logs.items()}
    signals["state"] = np.asarray(signals["state"][:, n:])
    return Watched(np.asarray(logs["cause"].FindLog(context).sample_times()), signals)


def calibrated(machine: Machine, seed: int) -> ModelHealth:
    """From a sound minute."""
    sound = run(machine, CALIBRATION_S, seed, None)
    n, still = len(machine.robot.joints), round(REST_S / LOG_S)
    motion_of = sound.signals["motion"].reshape(-1, 3, n)
    seen = np.concatenate([motion_of, sound.signals["load"][:, None], sound.signals["effort"][:, None]], axis=1)
    return health_of(list(machine.models.values()), seen[still:], LOG_S)


def loop_rows(hours: float, seed: int, progress: Progress) -> list[BenchmarkRow]:
    """Rows of both robots: delays of each change in three of the joints, and joint-hours without a change."""
    rows: list[BenchmarkRow] = []
    with tempfile.TemporaryDirectory() as folder:
        machines = (leg(np.random.default_rng([seed, 1])), arm(np.random.default_rng([seed, 2]), Path(folder)))
        for machine in machines:
            progress(f"{machine.name}: a sound minute", 0.0)
            health = calibrated(machine, seed)
            for number, (name, change) in enumerate(CHANGES.items()):
                progress(f"{machine.name}: {name}", number / len(CHANGES))
                rows += change_rows(machine, name, change, health, [seed, number])
            progress(f"{machine.name}: hours without a change", 1.0)
            joints = len(machine.robot.joints)
            still = run(machine, 3600.0 * hours / joints, seed + 1, health)
            rows.append(BenchmarkRow(f"{machine.name}: joint-hours without a change", hours, "h"))
            rows.append(BenchmarkRow(f"{machine.name}: false alarms in these", float(still.alarms()), "", 0.0, "max"))
    return rows


def change_rows(
    machine: Machine, name: str, change: Change, health: ModelHealth, seed: Sequence[int]
) -> list[BenchmarkRow]:
    """What is told of one change, in some of the joints."""
    rng = np.random.default_rng([*seed, 3])
    joints = rng.permutation(len(machine.robot.joints))[:JOINTS]
    servo = machine.models[machine.robot.joints[0]].drive.kind == "position_servo"
    if change.gap and not servo:
        return []  # the balance of a current does not contain backlash
    told = [run(machine, CHANGED_S, int(rng.integers(2**31)), health, (int(j), change)) for j in joints]
    title = f"{machine.name}, {name}"
    if not change.right or (change.load and machine.senses_load):
        pushed = [bool((w.signals["cause"] < 0.0).any()) for w in told]
        alarms = [w.alarms() > 0 for w in told]
        rows = [BenchmarkRow.share(f"{title}: told as a push", pushed)] if change.push else []
        return [*rows, BenchmarkRow.share(f"{title}: told as a change", alarms, "max", 0.0)]
    everyone = change.load or change.late  # what all joints see
    looked = [range(len(machine.robot.joints)) if everyone else [int(j)] for j in joints]
    right = np.array([min(w.until(j, change.right) for j in at) for w, at in zip(told, looked, strict=True)])
    first = np.array([min(w.until(j, CAUSES) for j in at) for w, at in zip(told, looked, strict=True)])
    rows = [
        BenchmarkRow.share(f"{title}: right cause within 20 s", np.isfinite(right).tolist()),
        BenchmarkRow.of_values(f"{title}: motion until noticed", "s", first[np.isfinite(first)]),
        BenchmarkRow.of_values(f"{title}: motion until the right cause", "s", right[np.isfinite(right)]),
    ]
    if name == "friction +20 %":
        rows.append(BenchmarkRow.share(f"{title}: noticed within 2 s of motion", (first <= SOON).tolist(), "min", 1.0))
    return rows
