"""The cases of `python -m tests.benchmarks arms`: what is wrong, drawn at random, and the files that do not say so.

Every arm's links differ from its URDF: masses by up to 40 %, centres of mass by up to 30 % of the link's size, inertias
about the centre of mass by up to 50 %. Beside that, a case has one effect in one joint, one wrong sensor, or nothing.

No case has one of these sensor errors, because a log of this kind cannot identify them:

- the zero of the first encoder: nothing changes when the whole arm turns about the vertical;
- the zero of the last encoder: the parameters of the last link turn with it; the zeros of the others in part;
- an encoder's error once a turn: the first moments of the links take it up;
- the gain of a current sensor: the joint's friction and, for the most part, the links' masses take it up;
- a late encoder of a position servo: it acts as viscous friction.

The offset of a current sensor is a constant torque, which the library also calls asymmetric friction; that of a
position servo, whose effort is computed from the position, is an offset of the encoder. A late encoder of a current
drive is the same as a late command.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from drake_tc.loops.recording import write_log
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot, load_robot
from tests.benchmarks.blind_arm.arms import ARMS, Arm, LinkError, apply_errors, link_parameters, moving_links
from tests.benchmarks.blind_arm.physics import JointTruth
from tests.benchmarks.blind_arm.recorder import Noise, SimulatedArm, record_run

JOINT_EFFECTS = (
    "load_dependent_friction",
    "stribeck",
    "quadratic_viscous",
    "viscous_power",
    "torque_ripple",
    "current_lag",
    "delay",
    "deadzone",
    "asymmetric_friction",
    "cable_spring",
    "thermal_friction",
    "position_dependent_friction",
)
SENSORS = {"current_offset": "effort_bias", "late_encoder": "delay"}
"""A sensor's error, and the effect by which the library knows it."""
OFFSET_OF_SERVO = "encoder_offset"
"""The same of the effort of a position servo, which is computed from the position."""
ROUND = (*JOINT_EFFECTS, *SENSORS, "", "")
"""One round of cases; "" lacks nothing. Case k is entry k of these rounds without end."""
LATE = ("current_lag", "delay", "late_encoder")
"""Kinds that need a torque that changes fast: of arms that move fast enough only."""
FAST = 1.0
"""Largest speed of such an arm, at least [rad/s]."""
OF_LOADED = ("load_dependent_friction", "deadzone", *LATE)
"""Kinds that only joints with a changing load show, LATE that with the largest. Elsewhere the torque of the drive is
friction: it hardly changes, and its sign is that of the speed, so that a dead zone is Coulomb friction.
"""
RUNS = ("run_1", "run_2", "run_3", "run_held")
"""The last one is held out."""
SECONDS = 30.0
MASS_TOLERANCE = 0.4
"""Of each mass, at most; declared where the drive's gain is not."""
SERVOS = 3
"""Every third round's arms have position servos of unknown gain, the others currents with declared gains."""


@dataclass(frozen=True)
class ArmCase:
    """One case.

    Attributes:
        name: Unique.
        arm: Which.
        drive: Of all joints.
        joints: By joint.
        links: Errors of the links.
        kind: What is wrong, one of `ROUND`. where: In which joint.
        late: Delay of each encoder [s].
        offsets: What encoders read too much, where they do [rad].
        seed: Of motions and noise.
    """

    name: str
    arm: Arm
    drive: Literal["current", "position_servo"]
    joints: Mapping[str, JointTruth]
    links: Mapping[str, LinkError]
    kind: str
    where: str
    late: Mapping[str, float]
    seed: int
    offsets: Mapping[str, float] = field(default_factory=dict)


def arm_case(number: int, seed: int) -> ArmCase:
    """Case `number` of a seed.

    Args:
        number: Which of the rounds' entries.
        seed: Of all draws.
    """
    rng = np.random.default_rng([seed, number, 7])
    turn, kind = number // len(ROUND), ROUND[number % len(ROUND)]
    arms = [arm for arm in ARMS if kind not in LATE or max(arm.speed) >= FAST]
    arm = arms[(number + turn) % len(arms)]
    drive: Literal["current", "position_servo"] = "current"
    if (number + turn) % SERVOS == SERVOS - 1 and kind != "late_encoder":
        drive = "position_servo"
    joints = {j: joint_of(e, drive, rng) for j, e in zip(arm.joints, arm.effort, strict=True)}
    where, late = "", dict.fromkeys(arm.joints, 0.0)
    if kind:
        among = arm.loaded if kind in OF_LOADED else arm.joints
        among = arm.loaded[:1] if kind in LATE else among
        where = among[int(rng.integers(len(among)))]
        if kind == "late_encoder":
            late[where] = float(rng.uniform(0.02, 0.04))
        else:
            speed = arm.speed[arm.joints.index(where)]
            joints[where] = with_effect(kind, joints[where], speed, rng)
    name = case_name(number, arm, drive, kind, where)
    return ArmCase(name, arm, drive, joints, {}, kind, where, late, int(rng.integers(2**31)))


