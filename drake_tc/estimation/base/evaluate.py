"""Run the estimator and its baseline over a log file, and say how far each is from the truth where there is one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.errors import ParamsError, RigError
from drake_tc.estimation.base.estimator import CopEstimator, FootCentreEstimator
from drake_tc.estimation.base.kinematics import CONTACT_FLAGS, FLAGS
from drake_tc.estimation.base.read_log import BaseTrack, TrackError, read_base_log, run_log, timing_notes, track_error
from drake_tc.estimation.base.rig import BaseRig
from drake_tc.types import FloatArray

_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class BaseResult:
    """What came out of a log.

    Attributes:
        estimate, baseline: Of `CopEstimator` and `FootCentreEstimator`.
        truth: As measured, or None.
        contacts: Names, in order.
        notes: Sentences on the log.
    """

    estimate: BaseTrack
    baseline: BaseTrack
    truth: BaseTrack | None
    contacts: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def errors(self) -> tuple[TrackError, TrackError] | None:
        """(estimate's, baseline's), or None without a truth."""
        if self.truth is None:
            return None
        return track_error(self.estimate, self.truth), track_error(self.baseline, self.truth)

    def flag_shares(self) -> dict[str, float]:
        """Share of the samples with each flag up; those of contacts as `<contact>/<flag>`."""
        shares = dict(zip(FLAGS, self.estimate.flags.mean(axis=0).tolist(), strict=True))
        for name, row in zip(self.contacts, self.estimate.contact_flags.mean(axis=0).tolist(), strict=True):
            shares |= {f"{name}/{flag}": share for flag, share in zip(CONTACT_FLAGS, row, strict=True)}
        return shares

    def to_json(self) -> dict[str, Any]:
        """As `drake-tc estimate-base --json` prints it: RMSE in SI units, angles in degrees."""
        rows: list[dict[str, Any]] = []
        if self.errors is not None:
            for which, error in zip(("estimate", "foot_centre"), self.errors, strict=True):
                groups = (
                    ("position", "m", _AXES, error.position),
                    ("angle", "deg", _ANGLES, np.degrees(error.angle)),
                    ("velocity", "m/s", _AXES, error.velocity),
                )
                for (kind, unit, names, values), count in zip(groups, error.samples, strict=True):
                    for name, value in zip(names, values.tolist(), strict=True):
                        shown = value if np.isfinite(value) else None
                        name = f"{which}/{kind}_{name}"
                        rows.append({"name": name, "unit": unit, "value": shown, "samples": count})
        return {
            "samples": len(self.estimate.time),
            "seconds": float(self.estimate.time[-1]),
            "final_position": self.estimate.position[-1].tolist(),
            "final_yaw_deg": float(np.degrees(self.estimate.rpy[-1, 2])),
            "notes": list(self.notes),
            "rows": rows,
            "flags": {name: share for name, share in self.flag_shares().items() if share > 0.0},
        }

    def table(self) -> pd.DataFrame:
        """One row a sample: estimate, baseline, truth, centres of pressure and flags."""
        columns: dict[str, FloatArray] = {"time": self.estimate.time}
        for which, track in (("base", self.estimate), ("foot_centre", self.baseline), ("truth", self.truth)):
            if track is not None:
                columns |= {f"{which}/{axis}": track.position[:, i] for i, axis in enumerate(_AXES)}
                columns |= {f"{which}/{angle}": track.rpy[:, i] for i, angle in enumerate(_ANGLES)}
                columns |= {f"{which}/v{axis}": track.velocity[:, i] for i, axis in enumerate(_AXES)}
        for i, name in enumerate(self.contacts):
            columns |= {f"{name}/cop_{axis}": self.estimate.pressure[:, i, j] for j, axis in enumerate("xy")}
            columns |= {f"{name}/{flag}": self.estimate.contact_flags[:, i, j] for j, flag in enumerate(CONTACT_FLAGS)}
        columns |= {f"flag/{flag}": self.estimate.flags[:, j] for j, flag in enumerate(FLAGS)}
        return pd.DataFrame(columns)


def evaluate_log(
    rig: BaseRig, log: Path | str, progress: Callable[[str, float], None] = lambda text, share: None
) -> BaseResult:
    """Both estimates over a log, from the rig's start, else the truth's first sample, else the robot file's pose.

    Raises:
        LogError, ParamsError, RigError: input that cannot be used.
    """
    samples, truth, period = read_base_log(rig, log)
    pose = rig.robot.base_pose
    position, yaw = np.array(pose.xyz), pose.rpy[2]
    if rig.start is not None:
        position, yaw = rig.start
    elif truth is not None:
        position = truth.position[0] if np.isfinite(truth.position[0]).all() else position
        yaw = float(truth.rpy[0, 2]) if np.isfinite(truth.rpy[0, 2]) else yaw
    tracks = [
        run_log(estimator, samples, position, yaw, lambda share, name=name: progress(name, share))  # type: ignore[misc]
        for name, estimator in _estimators(rig, period).items()
    ]
    names = tuple(contact.mount.name for contact in rig.contacts)
    return BaseResult(tracks[0], tracks[1], truth, names, timing_notes(samples.time))


def _estimators(rig: BaseRig, period: float) -> dict[str, CopEstimator | FootCentreEstimator]:
    """The estimator and its baseline, by name.

    Raises:
        RigError: contacts that do not fit the robot; names the rig file.
    """
    spec = rig.spec(period)
    try:
        return {
            "centre of pressure": CopEstimator(rig.robot, spec),
            "foot centre": FootCentreEstimator(rig.robot, spec),
        }
    except ParamsError as error:
        raise RigError(f"{rig.source}: {error}") from None
