"""The cases of `python -m tests.benchmarks robot`: what is wrong, drawn at random, and the files that do not say so."""

import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.loops.recording import write_log
from drake_tc.loops.torque.running import log_columns
from drake_tc.robot.robot import Robot, load_robot
from drake_tc.sensing.suite import SensorSuiteSpec
from tests.benchmarks.blind_leg.biases import SensorBiases, Tolerances, by_axis, declared_sensors
from tests.benchmarks.blind_leg.recorder import Place, Wrong, random_motion, record_leg

ROBOT = Path(str(files("drake_tc.models"))) / "hrp2_like" / "hrp2_like_leg.yaml"
DECLARED = ("viscous", "coulomb", "rotor_inertia")
JOINT_EFFECTS = (
    "stribeck",
    "deadzone",
    "velocity_sign_switch",
    "load_dependent_friction",
    "cable_spring",
    "torque_ripple",
)
SHARED = ("ft_bias", "ft_gain", "imu_bias", "link_mass", "link_com")
ROUND = (*JOINT_EFFECTS, *SHARED, "", "")
"""One round of cases; "" lacks nothing. Case k is entry k of these rounds without end."""
LOADED = ("r_hip_roll", "r_hip_pitch", "r_knee", "r_ankle_pitch")
"""Joints that bear a load by which friction could grow."""
LINKS = ("r_thigh", "r_shank")
RUNS: tuple[tuple[str, Place, float], ...] = (
    ("run_rest", "rest", 0.3),
    ("run_swing", "swing", 0.3),
    ("run_ground", "ground", 0.05),
    ("run_held", "swing", 0.3),
)
"""Name, place and amplitude [rad] of the runs; the last one is held out."""
SECONDS = 6.0


@dataclass(frozen=True)
class LegCase:
    """One case.

    Attributes:
        name: Unique.
        truth: id, where, and the numbers of what is wrong; `estimated`: the values that a report's parameters should
            have; `biases` and `tolerances` of the sensors; `friction` of each joint.
        models: Joint to the simulated actuator.
        suite: What the sensors do.
        wrong: Of the links.
        seed: Of motions and noise.
        tolerances: That the rig file declares.
    """

    name: str
    truth: Mapping[str, Any]
    models: Mapping[str, ActuatorModel]
    suite: SensorSuiteSpec
    wrong: Wrong = field(default_factory=Wrong)
    seed: int = 0
    tolerances: Tolerances = field(default_factory=Tolerances)


def zeroed_suite() -> SensorSuiteSpec:
    """The realistic sensors without bias or scale, as if they had been zeroed perfectly."""
    suite = SensorSuiteSpec.realistic()
    return replace(
        suite,
        gyro=replace(suite.gyro, bias=0.0),
        accel=replace(suite.accel, bias=0.0),
        force=replace(suite.force, bias=0.0, scale=1.0),
        torque=replace(suite.torque, bias=0.0, scale=1.0),
    )


def leg_case(number: int, seed: int, tolerance_scale: float = 1.0) -> LegCase:
    """Case `number` of a seed.

    Args:
        number: Which of the rounds' entries.
        seed: Of all draws.
        tolerance_scale: Factor of the sensors' tolerances against `Tolerances`; the drawn biases and the declared
            tolerances grow by it.
    """
    rng = np.random.default_rng([seed, number])
    robot = load_robot(ROBOT)
    known = load_models(robot.actuators or "")
    models = {j: replace(m, effects=tuple(e for e in m.effects if e.key in DECLARED)) for j, m in known.items()}
    tolerances = Tolerances().scaled(tolerance_scale)
    # A generator of their own: the other draws of a case stay the same whatever the tolerances.
    biases = tolerances.draw(np.random.default_rng([seed, number, 1]))
    what, wrong = ROUND[number % len(ROUND)], Wrong()
    turn = number // len(ROUND)
    where = ""
    numbers: dict[str, Any] = {}
    estimated: dict[str, float] = {}
    if what in JOINT_EFFECTS:
        joints = LOADED if what == "load_dependent_friction" else robot.joints
        where = joints[(turn + JOINT_EFFECTS.index(what)) % len(joints)]
        value = _joint_effect(what, models[where], rng)
        models[where] = replace(models[where], effects=(*models[where].effects, value))
        numbers = estimated = dict(value.parameters)
    elif what in ("link_mass", "link_com"):
        where = LINKS[turn % len(LINKS)]
        wrong, numbers = _wrong_link(what, where, rng)
        estimated = {"mass": numbers["mass"]} if what == "link_mass" else by_axis("com", numbers["com"])
    elif what:
        where = robot.imu[0].name if what == "imu_bias" else robot.force_torque[0].name
        biases, numbers = _wrong_sensor(what, biases, rng)
        estimated = biases.estimated(what)
    truth = {"id": what, "where": where, "parameters": numbers, "estimated": estimated, "biases": asdict(biases)}
    name = f"{number:03d}_{what or 'null'}" + (f"_{where}" if where else "")
    truth |= {"tolerances": asdict(tolerances), "friction": {j: _friction(model) for j, model in models.items()}}
    suite = biases.applied(zeroed_suite())
    return LegCase(name, truth, models, suite, wrong, int(rng.integers(2**31)), tolerances)


