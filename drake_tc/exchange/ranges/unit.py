"""The distribution of one parameter, normal or lognormal and cut off at its limits, and the spread between fits.

What the files of one diagnosis say of each parameter: its estimate, its limits, and what the logs could not show.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.special import ndtr, ndtri

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import load_model_file
from drake_tc.config.joint_units import JointUnits
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.check import plausible_range
from drake_tc.effects.context import Parameter
from drake_tc.effects.library import effect
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

CRITICAL = float(ndtri(0.975))
NEAR_ZERO = 4.0
"""A positive parameter within this many standard deviations of 0 is lognormal: a normal one would be cut off there."""

Law = Literal["normal", "lognormal"]


@dataclass(frozen=True)
class Distribution:
    """A parameter x = value + deviation z, or x = value exp(s z) with s^2 = log(1 + (deviation/value)^2); z ~ N(0, 1).

    What lies outside of [lower, upper] is cut off, not moved to the limit.

    Attributes:
        law: Which of the two.
        value: Median before the cut.
        deviation: Standard deviation, in the unit of the value; 0: the value alone.
        lower: Physical limit, inclusive.
        upper: The same.
    """

    law: Law
    value: float
    deviation: float
    lower: float = -np.inf
    upper: float = np.inf

    @property
    def scale(self) -> float:
        """The s of a lognormal parameter."""
        return float(np.sqrt(np.log1p((self.deviation / self.value) ** 2)))

    def quantile(self, share: FloatArray) -> FloatArray:
        """Values below which these shares of the distribution lie, of the same shape."""
        if self.deviation == 0.0:
            return np.full_like(share, self.value)
        ends = np.array([self.lower, self.upper])
        if self.law == "lognormal":
            with np.errstate(divide="ignore"):
                low, high = ndtr(np.log(np.maximum(ends, 0.0) / self.value) / self.scale)
            found = self.value * np.exp(self.scale * ndtri(low + share * (high - low)))
        else:
            low, high = ndtr((ends - self.value) / self.deviation)
            found = self.value + self.deviation * ndtri(low + share * (high - low))
        return np.asarray(np.clip(found, *ends))

    @property
    def interval(self) -> tuple[float, float]:
        """Its central 95 %."""
        low, high = self.quantile(np.array([0.025, 0.975]))
        return float(low), float(high)


def distribution(value: float, deviation: float, lower: float = -np.inf, upper: float = np.inf) -> Distribution:
    """The distribution of a parameter: lognormal where it is positive and its deviation reaches 0, otherwise normal.

    Args:
        value: Best estimate; one outside of the limits is moved to the limit.
        deviation: Standard deviation.
        lower: Physical limit.
        upper: The same.
    """
    value = float(np.clip(value, lower, upper))
    lognormal = lower >= 0.0 and 0.0 < value < NEAR_ZERO * deviation
    return Distribution("lognormal" if lognormal else "normal", value, float(deviation), lower, upper)


def deviation_of(value: float, ci95: tuple[float, float]) -> float:
    """Standard deviation of an estimate with this 95 % interval; the end that a limit has not cut off counts."""
    return max(ci95[1] - value, value - ci95[0], 0.0) / CRITICAL


def spread_between(values: Sequence[float], deviations: Sequence[float]) -> float:
    """Standard deviation tau between fits of which each has its own deviation (DerSimonian and Laird, 1986).

        Q = sum_k w_k (x_k - x)^2,   tau^2 = max(0, (Q - (K - 1))/(sum w_k - sum w_k^2/sum w_k)),   w_k = 1/s_k^2

    Args:
        values: (K,) x_k, at least two.
        deviations: (K,) s_k, positive.
    """
    x, w = np.asarray(values), 1.0 / np.asarray(deviations) ** 2
    mean = float(w @ x / w.sum())
    excess = float(w @ (x - mean) ** 2) - (x.size - 1)
    return float(np.sqrt(max(excess / float(w.sum() - (w @ w) / w.sum()), 0.0)))


def of_units(units: Sequence[Distribution]) -> Distribution:
    """What a further unit may have, from the distributions of this parameter in K units.

    With weights w_k = 1/(s_k^2 + tau^2) its value is sum w_k x_k/sum w_k, its variance tau^2 + 1/sum w_k.
    """
    first = units[0]
    if len(units) == 1:
        return first
    x = np.array([each.value for each in units])
    s = np.maximum([each.deviation for each in units], 1e-12 * max(float(np.max(np.abs(x))), 1e-300))
    tau = spread_between(x.tolist(), s.tolist())
    w = 1.0 / (s**2 + tau**2)
    deviation = float(np.sqrt(tau**2 + 1.0 / w.sum()))
    return distribution(float(w @ x / w.sum()), deviation, first.lower, first.upper)


GAIN = ("drive", "gain")
SAYS_NOTHING = 0.95
"""An interval that covers this share of the possible range says nothing of the parameter."""
NOT_SHOWN = ("not_recorded", "not_excited", "untested", "cannot_be_looked_for")
"""Reasons in report.json for which an effect was not looked for in the logs."""
DOUBTS = {
    "unexplained_structure": "the model does not describe all of the residual, and its intervals do not contain that",
    "unexplained_residual": "more is left than noise explains, and the intervals do not contain that",
    "cannot_tell": "the logs could not have shown a missing effect of a tenth of the effort",
}
"""Verdict to what it means for the intervals."""
Key = tuple[str, str]


@dataclass(frozen=True)
class NotShown:
    """A parameter of which the logs say nothing, or an effect that was not found.

    Attributes:
        joint, effect, parameter, unit: Which.
        lower, upper: What it may be: the range of the prior, or up to the size that the logs would have shown.
        why: One clause; "" for an effect that was looked for.
        found_above: Whether the logs would have shown a larger one.
    """

    joint: str
    effect: str
    parameter: str
    unit: str
    lower: float
    upper: float
    why: str
    found_above: bool = False


@dataclass(frozen=True)
class Estimated:
    """A parameter with its distribution.

    Attributes:
        joint, effect, parameter, unit: Which; ("drive", "gain") is the drive gain K [effort/(N m)].
        distribution: Of its value.
        parts: Standard deviations by what they come from: "interval", "refinement", "units".
    """

    joint: str
    effect: str
    parameter: str
    unit: str
    distribution: Distribution
    parts: Mapping[str, float]

    @property
    def key(self) -> Key:
        """Effect and parameter."""
        return self.effect, self.parameter


@dataclass(frozen=True)
class Unit:
    """One diagnosed unit of a robot.

    Attributes:
        models: By joint.
        estimated: By joint, in the order of the model file, the drive gain first.
        not_shown: Of all joints.
        correlation: By joint, of the parameters `estimated` (p, p), where the report has it.
        notes: Sentences on what the files do not have.
    """

    models: Mapping[str, ActuatorModel]
    estimated: Mapping[str, tuple[Estimated, ...]]
    not_shown: tuple[NotShown, ...] = ()
    correlation: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_unit(model: Path, report: Path | None = None) -> Unit:
    """The parameters of a model file with what report.json and check.json of the same folder say of them.

    Args:
        model: Model file of close-loop or identify.
        report: report.json of close-loop; None: that of the model's folder, if there is one.

    Raises:
        ParamsError: a file that cannot be read, that is no report, or that has no parameter with an interval.
    """
    models = dict(load_model_file(model).models)
    beside = model.parent / "report.json"
    source = report if report is not None else beside if beside.is_file() else None
    document = {"joints": {}} if source is None else _document(source, "report.json of close-loop")
    told = document["joints"]
    check = (model if source is None else source).parent / "check.json"
    checked = _document(check, "check.json of close-loop or check")["joints"] if check.is_file() else {}
    if source is not None and (missing := sorted(set(models) - set(told))):
        raise ParamsError(f"{source}: no joint {missing[0]!r} of {model}; joints: {', '.join(told)}")
    estimated, not_shown, correlation, notes = {}, [], {}, []
    for joint, each in models.items():
        reader = _Joint(each, told.get(joint, {}), checked.get(joint, {}))
        try:
            estimated[joint], held = reader.parameters()
            not_shown += [*held, *reader.other_effects()]
            known = reader.correlation(estimated[joint])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ParamsError(
                f"{source}: joint {joint!r}: expected the entries that close-loop writes, got {error!r}; run close-loop"
                " (and check) again"
            ) from error
        if known is not None:
            correlation[joint] = known
    if not any(estimated.values()):
        raise ParamsError(
            f"{model}: no parameter has a 95 % interval; expected a model of close-loop or identify, with its"
            " report.json beside it or as --report"
        )
    if source is None:
        notes.append(
            f"There is no report.json beside {model.name}: the drive gain has no interval, and what the logs could not"
            " show is not known. Name the report with --report."
        )
    elif not checked:
        notes.append(
            "There is no check.json beside the report: how large an effect that was not found may be is not known."
            " `close-loop --check` writes it."
        )
    return Unit(models, estimated, tuple(not_shown), correlation, (*_doubts(document), *notes))


def _document(path: Path, what: str) -> dict[str, Any]:
    """A JSON file with an entry `joints`."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParamsError(f"{path}: expected {what}, which cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise ParamsError(f"{path}: expected {what}, got a file that is not JSON") from error
    joints = document.get("joints") if isinstance(document, dict) else None
    if not isinstance(joints, dict) or not all(isinstance(each, dict) for each in joints.values()):
        raise ParamsError(f"{path}: expected {what}, which has an entry `joints`, got another document")
    return dict(document)


