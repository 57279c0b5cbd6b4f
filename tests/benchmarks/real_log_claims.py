"""What `close-loop` claims of one case, read from its report, and whether the report's own figures support it.

Two checks. *Claims hold*: every effect that is named lowers the error of every single held-out run, when the model is
refitted without it; none of its parameters rests on a bound or is physically impossible; and no run's error is larger
after than before. *Verdict agrees*: `no_missing_effect` is only said
where the error after is at most `FLOORS` noise floors, on the training runs and on every held-out run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from drake_tc.config.quoted import json_value

FLOORS = 3.0
"""Largest ratio of error to noise floor at which nothing is missing."""

POSSIBLE: Mapping[tuple[str, str], tuple[float, float]] = {
    ("encoder_eccentricity", "eccentricity_sine"): (-0.1, 0.1),
    ("encoder_eccentricity", "eccentricity_cosine"): (-0.1, 0.1),
    ("encoder_ripple", "ripple_sine"): (-0.1, 0.1),
    ("encoder_ripple", "ripple_cosine"): (-0.1, 0.1),
    ("cable_spring", "spring_stiffness"): (0.0, float("inf")),
    ("delay", "delay"): (0.0, 0.1),
    ("elasticity", "compliance"): (0.0, 0.5),
}
"""Effect and parameter to what can exist [SI units of the parameter].

