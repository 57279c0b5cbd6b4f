"""The cases of `python -m tests.benchmarks arms --known-links`: arms whose URDF is right but for one thing.

A case lacks one of these, and its files do not say which:

    payload         a body at the last link, 3 to 8 % of the arm's moving mass, its centre 5 to 15 cm from the origin
    link_mass       20 to 40 % of the mass of one of the heavier links, at the same centre
    link_com        30 to 60 mm of the centre of one of these, across the line from which it is hung
    encoder_offset  2 to 5 degrees of the zero of one encoder
    an effect of one joint or the offset of one current, as in `cases`; or nothing.

Every third arm has position servos, the others currents whose drive gains are declared in every other case. No case has
one of these, because a log of this kind cannot identify them:

- the zero of the first encoder: nothing changes when the whole arm turns about the vertical;
- the zeros of the outer joints, beyond which so little hangs that a single joint shows 5 degrees;
- the second link: its weight loads the second joint alone, like a load over the position of that joint;
- a centre that is shifted along the line from the joint that carries its link: it is like another mass.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from drake_tc.loops.recording import write_log
from drake_tc.robot.plant import make_plant
from drake_tc.types import FloatArray
from tests.benchmarks.blind_arm.arms import ARMS, Arm, Body, LinkError, apply_errors, attach, moving_links
from tests.benchmarks.blind_arm.cases import (
    FAST,
    JOINT_EFFECTS,
    LATE,
    OF_LOADED,
    RUNS,
    SECONDS,
    SERVOS,
    ArmCase,
    case_name,
    joint_of,
    truth_of_joints,
    with_effect,
    write_files,
)
from tests.benchmarks.blind_arm.recorder import Noise, SimulatedArm, record_run

OF_THE_ARM = ("payload", "link_mass", "link_com", "encoder_offset")
KNOWN_ROUND = (*OF_THE_ARM, *JOINT_EFFECTS, *OF_THE_ARM, "current_offset", "", "", "")
"""One round of cases; "" lacks nothing. Case k is entry k of these rounds without end."""
HEAVY = 0.1
"""Share of the arm's moving mass of a link whose mass or centre is wrong, at least."""


def known_case(number: int, seed: int) -> ArmCase:
    """Case `number` of a seed; what is wrong with the arm itself is drawn by `record_known_case`."""
    rng = np.random.default_rng([seed, number, 11])
    turn, kind = number // len(KNOWN_ROUND), KNOWN_ROUND[number % len(KNOWN_ROUND)]
    arms = [arm for arm in ARMS if kind not in LATE or max(arm.speed) >= FAST]
    arm = arms[(number + turn) % len(arms)]
    servo = (number + turn) % SERVOS == SERVOS - 1 and kind != "current_offset"
    drive: Literal["current", "position_servo"] = "position_servo" if servo else "current"
    joints = {j: joint_of(effort, drive, rng) for j, effort in zip(arm.joints, arm.effort, strict=True)}
    where = _place(kind, arm, rng)
    offsets = {where: _signed(rng, np.deg2rad(2.0), np.deg2rad(5.0))} if kind == "encoder_offset" else {}
    if kind and kind not in OF_THE_ARM:
        joints[where] = with_effect(kind, joints[where], arm.speed[arm.joints.index(where)], rng)
    name = case_name(number, arm, drive, kind, where)
    late = dict.fromkeys(arm.joints, 0.0)
    return ArmCase(name, arm, drive, joints, {}, kind, where, late, int(rng.integers(2**31)), offsets)


