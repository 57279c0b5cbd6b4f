"""What a tuning is to a scenario: fields that it reads, and the simulations that confirm it.

Plants that are not what the controller takes them for: drive gains, friction and masses drawn, the model kept.

A torque loop and its motion as tasks for `drake_tc.analysis.tuning`: each joint's loop, motion and drive.

Each joint is taken by itself, the others where the reference has them. M_jj is that of the motion's middle posture;
margins are also asked for at the postures where M_jj is smallest and largest.

Tuning of a torque loop in a diagram that a function of the user's returns.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, OutputPort

from drake_tc.actuation.compensator import Compensator, Motion
from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import ModelFile
from drake_tc.analysis.sweep import sweep
from drake_tc.analysis.tracking_error import JointTask
from drake_tc.analysis.tuning import Tuning
from drake_tc.control.dynamics_terms import DynamicsTerms
from drake_tc.control.gains import TorqueGains
from drake_tc.control.joint_loop import JointLoop
from drake_tc.errors import ParamsError
from drake_tc.loops.function_diagram import FunctionEntry, FunctionLoop, FunctionScenario
from drake_tc.loops.recording import Progress
from drake_tc.loops.torque.default_gains import joint_loops
from drake_tc.loops.torque.references import references
from drake_tc.loops.torque.running import SETTLED, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec, sensor_suite
from drake_tc.loops.torque.stages import LoopDesign, actuator_models, loop_robot
from drake_tc.loops.torque.wiring import TorqueLoop
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.sensing.spec import SensorSpec
from drake_tc.types import GRAVITY, FloatArray

DRY = ("coulomb", "deadzone", "stribeck")
"""Effects that are drawn as dry friction."""


@dataclass(frozen=True)
class Spread:
    """Half widths of the uniform factors about 1, one drawn a joint or link.

    Attributes:
        k_tau: Of the drives' gains.
        k_v: Of K_v = K_tau b.
        dry: Of Coulomb friction and dead zone.
        mass: Of the links' masses and inertias, in the plant alone.
    """

    k_tau: float = 0.15
    k_v: float = 0.15
    dry: float = 0.5
    mass: float = 0.1


@dataclass(frozen=True)
class Compared:
    """One perturbed plant under several settings: what a point of the sweep is.

    Attributes:
        scenarios: Settings of one and the same experiment.
        spread: How far the plant may be off.
        begin: Errors are evaluated from here on [s].
    """

    scenarios: tuple[Scenario, ...]
    spread: Spread
    begin: float


def compare_on_plant(point: Compared, seed: int) -> FloatArray:
    """(settings, n) RMS tracking error [rad] on the plant that the seed draws; infinite where a joint runs away.

    The plant and its sensors' noise are the same under every setting.
    """
    first = point.scenarios[0]
    generator = np.random.default_rng(seed)
    robot = loop_robot(first)
    models = {joint: _drawn(model, point.spread, generator) for joint, model in actuator_models(first, robot).items()}
    masses = _masses(first, robot.joints, point.spread, generator)
    noise = int(generator.integers(2**31))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "actuators.yaml"
        ModelFile(models, shared=robot.changes.causes, links=robot.changes.fitted).save(file)
        rows = []
        for scenario in point.scenarios:
            known = scenario.model or scenario.actuators or str(Path(str(robot.actuators)).resolve())
            perturbed = replace(scenario, actuators=str(file), model=known, masses=masses, seed=noise)
            recording = simulate_scenario(perturbed, allow_runaway=True)
            error = recording.tracking_error[recording.time >= point.begin]
            ended = recording.time[-1] >= scenario.duration - 2.0 * scenario.dt
            rows.append(np.sqrt(np.mean(error**2, axis=0)) if ended else np.full(len(robot.joints), np.inf))
    return np.array(rows)


def _factor(width: float, generator: np.random.Generator) -> float:
    return float(generator.uniform(1.0 - width, 1.0 + width))


def _drawn(model: ActuatorModel, spread: Spread, generator: np.random.Generator) -> ActuatorModel:
    """The actuator with K_tau, K_v and dry friction drawn."""
    gain, k_v, dry = (_factor(width, generator) for width in (spread.k_tau, spread.k_v, spread.dry))

    def changed(value: EffectValue) -> EffectValue:
        factor = k_v / gain if value.key == "viscous" else dry if value.key in DRY else 1.0
        parameters = {k: v * factor if k == value.key else v for k, v in value.parameters.items()}
        return replace(value, parameters=parameters, ci95={})

    drive = replace(model.drive, gain=model.drive.gain * gain)
    return replace(model, drive=drive, effects=tuple(map(changed, model.effects)))


def _masses(
    scenario: Scenario, joints: tuple[str, ...], spread: Spread, generator: np.random.Generator
) -> Mapping[str, float]:
    """A factor for the link that each joint moves."""
    plant = make_plant(loop_robot(scenario), 0.0)
    links = [plant.GetJointByName(joint).child_body().name() for joint in joints]
    return {link: _factor(spread.mass, generator) for link in links}


EXACT = Spread(0.0, 0.0, 0.0, 0.0)


def tuned_fields(tuning: Tuning) -> dict[str, Any]:
    """`gains` and `filters` as a scenario file has them, of the joints that were tuned."""
    chosen = {joint.joint: joint.after.setting for joint in tuning.joints}
    gains = {
        name: {"kp": float(f"{s.kp:.6g}"), "ki": float(f"{s.ki:.6g}"), "k7": float(f"{s.k7:.6g}")}
        for name, s in chosen.items()
    }
    return {"gains": {"by_joint": gains}, "filters": {"window": tuning.window, "encoder_order": tuning.order}}


def tuned_scenario(scenario: Scenario, tuning: Tuning) -> Scenario:
    """The scenario with the tuned window and gains; joints that were not tuned keep theirs."""
    fields = tuned_fields(tuning)
    merged = {name: dict(gains) for name, gains in scenario.gains.by_joint.items()}
    for joint, gains in fields["gains"]["by_joint"].items():
        merged[joint] = {**merged.get(joint, {}), **gains}
    filters = replace(scenario.filters, **fields["filters"])
    return replace(scenario, gains=replace(scenario.gains, by_joint=merged), filters=filters)


LEAST = 1e-9
"""An RMS error below this counts as this [rad]."""


@dataclass(frozen=True, eq=False)
class Confirmed:
    """RMS tracking errors [rad] of the present and the tuned setting, simulated in the complete loop.

    Attributes:
        joints: Names.
        nominal: (M, 2, n) on the plant as it is modelled, one row a motion.
        plants: (P, 2, n) on perturbed plants, on the first motion.
    """

    joints: tuple[str, ...]
    nominal: FloatArray
    plants: FloatArray

    def ratio(self, tuning: Tuning) -> float:
        """Tuned over present on the first motion, geometric mean over the joints that were tuned."""
        rows = [self.joints.index(joint.joint) for joint in tuning.joints]
        before, after = np.maximum(self.nominal[0][:, rows], LEAST)
        return float(np.exp(np.mean(np.log(after / before))))

    @property
    def plant_ratios(self) -> FloatArray:
        """(P,) tuned over present, geometric mean over the joints; infinite where a joint ran away."""
        return np.asarray(np.exp(np.mean(np.log(self.plants[:, 1] / self.plants[:, 0]), axis=1)))


@dataclass(frozen=True)
class PerturbedPlants:
    """Plants that are off from their model.

    Attributes:
        count: How many.
        spread: How far they are off.
        seed: Of the plants.
    """

    count: int = 0
    spread: Spread = field(default_factory=Spread)
    seed: int = 0


def confirm(
    motions: list[tuple[Scenario, float]],
    tuning: Tuning,
    plants: PerturbedPlants | None = None,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Confirmed:
    """Simulate the present and the tuned setting beside each other.

    Args:
        motions: Scenarios, each with the time from which its errors are evaluated [s].
        tuning: Of the joints.
        plants: On the first of the motions; None: none.
        executor: As `sweep`.
        progress: Told how many simulations are done, and which share.

    Raises:
        SweepError: a simulation that failed.
    """
    plants = PerturbedPlants() if plants is None else plants

    def point(scenario: Scenario, begin: float, how: Spread) -> Compared:
        return Compared((scenario, tuned_scenario(scenario, tuning)), how, begin)

    points = [point(*motion, EXACT) for motion in motions]
    points += [point(*motions[0], plants.spread)] * plants.count
    found = sweep(compare_on_plant, points, executor=executor, chunk=1, progress=progress, seed=plants.seed)
    first = len(motions)
    joints = loop_robot(motions[0][0]).joints
    drawn = np.array(found[first:]).reshape(plants.count, 2, len(joints))
    return Confirmed(joints, np.array(found[:first]), drawn)


INERTIA_ROWS = 50
"""At about so many rows of the motion the inertias are taken."""


def joint_tasks(scenario: Scenario, begin: float | None = None) -> list[JointTask]:
    """One task a joint, with the scenario's own gains and filter.

    Args:
        scenario: As `joint_loops` wants it, with position servos.
        begin: Errors count from here on [s]; None: `SETTLED`, or the second half of a run shorter than twice that.

    Raises:
        ParamsError: another loop or other drives, or a scenario that cannot be built.
    """
    design = LoopDesign.of_scenario(scenario)
    desired = references(scenario, design.robot)
    motion = desired.motion.reshape(-1, 3, len(design.robot.joints))
    first = min(SETTLED, 0.5 * scenario.duration) if begin is None else begin
    return design_tasks(design, desired.time, motion, first)


def design_tasks(design: LoopDesign, time: FloatArray, motion: FloatArray, begin: float) -> list[JointTask]:
    """One task a joint, with the loop's own gains and filter.

    Args:
        design: As `joint_loops` wants it, with position servos.
        time: (T,) ticks of the control [s].
        motion: (T, 3, n) q_d, qdot_d, qddot_d [rad, rad/s, rad/s^2].
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: another loop or other drives.
    """
    own = joint_loops(design)
    robot, spec = design.robot, design.spec.compensation
    for drive in (*design.actuators, *design.models):
        if drive.drive.kind != "position_servo":
            raise ParamsError(f"tune: expected position servos; {drive.joint} is a {drive.drive.kind} drive")
    n = len(robot.joints)
    torque, inertias, torque_noise = _dynamics(robot, motion, design.spec)
    needed, dry = _efforts(design.actuators, torque, motion, 0.0, rotor=True)
    given, _ = _efforts(design.models, torque, motion, spec.direction_speed, rotor=spec.acceleration != "none")
    row = int(np.searchsorted(time, begin - 1e-9))
    noise = _noise(sensor_suite(design.spec).encoder, n)
    done = np.clip((time + design.spec.dt) / max(design.spec.guard.time_to_start((True,)), design.spec.dt), 0.0, 1.0)
    share = 3.0 * done**2 - 2.0 * done**3  # as the guard blends
    tasks = []
    for i, joint in enumerate(robot.joints):
        loops = tuple(_at_inertia(own[joint], inertia) for inertia in inertias[:, i].tolist())
        linear = loops[0].k_tau_model * torque[:, i] + loops[0].k_v_model * motion[:, 1, i]
        tasks.append(
            JointTask(
                joint,
                loops,
                motion[:, 0, i].copy(),
                motion[:, 1, i].copy(),
                motion[:, 2, i].copy(),
                torque[:, i].copy(),
                needed[:, i].copy(),
                given[:, i] - linear,
                dry[:, i].copy(),
                share,
                float(noise[i]),
                float(torque_noise[i]),
                row,
            )
        )
    return tasks


def _at_inertia(loop: JointLoop, inertia: float) -> JointLoop:
    """A loop with other links: their weight is in the motion's torque, and small beside the servo's stiffness."""
    return replace(
        loop,
        inertia=inertia + loop.inertia - loop.link_inertia,
        link_inertia=inertia,
        gravity_stiffness=0.0,
        sensed_inertia=0.0,
        sensed_gravity=0.0,
    )


def _dynamics(robot: Robot, motion: FloatArray, spec: TorqueLoopSpec) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(T, n) M qddot + h; (3, n) M_jj at its median, least and largest; (n,) noise of the torque a sample [N m]."""
    terms = DynamicsTerms(robot)
    scratch = terms.create_scratch()
    n = motion.shape[2]
    torque, inertias = np.empty((motion.shape[0], n)), []
    stride = max(1, motion.shape[0] // INERTIA_ROWS)
    for row, (q, v, a) in enumerate(motion):
        terms.place(scratch, q, v)
        torque[row] = terms.forces(scratch, a)
        if row % stride == 0:
            rest = terms.forces(scratch, np.zeros(n))
            inertias.append([terms.forces(scratch, unit)[i] - rest[i] for i, unit in enumerate(np.eye(n))])
    by_row = np.array(inertias)
    ordered = np.stack([np.median(by_row, axis=0), by_row.min(axis=0), by_row.max(axis=0)])
    middle = motion[motion.shape[0] // 2]
    terms.place(scratch, middle[0], np.zeros(n))
    return torque, ordered, _torque_noise(robot, terms, scratch, spec)


def _torque_noise(robot: Robot, terms: DynamicsTerms, scratch: Any, spec: TorqueLoopSpec) -> FloatArray:
    """(n,) [N m]: the F/T sensors' noise through J^T, and the accelerometer's as a gravity that trembles."""
    suite, n = sensor_suite(spec), len(robot.joints)
    weight = np.abs(terms.forces(scratch, np.zeros(n))) / GRAVITY
    variance = (weight * float(np.max(_noise(suite.accel, 3)))) ** 2 if robot.imu else np.zeros(n)
    if robot.force_torque:
        jacobian = terms.jacobian(scratch)
        each = np.concatenate([_noise(suite.force, 3), _noise(suite.torque, 3)])
        variance = variance + np.tile(each, len(robot.force_torque)) ** 2 @ jacobian**2
    return np.asarray(np.sqrt(variance))


def _noise(spec: SensorSpec, channels: int) -> FloatArray:
    """(channels,) standard deviation of a sample, its rounding included (resolution/sqrt 12)."""
    rounding = np.asarray(spec.channels("resolution", channels), dtype=np.float64) / np.sqrt(12.0)
    return np.asarray(np.hypot(spec.channels("noise", channels), rounding))


def _efforts(
    models: Sequence[ActuatorModel], torque: FloatArray, motion: FloatArray, direction_speed: float, *, rotor: bool
) -> tuple[FloatArray, FloatArray]:
    """(T, n) effort of the models along the reference, all their effects included, and dry friction's share of it."""
    compensator = Compensator(models, direction_speed)
    still, forwards = np.zeros(torque.shape[1]), np.ones(torque.shape[1])
    rows = []
    for tau, (q, v, a) in zip(torque, motion, strict=True):
        way = Motion(v, q, a if rotor else still)
        ahead, back = (compensator.effort(tau, replace(way, direction=sign * forwards)) for sign in (1.0, -1.0))
        rows.append((compensator.effort(tau, way), 0.5 * (ahead - back)))
    efforts, dry = np.array(rows).swapaxes(0, 1)
    return efforts, dry


def function_tasks(entry: FunctionEntry, scenario: FunctionScenario, begin: float) -> list[JointTask]:
    """One task a joint of the loop of a function, for the motion that its signal `reference` has.

    Args:
        entry: Of the function.
        scenario: How long the motion lasts.
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: a function that does not return its torque loop, a loop without a reference, one that cannot be
            tuned, or a reference that follows the state of another system.
    """
    built, loop = _built(entry, scenario)
    time = np.arange(0.0, scenario.duration + 0.5 * loop.period, loop.period)
    return design_tasks(loop.design, time, _motion(entry.name, built, loop, time), begin)


def confirm_function(entry: FunctionEntry, scenario: FunctionScenario, tuning: Tuning, begin: float) -> Confirmed:
    """Simulate the function's loop as it is and with the tuned gains and window.

    Args:
        entry: Of the function; it takes `spec` and `gains`.
        scenario: How long the simulations last.
        tuning: Of the joints.
        begin: Errors are evaluated from here on [s].

    Raises:
        ParamsError: a function without these arguments.
    """
    if entry.rebuild is None:
        raise ParamsError(
            f"{entry.name}: expected a function with the arguments `spec` and `gains` of add_torque_loop, with which"
            " the tuned loop is simulated; --no-simulate leaves this out"
        )
    _, loop = _built(entry, scenario)
    designs = (loop.design, design := tuned_design(loop.design, tuning))
    errors = [_errors(*_with_loop(entry.name, entry.rebuild(scenario, d.spec, d.gains)), begin) for d in designs]
    joints = design.robot.joints
    return Confirmed(joints, np.array([errors]), np.zeros((0, 2, len(joints))))


def tuned_design(design: LoopDesign, tuning: Tuning) -> LoopDesign:
    """The loop with the tuned window and gains; joints that were not tuned keep theirs, and all keep K6."""
    own = design.gains
    loop = np.array([model.drive.gain for model in design.models]) * (1.0 + own.kp)
    kp, ki, k7 = own.kp.copy(), own.ki.copy(), own.kd * loop
    for joint in tuning.joints:
        i, chosen = design.robot.joints.index(joint.joint), joint.after.setting
        kp[i], ki[i], k7[i] = chosen.kp, chosen.ki, chosen.k7
    gains = TorqueGains.from_servo(design.models, own.ks * loop, k7, kp, ki=ki, kf=own.kf)
    filters = replace(design.spec.filters, window=tuning.window, encoder_order=tuning.order)
    return replace(design, gains=gains, spec=replace(design.spec, filters=filters))


def _built(entry: FunctionEntry, scenario: FunctionScenario) -> tuple[FunctionLoop, TorqueLoop]:
    return _with_loop(entry.name, entry.build(scenario))


def _with_loop(name: str, built: FunctionLoop) -> tuple[FunctionLoop, TorqueLoop]:
    if built.torque_loop is None:
        raise ParamsError(
            f"{name}: expected a function that returns the diagram and the loop of add_torque_loop, as"
            " (diagram, loop), which tune needs; got the diagram alone"
        )
    return built, built.torque_loop


def _motion(name: str, built: FunctionLoop, loop: TorqueLoop, time: FloatArray) -> FloatArray:
    """(T, 3, n) of the signal `reference`, which must be a function of time.

    Raises:
        ParamsError: no such signal, or one whose system has a state.
    """
    port: Any = loop.signals.get("reference")
    context = built.diagram.CreateDefaultContext()
    source: Any = None if port is None else port.get_system()
    own = None if source is None else source.GetMyContextFromRoot(context)
    if own is None or own.num_total_states() or source.num_input_ports():
        raise ParamsError(f"{name}: expected a loop whose signal `reference` depends on the time alone")
    rows = np.empty((time.size, port.size()))
    for row, now in enumerate(time.tolist()):
        context.SetTime(now)
        rows[row] = port.Eval(own)
    return rows.reshape(time.size, 3, -1)


def _errors(built: FunctionLoop, loop: TorqueLoop, begin: float) -> FloatArray:
    """(n,) RMS of q_d - q from `begin` on [rad]; infinite where the loop runs away."""
    simulator = Simulator(built.diagram)
    context = simulator.get_mutable_context()
    n = len(loop.design.robot.joints)
    now = {name: _reader(loop.signals[name], context) for name in ("reference", "joint_state")}
    rows = []
    first, end = (round(instant / loop.period) for instant in (begin, built.scenario.duration))
    for tick in range(first, end):
        try:
            simulator.AdvanceTo(tick * loop.period)  # Drake's own product: a time beyond it would add the tick's step
        except RuntimeError:  # Drake's plant ends a run that leaves all bounds
            return np.full(n, np.inf)
        rows.append(now["reference"]()[:n] - now["joint_state"]()[:n])
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=0)))


def _reader(port: OutputPort, context: Context) -> Any:
    system: Any = port.get_system()
    own = system.GetMyContextFromRoot(context)
    return lambda: port.Eval(own)