def _doubts(document: Mapping[str, Any]) -> list[str]:
    """Sentences on what a report says that its intervals do not contain."""
    lines = []
    verdict = document.get("verdict")
    if verdict in DOUBTS:
        lines.append(f"The verdict is {verdict}: {DOUBTS[verdict]}.")
    for joint, each in document["joints"].items():
        for one, two in each.get("indistinguishable", ()):
            lines.append(
                f"{joint}: the logs cannot distinguish {one} from {two}; the ranges are those of the model that has one"
                " of them."
            )
    return lines


def _ends(interval: Any) -> tuple[float, float]:
    """[low, high] of a file, with null for an end that is not finite."""
    low, high = interval
    return (-math.inf if low is None else float(low)), (math.inf if high is None else float(high))


@dataclass(frozen=True)
class _Joint:
    model: ActuatorModel
    report: Mapping[str, Any]
    check: Mapping[str, Any]

    @property
    def units(self) -> JointUnits:
        return JointUnits(self.model.joint_type, self.model.drive.kind)

    def parameters(self) -> tuple[tuple[Estimated, ...], list[NotShown]]:
        found: list[Estimated] = []
        held: list[NotShown] = []
        for key, value, own, parameter in self._values():
            unit = self.units.gain if parameter is None else self.units.of(parameter.unit)
            lower, upper = self._limits(key, parameter)
            interval, parts = self._interval(key, value, own)
            why = _says_nothing(interval, lower, upper)
            if key == GAIN and self.report.get("gain_identified") is False:
                why = "the logs do not tell the drive gain from the other parameters"
            if why:
                held.append(NotShown(self.model.joint, *key, unit, lower, upper, why))
                continue
            of = distribution(value, math.hypot(*parts.values()), lower, upper)
            found.append(Estimated(self.model.joint, *key, unit, of, parts))
        return tuple(found), held

    def _values(self) -> list[tuple[Key, float, tuple[float, float] | None, Parameter | None]]:
        """Key, value, interval in the model file and library entry of each parameter; the gain has none of the last."""
        out: list[tuple[Key, float, tuple[float, float] | None, Parameter | None]] = [
            (GAIN, self.model.drive.gain, None, None)
        ]
        for each in self.model.effects:
            for p in each.effect.parameters:
                out.append(((each.key, p.name), each.parameters[p.name], each.ci95.get(p.name), p))
        return out

    def _interval(
        self, key: Key, value: float, own: tuple[float, float] | None
    ) -> tuple[tuple[float, float] | None, dict[str, float]]:
        """The 95 % interval about the estimate it belongs to, and standard deviations by their source."""
        if own is not None:
            return own, {"interval": deviation_of(value, own)}
        told = self.report.get("parameters", {}).get(key[0], {}).get(key[1])
        if told is None or told.get("value") is None:
            return None, {}
        interval, estimate = _ends(told["ci95"]), float(told["value"])
        parts = {"interval": deviation_of(estimate, interval)}
        if abs(value - estimate) > 1e-9 * max(abs(estimate), 1e-300):
            parts["refinement"] = abs(value - estimate)
        return interval, parts

    def _limits(self, key: Key, parameter: Parameter | None) -> tuple[float, float]:
        """Physical limits: those of the report, or of the library where it has none."""
        if parameter is None:
            return 0.0, math.inf
        told = self.report.get("plausible", {}).get(key[0], {}).get(key[1])
        low, high = _ends(told["range"]) if told is not None else self._prior(parameter)
        return max(low, parameter.lower), min(high, parameter.upper)

    def _prior(self, parameter: Parameter) -> tuple[float, float]:
        """What the library says of a parameter on this rig; infinite where it depends on what no file tells."""
        own = {"gain": self.model.drive.gain}
        own |= {key: each.parameters[key] for each in self.model.effects if (key := each.key) in ("viscous", "coulomb")}
        motion = self.check.get("motion") or {}
        effort, span = (float(motion.get(name) or math.inf) for name in ("effort", "span"))
        load = tuple(float(x) for x in motion.get("load") or (-math.inf, math.inf))
        context = Context(
            drive=self.model.drive.kind,
            load="torque",
            recorded=frozenset(),
            max_speed=float(motion.get("speed") or math.inf),
            position_span=(-0.5 * span, 0.5 * span),
            effort_span=(-effort, effort),
            torque_span=(load[0], load[1]),
            duration=float(motion.get("duration") or math.inf),
            fitted=own,
            joint_type=self.model.joint_type,
        )
        low, high = plausible_range(parameter, context)
        low = low if low < math.inf else -math.inf  # a multiple of what no file tells
        return max(low, parameter.lower), min(high, parameter.upper)

    def other_effects(self) -> list[NotShown]:
        """Effects that the logs could not show, and those that were not found, with the size that would have been."""
        out = []
        visible = {each["key"]: each for each in self.check.get("effects", ()) if each.get("size")}
        for entry in self.report.get("rejected", ()):
            key, of = entry["key"], effect(entry["key"])
            if entry["reason"] in NOT_SHOWN:
                for p in of.parameters:
                    low, high = self._prior(p)
                    out.append(NotShown(self.model.joint, key, p.name, self.units.of(p.unit), low, high, entry["why"]))
            elif key in visible and visible[key]["status"] in ("seen", "weakly"):
                out += self._not_found(of, visible[key]["size"])
        return out

    def _not_found(self, of: Effect, size: Mapping[str, Any]) -> list[NotShown]:
        """The range of an effect that these logs could have shown from its smallest visible size on."""
        parameter = next((p for p in of.parameters if p.name == size["name"]), None)
        if size["smallest"] is None:
            return []
        smallest = float(size["smallest"])
        low, high = (-smallest if parameter is not None and parameter.lower < 0.0 else 0.0), smallest
        if of.id == "saturation" and parameter is not None:  # a smaller limit is a stronger effect
            low, high = smallest, parameter.upper
        return [NotShown(self.model.joint, of.key, size["name"], size["unit"], low, high, "", found_above=True)]

    def correlation(self, estimated: tuple[Estimated, ...]) -> FloatArray | None:
        """(p, p) of the report, in the order of the parameters; None where it has none.

        What the refinement adds is independent.
        """
        told = self.report.get("correlation")
        if told is None:
            return None
        names = list(told["names"])
        full = np.asarray(told["matrix"], dtype=float)
        if full.shape != (len(names), len(names)):
            raise ParamsError(
                f"report.json: {self.model.joint}.correlation: expected a matrix of {len(names)} rows and columns, one"
                f" for each name, got the shape {full.shape}"
            )
        out = np.eye(len(estimated))
        share = [each.parts["interval"] / max(math.hypot(*each.parts.values()), 1e-300) for each in estimated]
        for i, a in enumerate(estimated):
            for j, b in enumerate(estimated[:i]):
                one, two = (".".join(each.key) for each in (a, b))
                if one in names and two in names:
                    out[i, j] = out[j, i] = full[names.index(one), names.index(two)] * share[i] * share[j]
        return out


def _says_nothing(interval: tuple[float, float] | None, lower: float, upper: float) -> str:
    """Why a parameter counts as not shown; "" where its interval says something."""
    if interval is None:
        return "it has no interval: it is declared, or held in the fit"
    if not all(map(math.isfinite, interval)):
        return "the logs do not tell it from the other parameters"
    if math.isfinite(upper - lower) and interval[1] - interval[0] >= SAYS_NOTHING * (upper - lower) > 0.0:
        return "its interval is as wide as what is possible"
    return ""