An encoder disc errs by its offset over its radius: 0.1 rad is a tenth of the radius. A passive spring has no negative
stiffness. No drive's bus is late by more than 0.1 s. A gear that yields more than 0.5 rad/(N m) is a series elastic
actuator. These limits are the benchmark's own, so that it does not repeat the diagnosis's bounds.
"""

Report = Mapping[str, Any]
"""A joint's or a whole call's part of report.json."""


@dataclass(frozen=True)
class RunFigures:
    """One run's error of the model equation [unit of the joint's effort]; NaN where not known.

    Attributes:
        name: Of the run.
        before, after: RMS without and with the effects that were found.
        in_band: RMS after, inside the band that the training runs choose (`diagnosis.residual.band`).
        band_hz: End of that band [Hz]: infinite where the band is that of the filters, 0 where there is none.
        floor: Noise floor of its own call, whose filters may differ from those of another call.
    """

    name: str
    before: float
    after: float
    in_band: float = float("nan")
    band_hz: float = float("nan")
    floor: float = float("nan")

    @property
    def ratio(self) -> float:
        """Error after over the noise floor."""
        return self.after / self.floor if self.floor > 0.0 else float("inf")

    def to_json(self) -> dict[str, Any]:
        """As `bench real-logs --json` prints it; a band without an end is null."""
        figures = (self.before, self.after, self.in_band, self.band_hz)
        names = ("before", "after", "in_band", "band_hz")
        return {"run": self.name, **{key: json_value(x) for key, x in zip(names, figures, strict=True)}}


@dataclass(frozen=True)
class JointClaims:
    """One joint of one case.

    Attributes:
        joint, unit: Name, and unit of all errors.
        floor: Noise floor.
        train: All training runs together.
        heldout: Each held-out run, under the model of the call in which it alone is held out.
        effects: Entries of report.json; did_not_hold: the same, where the report has them.
        unexplained: Entry of report.json.
        not_held: Why a claim does not hold, one sentence each.
        disagreements: Where the verdict contradicts the figures, one sentence each.
    """

    joint: str
    unit: str
    floor: float
    train: RunFigures
    heldout: tuple[RunFigures, ...]
    effects: tuple[Report, ...]
    did_not_hold: tuple[Report, ...]
    unexplained: Report
    not_held: tuple[str, ...]
    disagreements: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """As `bench real-logs --json` prints it."""
        runs = (self.train, *self.heldout)
        return {
            "joint": self.joint,
            "unit": self.unit,
            "noise_floor": json_value(self.floor),
            "runs": [run.to_json() | {"floors": json_value(run.ratio)} for run in runs],
            "effects": list(self.effects),
            "did_not_hold": list(self.did_not_hold),
            "unexplained": dict(self.unexplained),
            "claims_hold": not self.not_held,
            "not_held": list(self.not_held),
            "verdict_agrees": not self.disagreements,
            "disagreements": list(self.disagreements),
        }


@dataclass(frozen=True)
class CaseClaims:
    """One call of `close-loop`.

    Attributes:
        name: `<set>/<case>`.
        verdict: Of the report; "refused" where the input was refused, with the reason in `refusal`.
        joints: Its joints; seconds: of the call on all held-out runs.
        shared: Causes that no single joint owns, as in report.json.
        not_held: Why a shared cause does not hold.
    """

    name: str
    verdict: str
    joints: tuple[JointClaims, ...] = ()
    seconds: float = 0.0
    refusal: str = ""
    note: str = ""
    shared: tuple[Report, ...] = ()
    not_held: tuple[str, ...] = field(default=())

    @property
    def failures(self) -> tuple[str, ...]:
        """Every claim that does not hold."""
        return (*self.not_held, *(why for joint in self.joints for why in joint.not_held))

    @property
    def disagreements(self) -> tuple[str, ...]:
        """Every figure that contradicts the verdict."""
        return tuple(why for joint in self.joints for why in joint.disagreements)

    def to_json(self) -> dict[str, Any]:
        """As `bench real-logs --json` prints it."""
        return {
            "name": self.name,
            "verdict": self.verdict,
            "refusal": self.refusal,
            "note": self.note,
            "seconds": self.seconds,
            "joints": [joint.to_json() for joint in self.joints],
            "shared": list(self.shared),
            "claims_hold": not self.failures,
            "verdict_agrees": not self.disagreements,
        }


def _figure(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def _figures(name: str, joint: Report, part: str) -> RunFigures:
    before, after = (_figure(joint["error"][side][part]) for side in ("before", "after"))
    band, floor = joint.get("shared_band"), _figure(joint["noise_floor"])
    if band is None:
        return RunFigures(name, before, after, after, float("inf"), floor)
    return RunFigures(name, before, after, _figure(band[part]), _figure(band["limit_hz"]), floor)


def _at_bound(effect: Report) -> list[str]:
    return [name for name, entry in effect["parameters"].items() if entry["at_bound"]]


def _impossible(effect: Report) -> list[str]:
    out = []
    for name, entry in effect["parameters"].items():
        low, high = POSSIBLE.get((effect["id"], name), (float("-inf"), float("inf")))
        if entry["value"] is not None and not low <= entry["value"] <= high:
            out.append(f"{name} of {entry['value']:.3g} {entry['unit']} is not possible")
    return out


def _not_held(effects: tuple[Report, ...], by_run: Mapping[str, tuple[Report, ...]], where: str) -> list[str]:
    out = []
    for effect in effects:
        out += [f"{where}: {effect['id']}: {name} rests on a bound" for name in _at_bound(effect)]
        out += [f"{where}: {effect['id']}: {why}" for why in _impossible(effect)]
        for run, entries in by_run.items():
            gain = next((_figure(e["heldout_gain"]) for e in entries if e["id"] == effect["id"]), None)
            if gain is None:
                out.append(f"{where}: {effect['id']} is not named when {run} alone is held out")
            elif not gain > 0.0:
                out.append(f"{where}: {effect['id']}: held-out gain {100 * gain:.1f} % on {run}")
    return out


def _joint_claims(name: str, report: Report, by_run: Mapping[str, Report]) -> JointClaims:
    joint = report["joints"][name]
    effects = tuple(joint["effects"])
    train = _figures("training runs", joint, "train")
    parts = {run: r["joints"][name] for run, r in by_run.items() if name in r["joints"]}
    heldout = tuple(_figures(run, part, "heldout") for run, part in parts.items())
    floor = _figure(joint["noise_floor"])
    not_held = _not_held(effects, {run: tuple(p["effects"]) for run, p in parts.items()}, name)
    if effects:
        grown = [run for run in (train, *heldout) if run.after > run.before]
        not_held += [f"{name}: the error grew from {run.before:.3g} to {run.after:.3g} on {run.name}" for run in grown]
    disagreements = []
    if report["verdict"] == "no_missing_effect":
        evaluated = {run["run"]: _figure(run["after"]["rms"]) for run in joint.get("runs", ()) if run["heldout"]}
        for run, after in ({train.name: train.after} | evaluated).items():
            if not after <= FLOORS * floor:
                shown = f"{after / floor:.1f}" if floor > 0.0 else "infinitely many"
                disagreements.append(f"{name}: {shown} noise floors are left on {run}")
    return JointClaims(
        joint=name,
        unit=joint["error"]["unit"],
        floor=floor,
        train=train,
        heldout=heldout,
        effects=effects,
        did_not_hold=tuple(joint.get("did_not_hold", ())),
        unexplained=joint["unexplained"],
        not_held=tuple(not_held),
        disagreements=tuple(disagreements),
    )


def claims_of(name: str, report: Report, by_run: Mapping[str, Report], note: str = "") -> CaseClaims:
    """Check one report.

    Args:
        name: `<set>/<case>`.
        report: report.json of the call with all held-out runs.
        by_run: Name of a held-out run to the report of the same call with that run alone held out.
        note: What a reader must know of the case.
    """
    shared = tuple(report.get("shared", ()))
    shared_by_run = {run: tuple(r.get("shared", ())) for run, r in by_run.items()}
    return CaseClaims(
        name=name,
        verdict=str(report["verdict"]),
        joints=tuple(_joint_claims(joint, report, by_run) for joint in report["joints"]),
        seconds=float(report["seconds"]),
        note=note,
        shared=shared,
        not_held=tuple(_not_held(shared, shared_by_run, "shared")),
    )