def _friction(model: ActuatorModel) -> dict[str, float]:
    """True viscous coefficient [N m s/rad] and Coulomb level [N m]."""
    return {e.key: float(e.parameters[e.key]) for e in model.effects if e.key in ("viscous", "coulomb")}


def _joint_effect(what: str, model: ActuatorModel, rng: np.random.Generator) -> EffectValue:
    """An effect in proportion to the joint's own friction."""
    coulomb = next(e.parameters["coulomb"] for e in model.effects if e.key == "coulomb")
    size, sign = rng.uniform(1.0, 1.8), float(rng.choice([-1.0, 1.0]))
    parameters = {
        "stribeck": {
            "stribeck": size * coulomb,
            "stribeck_velocity": rng.uniform(0.03, 0.08),
            "stribeck_exponent": 1.5,
        },
        "deadzone": {"deadzone": 0.7 * size * coulomb * model.drive.gain},
        "velocity_sign_switch": {"switch": 0.08 * sign * size},
        "load_dependent_friction": {"load_friction": 0.12 * size},
        "cable_spring": {"spring_stiffness": 3.0 * size * coulomb, "spring_preload": 0.5 * sign * coulomb},
        "torque_ripple": {
            "ripple_cosine": 0.35 * size * coulomb,
            "ripple_sine": 0.25 * sign * size * coulomb,
            "cycles_per_turn": float(rng.integers(24, 60)),
        },
    }[what]
    return EffectValue(what, {name: float(value) for name, value in parameters.items()})


def _direction(rng: np.random.Generator) -> Any:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _wrong_link(what: str, link: str, rng: np.random.Generator) -> tuple[Wrong, dict[str, Any]]:
    if what == "link_mass":
        more = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 1.0))
        return Wrong(mass={link: more}), {"mass": more}
    x, y, z = (float(v) for v in rng.uniform(0.02, 0.04) * _direction(rng))
    return Wrong(com={link: (x, y, z)}), {"com": [x, y, z]}


def _wrong_sensor(what: str, biases: SensorBiases, rng: np.random.Generator) -> tuple[SensorBiases, dict[str, Any]]:
    """The biases with an error far beyond any tolerance added, and that error's numbers."""
    if what == "ft_bias":
        force, torque = rng.uniform(3.0, 8.0) * _direction(rng), rng.uniform(0.2, 0.6) * _direction(rng)
        return biases.plus(force=force, torque=torque), {"force": force.tolist(), "torque": torque.tolist()}
    if what == "ft_gain":
        scale = 1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(0.06, 0.15))
        return replace(biases, scale=scale), {"scale": scale}
    accel = rng.uniform(0.25, 0.6) * _direction(rng)
    return biases.plus(accel=accel), {"accel": accel.tolist()}


def record_case(case: LegCase, folder: Path) -> None:
    """Simulate the runs of a case and write logs, robot file and rig file, which say nothing of what is wrong."""
    folder.mkdir(parents=True, exist_ok=True)
    robot: Robot = load_robot(ROBOT)
    rng = np.random.default_rng(case.seed)
    for number, (name, place, size) in enumerate(RUNS):
        motion = random_motion(rng, robot, size, robot.posture)
        recording = record_leg(
            robot, case.models, case.suite, place, motion, SECONDS, case.wrong, seed=case.seed + number
        )
        write_log(log_columns(recording), folder / f"{name}.npz")
    document = yaml.safe_load(ROBOT.read_text(encoding="utf-8"))
    document["fixed_base"] = False
    del document["actuators"]
    (folder / ROBOT.name).write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    shutil.copy(robot.urdf, folder)
    rig = {
        "robot": ROBOT.name,
        "drive": "position_servo",
        "load": {"robot": "estimate"},
        "declared": ["rotor_inertia"],
        "sensors": declared_sensors(robot, case.tolerances),
    }
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig, sort_keys=False), encoding="utf-8")
