"""Identify joints from public logs and store their models with intervals in models/public, with source and licence.

usage: record_public_joints.py DATA [NAME ...]

DATA is the folder of the public data sets. Only sets whose licence permits derived figures are listed; no log is
copied. A model file states its source, licence, runs, held-out error, and the 95 % interval of the drive gain, for
which an actuator file has no place.
"""

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from drake_tc.actuation.model_file import load_model_file, save_models
from drake_tc.cli.main import run
from tests.benchmarks.real_log_cases import case_files, import_set
from tests.benchmarks.real_logs import chosen_sets

STORE = Path(__file__).resolve().parents[1] / "models" / "public"


@dataclass(frozen=True)
class PublicJoint:
    """One model file.

    Attributes:
        title: What the joint is.
        case: Data set and case of tests/benchmarks/rigs.
        source: Repository and commit of the logs.
        licence: Of the logs.
    """

    title: str
    case: str
    source: str
    licence: str


JOINTS = {
    "dynamixel_xl330": PublicJoint(
        "Dynamixel XL330 servo, motor voltage as command, pendulum as load",
        "bam-xl330-pendulum/kp200_held_out/voltage",
        "github.com/Rhoban/bam, bam/data.bak/raw at af2260462471ff45ac18af159b1327ea51d8db15",
        "Apache-2.0 (Rhoban team)",
    ),
    "tmotor_ak80_6": PublicJoint(
        "T-Motor AK80-6 quasi direct drive (6:1), current as command, pendulum as load",
        "dfki-simple-pendulum/optimal_control_held_out",
        "github.com/dfki-ric-underactuated-lab/torque_limited_simple_pendulum, results at"
        " ed17ea2d32a35ad944944ca03ef57693e2986732",
        "BSD-3-Clause, Copyright 2021 DFKI RIC Underactuated Robotics Lab",
    ),
}


def record(name: str, data: Path) -> Path:
    """Identify one joint and write its file.

    Args:
        name: A key of `JOINTS`.
        data: Folder of the public data sets.

    Raises:
        SystemExit: no such name, or close-loop could not use the logs.
    """
    if name not in JOINTS:
        sys.exit(f"no joint {name!r}; joints: {', '.join(JOINTS)}")
    joint = JOINTS[name]
    (chosen,) = chosen_sets([joint.case])
    case = next(each for each in chosen.cases if joint.case == f"{chosen.name}/{each.name}")
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        files = case_files(chosen, case, import_set(chosen, data, place / "logs"), place)
        runs = [word for path in files.log for word in ("--log", str(path))]
        runs += [word for path in files.holdout for word in ("--holdout", str(path))]
        if run(["close-loop", "--rig", str(files.rig), *runs, "--out", str(place / "out"), "--no-closed-loop"]):
            sys.exit(f"{name}: close-loop could not use the logs of {joint.case}")
        return _store(name, joint, place / "out")


def _store(name: str, joint: PublicJoint, out: Path) -> Path:
    """The model after, with what a reader must know of it."""
    read = load_model_file(out / "model_after.yaml")
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    gains = {
        each: {
            "ci95": entry["parameters"]["drive"]["gain"]["ci95"],
            "unit": entry["parameters"]["drive"]["gain"]["unit"],
        }
        for each, entry in report["joints"].items()
    }
    about = {"joint": joint.title, "source": joint.source, "licence_of_the_logs": joint.licence}
    about |= {"case": joint.case, "command": f"python docs/record_public_joints.py DATA {name}"}
    provenance = about | dict(read.provenance) | {"verdict": report["verdict"], "drive_gain": gains}
    STORE.mkdir(exist_ok=True)
    save_models(read.models, STORE / f"{name}.yaml", provenance=provenance)
    return STORE / f"{name}.yaml"


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for each in sys.argv[2:] or JOINTS:
        print(record(each, Path(sys.argv[1])))
