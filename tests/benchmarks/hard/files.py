"""Files of a draw.

`rigs/NAME/rig.yaml`, `rigs/NAME/run_*.csv` (a held-out run is `run_held_*.csv`) and `truth/NAME/truth.json`.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from tests.benchmarks.hard.causes import CAUSES
from tests.benchmarks.hard.draw import Drawn
from tests.benchmarks.hard.rig import Rig

JOINT = "axis"
GEAR_RATIO = 50.0


def write(drawn: Drawn, folder: Path) -> None:
    """All files of a rig under `folder`."""
    rig, place = drawn.rig, folder / "rigs" / drawn.rig.name
    place.mkdir(parents=True, exist_ok=True)
    for old in place.glob("run_*.csv"):
        old.unlink()
    (place / "rig.yaml").write_text(yaml.safe_dump(rig_document(drawn), sort_keys=False), encoding="utf-8")
    shown = [name for name in rig.channels if name != "temperature" or rig.settings["temperature"]]
    for run in rig.runs:
        recording = drawn.recordings[run.name]
        table = pd.DataFrame({"time": recording.time} | {f"{JOINT}/{name}": recording.columns[name] for name in shown})
        table.to_csv(place / f"{run.name}.csv", index=False, float_format="%.9g")
    truth = folder / "truth" / rig.name
    truth.mkdir(parents=True, exist_ok=True)
    (truth / "truth.json").write_text(json.dumps(truth_document(drawn), indent=1) + "\n", encoding="utf-8")


def rig_document(drawn: Drawn) -> dict[str, Any]:
    """The rig file: what a careful user of the rig knows."""
    rig, joint = drawn.rig, drawn.world.joint
    document: dict[str, Any] = {"joint": JOINT, "drive": rig.drive, "load": rig.load}
    if rig.load == "pendulum":
        mass, length = _pendulum(rig)
        document["load"] = {"pendulum": {"mass": mass, "length": length}}
    if "rotor_inertia" not in rig.causes:
        document["declared"] = {"rotor_inertia": float(joint.rotor)}
    if rig.gain_held:
        document |= _gain(rig, float(joint.gain))
    sensors = _sensors(rig)
    return document | ({"sensors": sensors} if sensors else {})


def _pendulum(rig: Rig) -> tuple[float, float]:
    """Mass [kg] and length [m] of the point mass that has the link's moment and inertia."""
    joint = rig.world.joint
    length = joint.link * 9.81 / joint.moment
    return float(joint.moment / (9.81 * length)), float(length)


def _gain(rig: Rig, gain: float) -> dict[str, float]:
    if rig.drive == "position_servo":
        return {"proportional_gain": 1.0 / gain}
    if rig.drive == "current":
        return {"torque_constant": 1.0 / (gain * GEAR_RATIO), "gear_ratio": GEAR_RATIO}
    return {"drive_gain": gain}


def _sensors(rig: Rig) -> dict[str, Any]:
    """`sensors:` of the rig file."""
    sensors: dict[str, Any] = {}
    for key, size in rig.tolerances.items():
        sensor, kind = key.split(".")
        sensors.setdefault(rig.drive if sensor == "effort" else sensor, {})[kind] = float(size)
    if rig.settings["noise_stated"]:
        if rig.load == "torque":
            sensors["torque_noise"] = float(rig.channels["torque"].noise)
        sensors["encoder_step"] = float(rig.channels["position"].step)
    return sensors


def truth_document(drawn: Drawn) -> dict[str, Any]:
    """What is true of the rig, in the units of the documentation."""
    rig, joint = drawn.rig, drawn.world.joint
    rows = np.array([drawn.recordings[run.name].time.size for run in rig.training], dtype=float)
    share = rows / rows.sum()
    coulomb = joint.coulomb * float(share @ [run.coulomb for run in rig.training])
    viscous = joint.viscous * float(share @ [run.viscous for run in rig.training])
    declared = {"viscous": viscous + joint.derivative + joint.back_emf / joint.gain, "coulomb": coulomb}
    if not rig.gain_held:
        declared["drive_gain"] = float(joint.gain)
    causes = [
        {
            "id": name,
            "parameters": CAUSES[name].parameters(drawn.world, shape),
            "allowed": list(drawn.judgements[name].allowed),
            "strength_floors": drawn.judgements[name].floors,
            "oracle_log_odds": drawn.judgements[name].log_odds,
        }
        for name, shape in rig.causes.items()
    ]
    return {
        "name": rig.name,
        "drive": rig.drive,
        "load": rig.load,
        "null": not causes,
        "causes": causes,
        "tolerated": _tolerated(rig),
        "declared_parameters": declared,
        "floor": drawn.floor,
        "settings": _settings(rig),
    }


def _tolerated(rig: Rig) -> list[str]:
    """A channel whose sample is older than its own period is late indeed; to name that is neither asked nor false."""
    own = [channel for name, channel in rig.channels.items() if name not in ("temperature", "velocity")]
    late = any(channel.age + 0.5 * channel.average > channel.every / rig.rate for channel in own)
    return ["current_lag", "delay"] if late else []


def _settings(rig: Rig) -> dict[str, Any]:
    joint = rig.world.joint
    return {
        **rig.settings,
        "rate": rig.rate,
        "stamp_jitter": rig.stamp_jitter,
        "gain_held": rig.gain_held,
        "travel": rig.travel,
        "fastest_hz": rig.fastest_hz,
        "torque_scale": rig.scales.torque,
        "rotor_inertia": joint.rotor,
        "friction_spread": list(rig.friction_spread),
        "zero_spread": rig.zero_spread,
        "tolerances": dict(rig.tolerances),
        "runs": [{"name": run.name, "kind": run.kind, "seconds": run.duration} for run in rig.runs],
        "channels": {name: vars(channel) for name, channel in rig.channels.items()},
    }