def case_name(number: int, arm: Arm, drive: str, kind: str, where: str) -> str:
    """Unique within a seed; it says what is wrong, so no file of the case has it."""
    return f"{number:03d}_{arm.name}_{drive.partition('_')[0]}_{kind or 'null'}" + (f"_{where}" if where else "")


def sound_case(arm: Arm, seed: int) -> ArmCase:
    """An arm with currents, declared drive gains and nothing wrong but the inertias of its URDF.

    Args:
        arm: Which.
        seed: Of all draws.
    """
    rng = np.random.default_rng([seed, len(ROUND), 7])
    joints = {j: joint_of(e, "current", rng) for j, e in zip(arm.joints, arm.effort, strict=True)}
    late = dict.fromkeys(arm.joints, 0.0)
    return ArmCase(f"{arm.name}_sound", arm, "current", joints, {}, "", "", late, int(rng.integers(2**31)))


def joint_of(rated: float, drive: str, rng: np.random.Generator) -> JointTruth:
    """Friction, rotor and drive in proportion to the joint's rated torque."""
    coulomb = rated * rng.uniform(0.03, 0.06)
    gain = rng.uniform(0.05, 0.2) if drive == "current" else rng.uniform(0.03, 0.06) / rated
    return JointTruth(
        viscous=float(coulomb * rng.uniform(0.5, 1.5)),
        coulomb=float(coulomb),
        rotor_inertia=float(rated * rng.uniform(0.004, 0.012)),
        gain=float(gain),
    )


def with_effect(kind: str, joint: JointTruth, speed: float, rng: np.random.Generator) -> JointTruth:
    """The joint with an effect of one to two times its Coulomb friction."""
    size = float(rng.uniform(1.0, 2.0)) * joint.coulomb
    sign = float(rng.choice([-1.0, 1.0]))
    phase = rng.uniform(0.0, 2.0 * np.pi)
    wave = 0.5 * size * np.array([np.cos(phase), np.sin(phase)])
    if kind == "viscous_power":
        exponent = float(rng.uniform(0.3, 0.5))
        numbers = {"viscous_power": 2.0 * size / speed**exponent, "viscous_exponent": exponent}
        return replace(joint, viscous=0.0, effect=kind, numbers=numbers)
    drawn: dict[str, dict[str, float]] = {
        "load_dependent_friction": {"load_friction": rng.uniform(0.1, 0.25)},
        "stribeck": {
            "stribeck": size,
            "stribeck_velocity": rng.uniform(0.04, 0.08) * speed,
            "stribeck_exponent": float(rng.choice([1.0, 2.0])),
        },
        "quadratic_viscous": {"quadratic_viscous": 1.5 * size / speed**2},
        "torque_ripple": {
            "ripple_cosine": wave[0],
            "ripple_sine": wave[1],
            "cycles_per_turn": float(rng.integers(20, 60)),
        },
        "current_lag": {"lag": rng.uniform(0.015, 0.04)},
        "delay": {"delay": rng.uniform(0.015, 0.035)},
        "deadzone": {"deadzone": size * joint.gain},
        "asymmetric_friction": {"coulomb_asymmetry": 0.5 * sign * size},
        "current_offset": {"offset": 0.5 * sign * size},
        "cable_spring": {"spring_stiffness": 2.0 * size, "spring_preload": sign * size},
        "thermal_friction": {
            "coulomb_per_kelvin": -0.025 * size,
            "viscous_per_kelvin": -0.02 * joint.viscous,
        },
        "position_dependent_friction": {
            "friction_cosine": 0.9 * wave[0],
            "friction_sine": 0.9 * wave[1],
            "cycles_per_turn": rng.uniform(4.0, 10.0),
        },
    }
    return replace(joint, effect=kind, numbers={name: float(value) for name, value in drawn[kind].items()})


