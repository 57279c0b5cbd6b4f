"""Cases: the n-th one writes its files into a folder and has the arguments of one command; nothing but n decides."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import yaml

from .logs import damaged_log
from .odd import NAMES, SCALARS, damage, damage_bytes
from .robots import damaged_urdf
from .sound import Sound


@dataclass(frozen=True)
class Case:
    """One call of `drake-tc`.

    Attributes:
        number: Of the case.
        kind: What is damaged.
        arguments: Of the command.
    """

    number: int
    kind: str
    arguments: tuple[str, ...]


def case(number: int, sound: Sound, folder: Path) -> Case:
    """The case of that number; its files are in `folder`, which is empty before."""
    rng = Random(number)
    kind = rng.choices(list(KINDS), [weight for weight, _ in KINDS.values()])[0]
    arguments = KINDS[kind][1](sound, folder, rng)
    return Case(number, kind, tuple(map(str, arguments)))


def _write(path: Path, document: Any) -> Path:
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return path


def _damaged(path: Path, document: Any, rng: Random) -> Path:
    """A YAML file with odd places; one in eight with odd bytes."""
    if rng.random() < 0.125:
        path.write_bytes(damage_bytes(yaml.safe_dump(document).encode(), rng))
    else:
        path.write_text(damage(document, rng), encoding="utf-8", errors="surrogatepass")
    return path


def _joint_log(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    rig, log = _write(folder / "rig.yaml", sound.joint_rig), damaged_log(sound.joint, folder, rng)
    if rng.random() < 0.2:
        return ["inspect", log, "--json"]
    return ["identify", "--rig", rig, "--log", log, "--out", folder / "out" / "model.yaml", "--json"]


def _joint_rig(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    log = folder / "run.npz"
    _save(sound.joint | {"on": sound.joint["time"] >= 0.0}, log)
    rig = _damaged(folder / "rig.yaml", sound.joint_rig | _more_rig(rng), rng)
    return ["identify", "--rig", rig, "--log", log, "--out", folder / "out" / "model.yaml", "--json"]


def _more_rig(rng: Random) -> dict[str, Any]:
    more = {
        "units": {"position": "rad", "torque": "N*m"},
        "columns": {"torque": "elbow/torque"},
        "sensors": {"torque_noise": "0.05 N*m", "encoder_step": "0.001 rad"},
        "load": "torque",
        "saturation": 0.35,
        "enabled": "on",
        "drive_gain": 0.002,
    }
    return {key: more[key] for key in rng.sample(list(more), 3)}


def _save(columns: Mapping[str, Any], path: Path) -> None:
    import numpy as np

    np.savez(path, **columns)


def _arm(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """One of URDF, robot file, rig file and log of an arm is odd."""
    which = rng.choice(("urdf", "urdf", "urdf", "robot", "robot", "rig", "log"))
    urdf = damaged_urdf(sound.arm_urdf, rng) if which == "urdf" else sound.arm_urdf.encode()
    (folder / "arm.urdf").write_bytes(urdf)
    (
        _damaged(folder / "arm.yaml", sound.arm_robot, rng)
        if which == "robot"
        else _write(folder / "arm.yaml", sound.arm_robot)
    )
    rig_file = folder / "arm_rig.yaml"
    rig = _damaged(rig_file, sound.arm_rig, rng) if which == "rig" else _write(rig_file, sound.arm_rig)
    log = folder / "arm.npz"
    if which == "log":
        log = damaged_log(sound.arm, folder, rng, "arm")
    else:
        _save(sound.arm, log)
    return ["estimate-torque", "--rig", rig, "--log", log, "--out", folder / "out", "--json"]


def _base(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """Rig file or log of a humanoid that stands."""
    if rng.random() < 0.5:
        log, rig = damaged_log(sound.base, folder, rng), _write(folder / "rig.yaml", sound.base_rig)
    else:
        log, rig = folder / "run.npz", _damaged(folder / "rig.yaml", sound.base_rig, rng)
        _save(sound.base, log)
    return ["estimate-base", "--rig", rig, "--log", log, "--out", folder / "out", "--json"]


def _diagnosed(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """The whole main job, of a damaged log, rig or nothing."""
    rig = _damaged(folder / "rig.yaml", sound.joint_rig, rng) if rng.random() < 0.3 else None
    call = ["--rig", rig or _write(folder / "rig.yaml", sound.joint_rig)]
    for option, stem in (("--log", "one"), ("--log", "two"), ("--holdout", "three")):
        columns = dict(sound.joint) | {"elbow/torque": sound.joint["elbow/torque"] + 1e-3 * len(stem) * ord(stem[0])}
        call += [option, damaged_log(columns, folder, rng, stem)]
    return ["close-loop", *call, "--out", folder / "out", "--no-closed-loop", "--json"]


def _analysed(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """A damaged scenario of the series-elastic joint or the leg, linearised."""
    name = rng.choice(("sea_joint", "hrp2_leg"))
    path = _damaged(folder / "s.yaml", sound.scenarios[name], rng)
    port = "voltage" if name == "sea_joint" else "command"
    cut = ["--open-at", f"torque_control:{port}"]
    return ["stability", name, "--at", "0.02", *cut, "--scenario-file", path, "--json"]


def _scenario(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """A scenario file or text with odd fields."""
    name = rng.choice(list(sound.scenarios))
    ((scenario, own),) = sound.scenarios[name].items()
    more = MORE_FIELDS[name]
    document = {scenario: own | {key: more[key] for key in rng.sample(list(more), 3)}}
    command = ["graph", name, "--format", "json"]
    if rng.random() < 0.5:
        command = ["simulate", name, "--duration", "0.01", "--json"]
    (fields,) = document.values()
    if command[0] == "simulate" and rng.random() < 0.4:
        path = _write(folder / "s.yaml", document)
        chosen = {key: fields[key] for key in rng.sample(list(fields), 2)}
        return [*command, "--scenario-file", path, "--scenario-text", _argument(damage(chosen, rng))]
    return [*command, "--scenario-file", _damaged(folder / "s.yaml", document, rng)]


def _argument(text: str) -> str:
    """As an argument of a process can be: no zero byte, not too long."""
    return text.replace("\x00", "")[:100_000]


def _controller(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    controller = _damaged(folder / "controller.yaml", sound.controller, rng)
    (scenario,) = sound.scenarios["humanoid_tsid"]
    fields = sound.scenarios["humanoid_tsid"][scenario] | {"controller": str(controller)}
    return [
        "graph",
        "humanoid_tsid",
        "--format",
        "json",
        "--scenario-file",
        _write(folder / "s.yaml", {scenario: fields}),
    ]


def _actuators(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """Model files: of the library's diagrams, and as export reads them."""
    if rng.random() < 0.6:
        to = rng.choice(("mjcf", "urdf", "drake-urdf", "sdf", "isaaclab", "bam"))
        return ["export", _damaged(folder / "model.yaml", sound.model, rng), "--to", to, "--json"]
    diagram, key, document = rng.choice(
        (("sea_joint", "actuators", sound.actuators), ("hrp2_leg", "model", sound.model))
    )
    path = _damaged(folder / "actuators.yaml", document, rng)
    ((scenario, fields),) = sound.scenarios[diagram].items()
    written = _write(folder / "s.yaml", {scenario: fields | {key: str(path)}})
    return ["simulate", diagram, "--duration", "0.01", "--json", "--scenario-file", written]


