"""The history of a joint: one record a session, the trend of each parameter, and the spread between units.

A folder has one JSON file a session, `SERIAL_TIME.json`. With values y_i of a parameter at times t_i, deviations s_i,

    y_i = a + b t_i + e_i,    e_i ~ N(0, s_i^2 + r^2),

r is what sessions differ by beyond their own intervals. It is where the weighted residuals are as large as their number
allows (Paule and Mandel, 1982); intervals are those of Student's distribution with n - 2 degrees of freedom, scaled by
the weighted residuals (Knapp and Hartung, 2003). Beyond the sessions a trend goes on with the interval of the line.
"""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import ModelFile, load_model_file
from drake_tc.config.files import path_from, utf8_name, write_whole
from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.result.models import REFERENCE, reference_of
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray
from drake_tc.watch.changes import Known
from drake_tc.watch.compare import ComparisonResult, JointComparison

DAY_S = 86400.0
FEWEST = 3
"""Sessions of a trend: two points have a line and no interval."""


@dataclass(frozen=True)
class Session:
    """One record of a history.

    Attributes:
        serial: Serial number of the unit.
        time: When it was recorded.
        verdicts, temperatures: By joint; the temperature [°C] is NaN where it was not recorded.
        parameters, units: By joint and "effect.parameter".
    """

    serial: str
    time: datetime
    verdicts: Mapping[str, str]
    temperatures: Mapping[str, float]
    parameters: Mapping[str, Mapping[str, Known]]
    units: Mapping[str, Mapping[str, str]]


@dataclass(frozen=True)
class Trend:
    """A line through a parameter's values.

    Attributes:
        days: (n,) times since the first session [days]. values, deviations: (n,).
        origin: Mean time [days], at which the line's value and slope are independent.
        level, slope: There, and for a day.
        covariance: (2,) variances of both.
        spread: r. freedom: n - 2.
    """

    days: FloatArray
    values: FloatArray
    deviations: FloatArray
    origin: float
    level: float
    slope: float
    covariance: tuple[float, float]
    spread: float
    freedom: int

    @property
    def slope_ci95(self) -> tuple[float, float]:
        """95 % interval of the slope, for a day."""
        half = float(student.ppf(0.975, self.freedom)) * math.sqrt(self.covariance[1])
        return self.slope - half, self.slope + half

    @property
    def drifts(self) -> bool:
        """Whether the interval of the slope excludes 0."""
        low, high = self.slope_ci95
        return low > 0.0 or high < 0.0

    def at(self, days: float) -> tuple[float, float, float]:
        """Value of the line and the ends of its 95 % interval at a time since the first session [days]."""
        since = days - self.origin
        value = self.level + self.slope * since
        deviation = math.sqrt(self.covariance[0] + since**2 * self.covariance[1])
        half = float(student.ppf(0.975, self.freedom)) * deviation
        return value, value - half, value + half


def trend_of(days: FloatArray, values: Sequence[Known]) -> Trend | None:
    """The trend of a parameter; None for fewer than three sessions or none that differ in time."""
    t, y = np.asarray(days, dtype=float), np.array([v.value for v in values])
    s = np.array([v.deviation for v in values])
    if t.size < FEWEST or np.ptp(t) == 0.0:
        return None
    s = np.maximum(s, 1e-9 * max(float(np.abs(y).max()), 1e-300))

    def excess(r: float) -> float:
        return _line(t, y, 1.0 / (s**2 + r**2))[0] - (t.size - 2)

    spread = _root_of(excess, 10.0 * (float(np.ptp(y)) + float(s.max())))
    weighted, origin, level, slope, variances = _line(t, y, 1.0 / (s**2 + spread**2))
    scale = weighted / (t.size - 2)
    return Trend(t, y, s, origin, level, slope, (scale * variances[0], scale * variances[1]), spread, t.size - 2)


def _line(t: FloatArray, y: FloatArray, w: FloatArray) -> tuple[float, float, float, float, tuple[float, float]]:
    """Weighted sum of squared residuals, origin, level, slope, and the variances of both."""
    origin, level = float(w @ t / w.sum()), float(w @ y / w.sum())
    moment = float(w @ (t - origin) ** 2)
    slope = float(w @ ((t - origin) * y)) / moment
    residual = y - level - slope * (t - origin)
    return float(w @ residual**2), origin, level, slope, (1.0 / float(w.sum()), 1.0 / moment)


def further_unit(units: Sequence[Known]) -> Known:
    """What one more unit may have, from the values of at least two units.

    With the spread r between units as that between sessions, w_k = 1/(s_k^2 + r^2), the value is the mean by these
    weights and the variance r^2 + 1/sum w_k.
    """
    y = np.array([u.value for u in units])
    s = np.maximum([u.deviation for u in units], 1e-9 * max(float(np.abs(y).max()), 1e-300))

    def weights(r: float) -> FloatArray:
        return np.asarray(1.0 / (s**2 + r**2))

    def excess(r: float) -> float:
        w = weights(r)
        return float(w @ (y - w @ y / w.sum()) ** 2) - (y.size - 1)

    spread = _root_of(excess, 10.0 * (float(np.ptp(y)) + float(s.max())))
    w = weights(spread)
    return Known(float(w @ y / w.sum()), math.sqrt(spread**2 + 1.0 / float(w.sum())))


def _root_of(excess: Callable[[float], float], largest: float) -> float:
    """The r in [0, largest] where the falling function is 0; 0 where it is negative everywhere."""
    return float(brentq(excess, 0.0, largest)) if excess(0.0) > 0.0 > excess(largest) else 0.0