def _link_errors(sizes: Mapping[str, float], rng: np.random.Generator) -> dict[str, LinkError]:
    """Of each link, by its size [m]."""
    errors = {}
    for link, size in sizes.items():
        way = rng.standard_normal(3)
        x, y, z = (float(c) for c in rng.uniform(0.0, 0.3) * size * way / np.linalg.norm(way))
        mass = float(rng.uniform(1.0 - MASS_TOLERANCE, 1.0 + MASS_TOLERANCE))
        errors[link] = LinkError(mass, float(rng.uniform(0.5, 1.5)), (x, y, z))
    return errors


def record_case(case: ArmCase, folder: Path) -> dict[str, Any]:
    """Simulate the runs of a case and write logs, robot file and rig file, which say nothing of what is wrong.

    Returns:
        The truth: id, where, the values that a report's parameters should have, friction, and the links' parameters.
    """
    rng = np.random.default_rng(case.seed)
    arm = simulated_arm(case, write_files(case, folder, rig_file(case)), rng)
    for number, name in enumerate(RUNS):
        write_log(record_run(arm, number, rng, SECONDS), folder / f"{name}.npz")
    return truth_of(arm)


def write_files(case: ArmCase, folder: Path, rig: str) -> Robot:
    """Write `arm.yaml` and the text of `rig.yaml` into a folder, which is made, and read the robot."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.yaml").write_text(case.arm.robot_file(), encoding="utf-8")
    (folder / "rig.yaml").write_text(rig, encoding="utf-8")
    return load_robot(folder / "arm.yaml")


def simulated_arm(case: ArmCase, robot: Robot, rng: np.random.Generator) -> SimulatedArm:
    """The arm of a case; the generator draws the errors of its links and the noise of its sensors."""
    plant: Any = make_plant(robot, 0.0)
    context: Any = plant.CreateDefaultContext()
    sizes = {link: _size(plant, context, link) for link in moving_links(plant, robot)}
    apply_errors(plant, context, _link_errors(sizes, rng))
    return SimulatedArm(case, robot, plant, context, Noise.draw(case.arm.joints, case.joints, rng))


def truth_of(arm: SimulatedArm) -> dict[str, Any]:
    """What `record_case` returns."""
    links = moving_links(arm.plant, arm.robot)
    return truth_of_joints(arm.case) | {"links": link_parameters(arm.plant, arm.context, links)}


def _size(plant: Any, context: Any, link: str) -> float:
    """Radius of gyration of a link about its origin [m]."""
    inertia: Any = plant.GetBodyByName(link).CalcSpatialInertiaInBodyFrame(context)
    moments = inertia.CalcRotationalInertia().get_moments()
    return float(np.sqrt(0.5 * np.sum(moments) / inertia.get_mass()))


def effect_name(case: ArmCase) -> str:
    """The effect by which the library knows what is wrong; empty for nothing."""
    if case.kind == "current_offset" and case.drive == "position_servo":
        return OFFSET_OF_SERVO
    return SENSORS.get(case.kind, case.kind)


def truth_of_joints(case: ArmCase) -> dict[str, Any]:
    """What a report should say of a case whose links are not wrong: id, where, parameters, and friction by joint."""
    numbers = dict(case.joints[case.where].numbers or {}) if case.where else {}
    estimated = dict(numbers)
    if case.kind == "current_offset":
        estimated = {"coulomb_asymmetry": numbers["offset"]}
    elif case.kind == "late_encoder":
        numbers = estimated = {"delay": case.late[case.where]}
    elif case.drive == "position_servo":
        estimated = {}  # the scale of the torques is known within the links' tolerance only
    friction = {j: {"viscous": t.viscous, "coulomb": t.coulomb} for j, t in case.joints.items()}
    if case.kind == "thermal_friction":
        del friction[case.where]  # the report's friction is that at the mean temperature
    return {
        "id": effect_name(case),
        "kind": case.kind,
        "drive": case.drive,
        "where": case.where,
        "parameters": numbers,
        "estimated": estimated,
        "friction": friction,
    }


def rig_file(case: ArmCase) -> str:
    """The rig file: robot, drive, load, and what a user knows."""
    servo = case.drive == "position_servo"
    rig: dict[str, Any] = {
        "robot": "arm.yaml",
        "drive": case.drive,
        "load": {"robot": "fitted"} | ({"tolerance": MASS_TOLERANCE} if servo else {}),
        "declared": ["rotor_inertia"],
    }
    if not servo:
        rig["drive_gain"] = {j: t.gain for j, t in case.joints.items()}
    return str(yaml.safe_dump(rig, sort_keys=False, default_flow_style=None, width=1000))