def _place(kind: str, arm: Arm, rng: np.random.Generator) -> str:
    """Joint; empty for nothing, and for errors of links, whose place depends on the masses."""
    if kind in ("", "payload", "link_mass", "link_com"):
        return ""
    among = arm.loaded[:1] if kind in LATE else arm.loaded if kind in (*OF_LOADED, "encoder_offset") else arm.joints
    return among[int(rng.integers(len(among)))]


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def record_known_case(case: ArmCase, folder: Path) -> dict[str, Any]:
    """Simulate the runs of a case and write logs, robot file and rig file, which say nothing of what is wrong.

    Returns:
        The truth: id, where, the values that a report's parameters should have, and friction.
    """
    rng = np.random.default_rng(case.seed)
    robot = write_files(case, folder, known_rig_file(case))
    plant: Any = make_plant(robot, 0.0)
    context: Any = plant.CreateDefaultContext()
    truth = truth_of_joints(case)
    if case.kind in OF_THE_ARM:
        if case.kind == "encoder_offset":
            where, values = case.where, {"offset": case.offsets[case.where]}
        else:
            where, values = _spoil(case.kind, plant, context, moving_links(plant, robot), rng)
        truth |= {"where": where, "parameters": values, "estimated": values}
    arm = SimulatedArm(case, robot, plant, context, Noise.draw(case.arm.joints, case.joints, rng))
    for number, name in enumerate(RUNS):
        write_log(record_run(arm, number, rng, SECONDS), folder / f"{name}.npz")
    return truth


def _spoil(
    kind: str, plant: Any, context: Any, links: tuple[str, ...], rng: np.random.Generator
) -> tuple[str, dict[str, float]]:
    """Change the arm by one thing; where, and what a report should say of it."""
    masses = {name: float(plant.GetBodyByName(name).default_mass()) for name in links}
    if kind == "payload":
        mass = float(rng.uniform(0.03, 0.08)) * sum(masses.values())
        centre = rng.uniform(0.05, 0.15) * _unit(rng.standard_normal(3))
        attach(plant, context, links[-1], Body(mass, centre, float(rng.uniform(0.02, 0.05))))
        return links[-1], {"mass": mass, **_named(centre)}
    heavy = [name for name in links[2:] if masses[name] >= HEAVY * sum(masses.values())]
    link = heavy[int(rng.integers(len(heavy)))]
    if kind == "link_mass":
        share = _signed(rng, 0.2, 0.4)
        apply_errors(plant, context, {link: LinkError(1.0 + share, 1.0 + share, (0.0, 0.0, 0.0))})
        return link, {"mass": share * masses[link]}
    centre = np.asarray(plant.GetBodyByName(link).CalcSpatialInertiaInBodyFrame(context).get_com())
    across = np.cross(centre, rng.standard_normal(3)) if np.linalg.norm(centre) > 0.0 else rng.standard_normal(3)
    shift = rng.uniform(0.03, 0.06) * _unit(across)
    apply_errors(plant, context, {link: LinkError(1.0, 1.0, (float(shift[0]), float(shift[1]), float(shift[2])))})
    return link, _named(shift)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


def _named(vector: FloatArray) -> dict[str, float]:
    return {f"com_{axis}": float(value) for axis, value in zip("xyz", vector, strict=True)}


def known_rig_file(case: ArmCase) -> str:
    """The rig file: robot, drive, load, rotors, and in every other case of an arm with currents the drive gains."""
    rig: dict[str, Any] = {
        "robot": "arm.yaml",
        "drive": case.drive,
        "load": {"robot": "inverse_dynamics"},
        "declared": {j: {"rotor_inertia": t.rotor_inertia} for j, t in case.joints.items()},
    }
    if case.drive == "current" and case.seed % 2:
        rig["drive_gain"] = {j: t.gain for j, t in case.joints.items()}
    return str(yaml.safe_dump(rig, sort_keys=False, default_flow_style=None, width=1000))


def named_set_up(report: Mapping[str, Any]) -> dict[str, Any]:
    """The report with a payload or another zero that was found as an error of the set-up among the shared causes.

    Larger errors of an arm are found there. Their values have no intervals, and friction beside a wrong set-up is not
    what the report stands for.
    """
    errors = (report.get("set_up") or {}).get("errors", [])
    if not errors:
        return dict(report)
    named = {"payload": "payload", "zero": "encoder_offset"}
    found = [
        {
            "id": named.get(error["kind"], error["kind"]),
            "where": error["carrier"] if error["kind"] == "payload" else ", ".join(error["joints"]),
            "heldout_gain": 1.0,
            "indistinguishable": [],
            "parameters": {},
        }
        for error in errors
    ]
    return dict(report) | {"shared": [*found, *report.get("shared", [])], "final_parameters": {}}