def add_session(found: ComparisonResult, folder: Path, serial: str, time: datetime) -> Path:
    """Write the record of a session and the unit's model as of then; returns the record's path.

    The model, `SERIAL.yaml`, has the new values and intervals. The models of several units are the `--unit` files of
    `drake-tc export --ranges`, which writes the spread between them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    moment = time.astimezone(UTC)
    name = re.sub(r"[^\w.-]+", "-", serial) or "unit"
    record = json_value(
        {
            "schema": 1,
            "serial": serial,
            "time": moment.isoformat(timespec="seconds"),
            "model": found.model_file,
            "logs": list(found.logs),
            "joints": {joint.joint: _joint_record(joint) for joint in found.joints.values()},
        }
    )
    save_new_model(found, folder / f"{name}.yaml")
    path = folder / f"{name}_{moment:%Y%m%dT%H%M%S}.json"
    write_whole(path, json.dumps(record, indent=1) + "\n")
    return path


def _joint_record(joint: JointComparison) -> dict[str, Any]:
    return {
        "verdict": joint.verdict,
        "temperature": joint.temperature[1],
        "floors": {"then": joint.floors_then, "now": joint.floors_now},
        "parameters": {
            f"{p.key}.{p.name}": {"value": p.now.value, "ci95": list(p.now.ci95), "unit": p.unit}
            for p in joint.parameters
        },
        "effects": [{"id": e.key, "status": e.status, "log_odds": e.log_odds} for e in joint.effects],
    }


def read_history(folder: Path) -> list[Session]:
    """The sessions of a folder, in the order of their times.

    Raises:
        ParamsError: A JSON file of the folder that is no record.
    """
    out = []
    for path in sorted(folder.glob("*.json")):
        try:
            out.append(_session(json.loads(path.read_text(encoding="utf-8"))))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise ParamsError(f"{path}: expected a record of `drake-tc compare --history`, got {error!r}") from error
    return sorted(out, key=lambda session: (session.time, session.serial))


def _session(record: Mapping[str, Any]) -> Session:
    joints: Mapping[str, Mapping[str, Any]] = record["joints"]
    numbers = {joint: each["parameters"].items() for joint, each in joints.items()}
    return Session(
        serial=str(record["serial"]),
        time=datetime.fromisoformat(record["time"]),
        verdicts={joint: str(each["verdict"]) for joint, each in joints.items()},
        temperatures={j: math.nan if e["temperature"] is None else float(e["temperature"]) for j, e in joints.items()},
        parameters={j: {n: Known.of(float(p["value"]), p["ci95"]) for n, p in items} for j, items in numbers.items()},
        units={j: {n: str(p["unit"]) for n, p in items} for j, items in numbers.items()},
    )


def trends(sessions: Sequence[Session], serial: str, joint: str) -> dict[str, Trend]:
    """By "effect.parameter", the trends of one joint of one unit; days count from the first session of the history."""
    own = [s for s in sessions if s.serial == serial and joint in s.parameters]
    names = dict.fromkeys(name for s in own for name in s.parameters[joint])
    out = {}
    for name in names:
        having = [s for s in own if name in s.parameters[joint]]
        days = np.array([(s.time - sessions[0].time).total_seconds() / DAY_S for s in having])
        found = trend_of(days, [s.parameters[joint][name] for s in having])
        if found is not None:
            out[name] = found
    return out


def save_new_model(found: ComparisonResult, path: Path, home: Path | None = None) -> None:
    """Write the stored models with the new values and intervals, and with the effects that appeared.

    The file names the rig file by its path from `home`, the folder in which it is to stand; None: that of `path`.
    """
    stored = load_model_file(found.model_file)
    models = {name: _new_model(stored.models[name], joint) for name, joint in found.joints.items()}
    reference = {}
    for name, joint in found.joints.items():
        gain = next((p.now for p in joint.parameters if p.key == "drive"), None)
        reference[name] = reference_of(joint.diagnosis, final=True) | ({"gain_ci95": list(gain.ci95)} if gain else {})
    provenance = {
        "identified_by": "drake-tc compare",
        "rig": path_from(home or path.parent, found.rig_file),
        "logs": [utf8_name(log) for log in found.logs],
        REFERENCE: reference,
    }
    ModelFile(models, provenance, stored.shared).save(path)


def _new_model(model: ActuatorModel, joint: JointComparison) -> ActuatorModel:
    now = {(p.key, p.name): p.now for p in joint.parameters}
    effects = []
    for value in model.effects:
        bounds = {p.name: (p.lower, p.upper) for p in value.effect.parameters}
        own = {name: now[value.key, name] for name in value.parameters if (value.key, name) in now}
        numbers = {n: float(np.clip(own[n].value, *bounds[n])) if n in own else v for n, v in value.parameters.items()}
        effects.append(EffectValue(value.key, numbers, {**value.ci95, **{n: k.ci95 for n, k in own.items()}}))
    effects += [
        EffectValue(e.key, {n: k.value for n, k in e.parameters.items()}, {n: k.ci95 for n, k in e.parameters.items()})
        for e in joint.effects
        if e.status in ("appeared", "heat")
    ]
    gain = now.get(("drive", "gain"))
    drive = model.drive if gain is None else Drive(model.drive.kind, gain.value)
    return ActuatorModel(model.joint, drive, tuple(effects), model.joint_type)