def _into(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """A file of the user's own that an export is merged into."""
    joint = "r_knee"
    to, text = rng.choice(
        (
            ("urdf", sound.arm_urdf.replace("knee", joint)),
            ("mjcf", f'<mujoco><worldbody><body><joint name="{joint}" damping="1"/></body></worldbody></mujoco>'),
            ("sdf", f'<sdf version="1.9"><model name="m"><joint name="{joint}" type="revolute"/></model></sdf>'),
        )
    )
    path = folder / "mine.xml"
    path.write_bytes(damaged_urdf(text, rng) if to == "urdf" else damage_bytes(text.encode(), rng))
    return [
        "export",
        _write(folder / "model.yaml", sound.model),
        "--to",
        to,
        "--into",
        path,
        "--joint",
        joint,
        "--json",
    ]


def _sheet(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    _save(sound.motor, folder / "run.npz")
    rig = _write(folder / "rig.yaml", {"joint": "elbow", "drive": "voltage", "load": "torque"})
    sheet = _damaged(folder / "sheet.yaml", sound.sheet, rng)
    out = folder / "out" / "model.yaml"
    return [
        "identify",
        "--method",
        "motor",
        "--rig",
        rig,
        "--log",
        folder / "run.npz",
        "--sheet",
        sheet,
        "--out",
        out,
        "--json",
    ]


def _data_set(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """A BAM run with odd entries."""
    source = folder / "set"
    source.mkdir()
    entries = [
        {"timestamp": 0.01 * i, "position": 0.1 * i % 3, "goal_position": 0.1 * i % 2, "load": i} for i in range(40)
    ]
    run = {"mass": 0.5, "length": 0.1, "kp": 100, "motor": "xl330", "trajectory": "lift", "entries": entries}
    for _ in range(rng.choice((1, 1, 2))):
        place: Any = run if rng.random() < 0.5 else rng.choice(entries)
        key = rng.choice(list(place))
        place[key] = rng.choice((None, "x", [], {}, "../../x", -1, 1e400, "[/x]", [1], {"a": 1}, "", 0, True))
        if rng.random() < 0.2:
            del place[key]
    content = json.dumps(run).encode()
    (source / "run.json").write_bytes(damage_bytes(content, rng) if rng.random() < 0.2 else content)
    return ["import", "bam", source, "--out", folder / "out"]


def _words(sound: Sound, folder: Path, rng: Random) -> list[Any]:
    """Arguments alone are odd."""
    log, out = folder / "run.npz", folder / "out"
    _save(sound.joint, log)
    rig = _write(folder / "rig.yaml", sound.joint_rig)
    call = rng.choice(
        (
            ["identify", "--rig", rig, "--log", log, "--out", out / "m.yaml", "--method", "asymmetric"],
            ["simulate", "sea_joint", "--duration", "0.01", "--seed", "1", "--out", out, "--log-format", "csv"],
            ["graph", "sea_joint", "--format", "json", "--depth", "1", "--stage", "hand=plant"],
            ["stability", "sea_joint", "--at", "0.01", "--open-at", "torque_control:command", "--joint", "0"],
            ["bode", "sea_joint", "--input", "a:b", "--output", "c:d", "--from", "1", "--to", "2", "--points", "1"],
            ["stability-map", "hrp2_leg", "--joint", "r_knee", "--x", "window=20:40:20", "--y", "kp=1,2"],
            ["schema", "rig"],
            ["inspect", log, "--rig", out / "rig.yaml"],
            ["export", rig, "--to", "mjcf", "--torque-constant", "1"],
            ["reproduce", "A.nothing", "--seed", "0"],
        )
    )  # fmt: skip
    words = list(map(str, call))
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(words))
        odd = _argument(rng.choice((*SCALARS, *NAMES, str(folder), str(folder / "gone"), "-h", "--json", "--", "a:b")))
        words[at : at + 1] = rng.choice(([odd], [], [words[at], odd], [words[at]] * 2, [words[at][:-1]], [odd]))
    return words


_SENSOR = {"noise": 1e-4, "latency": 2e-3, "resolution": 1e-5, "bias": 0.0}
MORE_FIELDS: Mapping[str, dict[str, Any]] = {
    "hrp2_leg": {
        "filters": {"window": 40, "encoder_order": 2, "inertial_order": 1},
        "sensors": {"encoder": _SENSOR},
        "dt": 1e-3,
        "plant_step": 2.5e-4,
        "model_factors": {"k_tau": 1.1, "k_v": 0.9},
        "pushes": [{"link": "r_foot", "begin": 0.0, "duration": 0.01, "force": [1.0, 2.0, 3.0]}],
        "masses": {"r_foot": 1.1},
        "monitor": {"hold": 0.1, "encoder_jump": 1e-3},
        "faults": {"encoder": [{"kind": "biased", "start": 0.0, "value": 0.1, "channels": [1]}]},
    },
    "sea_joint": {
        "dt": 1e-3,
        "delay": 2e-3,
        "seed": 3,
        "torque_from": "deflection",
        "link": {"inertia": 0.1, "gravity_moment": 1.0},
    },
    "humanoid_tsid": {
        "state": "estimated",
        "torque": "drives",
        "plant_step": 5e-4,
        "masses": {"torso": 1.1},
        "torque_error": {"hold": 5e-3, "scale": 1.0},
        "motion": {"com": {"times": [0.1, 0.2], "offsets": [[0.0, 0.0, 0.0], [0.0, 0.01, 0.0]]}},
        "ground": {"friction": 0.8},
    },
}
"""Fields of scenarios of which some are there in a case."""

KINDS: Mapping[str, tuple[int, Callable[[Sound, Path, Random], list[Any]]]] = {
    "log": (28, _joint_log),
    "rig": (12, _joint_rig),
    "arm": (18, _arm),
    "base": (8, _base),
    "diagnosed": (1, _diagnosed),
    "analysed": (2, _analysed),
    "scenario": (14, _scenario),
    "controller": (5, _controller),
    "actuators": (8, _actuators),
    "into": (3, _into),
    "sheet": (3, _sheet),
    "data set": (4, _data_set),
    "words": (10, _words),
}
"""Kind to weight and maker."""
