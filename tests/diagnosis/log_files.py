"""Simulated joints written to log files, as a user hands them to `close-loop`, and the report that he gets."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.library import effect
from drake_tc.report.data_files import result_json

from .rigs import Joint, record

Change = Callable[[pd.DataFrame], pd.DataFrame]
TRAIN, HELD = ("one", "two"), ("held",)


@dataclass(frozen=True)
class Logs:
    """A rig file with its training and held-out logs."""

    rig: Path
    train: tuple[Path, ...]
    held: tuple[Path, ...]

    def report(self, *effects: str, assess_residual: bool = True, seed: int = 0) -> dict[str, Any]:
        """report.json of `close-loop`, which looks for these effects; for all of the library where none is given.

        `assess_residual=False` leaves out what it says of the residual, which takes longest; `seed` is that of the
        resampling.

        Raises:
            DrakeTcError: the input is refused.
        """
        options = DiagnosisOptions(assess_residual=assess_residual, seed=seed)
        options = replace(options, effects=tuple(map(effect, effects))) if effects else options
        return result_json(close_loop(self.rig, self.train, self.held, options))


def write_rig(folder: Path, joint: Joint, **keys: object) -> Path:
    """A rig file of one joint that knows the rotor inertia; `keys` are added to it."""
    document = {"joint": "joint", "drive": joint.drive, "declared": {"rotor_inertia": joint.inertia}, **keys}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return path


def write_logs(
    folder: Path,
    joint: Joint | Mapping[str, Joint],
    change: Change = lambda table: table,
    rig: Mapping[str, object] | None = None,
    names: Sequence[str] = (*TRAIN, *HELD),
) -> Logs:
    """Two training runs and a held-out run of different motions.

    Args:
        folder: Where to write.
        joint: The joint of all runs, or by run ("one", "two", "held").
        change: What is done to each table before it is written.
        rig: More keys of the rig file.
        names: File names of the three runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, (run, name) in enumerate(zip((*TRAIN, *HELD), names, strict=True)):
        own = joint[run] if isinstance(joint, Mapping) else joint
        recorded = record(own, run, 0.9 * k, k)
        table = change(pd.DataFrame({"time": recorded.time, **recorded.columns}))
        paths.append(folder / f"{name}.csv")
        table.to_csv(paths[-1], index=False)
    first = joint["one"] if isinstance(joint, Mapping) else joint
    return Logs(write_rig(folder, first, **(rig or {})), tuple(paths[:2]), tuple(paths[2:]))


def found(report: Mapping[str, Any]) -> list[str]:
    """Ids of the effects that are named, sorted."""
    return sorted(effect["id"] for effect in report["joints"]["joint"]["effects"])


def figures(report: Mapping[str, Any]) -> np.ndarray:
    """Floor, errors before and after, and held-out gains: what must not depend on how the logs are written."""
    joint = report["joints"]["joint"]
    errors = [joint["error"][stage][side] for stage in ("before", "after") for side in ("train", "heldout")]
    gains = [effect["heldout_gain"] for effect in sorted(joint["effects"], key=lambda e: e["id"])]
    return np.array([joint["noise_floor"], *errors, *gains])
