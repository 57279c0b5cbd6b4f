"""`compare`: what changed since a model was made, by the diagnosis of new logs with the model as the declared one.

The effects of the stored model are declared, their sizes left open, and `close_loop` diagnoses the new logs. Its
posterior of the declared parameters is compared with the stored one (`changes`); an effect that it finds beside them
has appeared; one whose size is more probably 0 than the stored one is gone.
"""

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.model_file import ModelFile, load_model_file
from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.model import JointModel
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.refinement import equation_residuals
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.models import REFERENCE, reference_of
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.diagnosis.run import Log, close_loop
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.split import with_needed
from drake_tc.effects.base import TorqueEffect
from drake_tc.errors import LogError, ParamsError
from drake_tc.logs.files.readers import LogTable, named_logs, read_table
from drake_tc.logs.rig import Rig, load_rig, parse_rig
from drake_tc.watch.changes import Known, of_temperature
from drake_tc.watch.parameters import ParameterChange, parameter_changes, pooled, sizes_of

EffectStatus = Literal["appeared", "present", "gone", "uncertain", "unlikely", "heat"]
Verdict = Literal["unchanged", "parameters_changed", "new_effect", "cannot_tell"]
SEVERITY: tuple[Verdict, ...] = ("new_effect", "parameters_changed", "cannot_tell", "unchanged")
"""The verdict of several joints is the first of these that one of them has."""
TESTS = 1.0 / 3.0
"""Share at the end of each log that tests what the rest of it chose, where no run is held out."""
GONE = 3.0
"""Log odds from which an effect is gone."""
MORE_LEFT = 2.0
"""Error over that of the stored model's own logs from which something changed that no effect explains."""
VISIBLE = {"gain": 0.2, "friction": 0.3}
"""Half width of the interval of a change, over the value, beyond which the logs tell nothing of drive or friction."""


@dataclass(frozen=True)
class EffectChange:
    """One effect.

    Attributes:
        key, title: Of the effect. where: link or sensor, of a cause that no joint owns.
        status: "appeared", "present", "gone"; "uncertain" for one that the search found and whose size may be 0;
            "unlikely" for one that the new logs alone show, and that the stored numbers contradict or that explains
            no more than the fit leaves unexplained; or "heat" for an effect of the temperature, which is no change of
            the joint.
        log_odds: That it is there, for one that appeared or is present; that it is not, for one that is gone.
        parameters: Value and interval by name; those of the new logs.
    """

    key: str
    title: str
    status: EffectStatus
    log_odds: float
    parameters: Mapping[str, Known]
    where: str = ""


@dataclass(frozen=True)
class JointComparison:
    """One joint.

    Attributes:
        joint, verdict: Which, and what.
        why: Of `cannot_tell`, a sentence; else "".
        parameters, effects: What was compared.
        floors_then, floors_now: RMS error of all rows over the noise floor under the stored numbers, with the ages of
            the channels fitted again, and with the parameters fitted again and what appeared; NaN where it cannot be
            computed.
        temperature: (then, now), mean [°C]; NaN where it was not recorded.
        diagnosis: Of the new logs.
    """

    joint: str
    verdict: Verdict
    why: str
    parameters: tuple[ParameterChange, ...]
    effects: tuple[EffectChange, ...]
    floors_then: float
    floors_now: float
    temperature: tuple[float, float]
    diagnosis: JointResult


@dataclass(frozen=True, repr=False)
class ComparisonResult:
    """What changed since a model was made. Its `repr` is the verdict and a table of each joint."""

    verdict: Verdict
    joints: Mapping[str, JointComparison]
    shared: tuple[EffectChange, ...]
    model_file: str
    rig_file: str
    logs: tuple[str, ...]
    seconds: float
    diagnosis: CloseLoopResult

    def __getitem__(self, joint: str) -> JointComparison:
        """One joint; a KeyError names those that there are."""
        if joint not in self.joints:
            raise ParamsError(f"no joint {joint!r}; joints here: {', '.join(self.joints)}")
        return self.joints[joint]

    def __repr__(self) -> str:
        from importlib import import_module

        return str(import_module("drake_tc.report.comparison").comparison_text(self))

    def _repr_html_(self) -> str:
        from importlib import import_module

        return str(import_module("drake_tc.report.comparison").comparison_html(self))


def compare(
    model: Path | str,
    logs: Sequence[Log],
    rig: Rig | Mapping[str, Any] | Path | str | None = None,
    holdout: Sequence[Log] = (),
    options: DiagnosisOptions | None = None,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> ComparisonResult:
    """What changed between a stored model and new logs of the same joints.

    Args:
        model: `model_after.yaml`, or another model file with intervals.
        logs: New runs.
        rig: Rig file, or a mapping with the keys of one, or a `Rig`; None: the one that the model file names, from the
            file's folder or from the working directory.
        holdout: Runs that only test what the others chose. Without any, the last third of each log does.
        options: Of the diagnosis.
        progress: Told how far it is.
        executor: Runs parts of the diagnosis beside each other; None runs them here.

    Raises:
        ParamsError, RigError, LogError, IdentificationError: input that cannot be used.

    Example:
        >>> from drake_tc.cli.close_loop_command import write_results
        >>> from drake_tc.diagnosis.options import DiagnosisOptions
        >>> rig, out = leg_rig_file(), leg_log().parent / "out"
        >>> options = DiagnosisOptions(effects=(effect("stribeck"),))
        >>> found = write_results(close_loop(rig, [leg_log()], [leg_log(seed=1)], options), out)
        >>> compare(out / "model_after.yaml", [leg_log(seed=2)], rig, options=options).verdict
        'unchanged'
    """
    start = time.perf_counter()
    stored = load_model_file(model)
    known = _rig_of(rig, stored, Path(model))
    missing = [joint for joint in known.joints if joint not in stored.models]
    if missing:
        raise ParamsError(f"{model}: no model of joint {missing[0]!r}; joints there: {', '.join(stored.models)}")
    declared = with_model(known, stored)
    fitted, tests = _parts(logs, holdout, known)
    found = close_loop(declared, fitted, tests, options, None, progress, executor)
    joints = {name: _joint(found, name, stored, declared) for name in known.joints}
    shared = tuple(_shared(cause, stored) for cause in found.shared)
    verdicts = {each.verdict for each in joints.values()}
    if any(each.status == "appeared" for each in shared):
        verdicts.add("new_effect")
    return ComparisonResult(
        verdict=next(v for v in SEVERITY if v in verdicts),
        joints=joints,
        shared=shared,
        model_file=str(model),
        rig_file=str(known.source or "rig"),
        logs=tuple(str(log) for log in named_logs(logs, "log")),
        seconds=time.perf_counter() - start,
        diagnosis=found,
    )


def _rig_of(rig: object, stored: ModelFile, model: Path) -> Rig:
    if isinstance(rig, Rig):
        return rig
    if isinstance(rig, Mapping):
        return parse_rig(rig)
    if isinstance(rig, Path | str):
        return load_rig(rig)
    name = str(stored.provenance.get("rig", ""))
    for place in (model.parent / name, Path(name)):
        if name and place.is_file():
            return load_rig(place)
    named = f"the rig file {name}, and {model.parent / name} is not there" if name else "no rig file"
    raise ParamsError(f"{model}: its provenance names {named}; give the rig file of the new logs (--rig RIG.yaml)")


def with_model(rig: Rig, stored: ModelFile) -> Rig:
    """The rig with the effects of the stored models declared; their sizes are open, and what the rig says stays.

    Drives and transmissions start at their stored numbers, which the fit then moves.
    """
    declared = {}
    for joint in rig.joints:
        own = dict(rig.declared[joint])
        for value in stored.models[joint].effects:
            if any(key == value.key or key.startswith(f"{value.key}.") for key in own):
                continue
            if isinstance(value.effect, TorqueEffect) or value.effect.kind == "sensor":
                own[value.key] = None
            else:
                own |= {f"{value.key}.{name}": number for name, number in value.parameters.items()}
        declared[joint] = own
    return replace(rig, declared=declared)


def _parts(logs: Sequence[Log], holdout: Sequence[Log], rig: Rig) -> tuple[Sequence[Log], Sequence[Log]]:
    """Logs to fit and logs to test."""
    own = named_logs(logs, "log")
    if not own:
        raise LogError("expected at least one new log, got none")
    if holdout:
        return logs, holdout
    if rig.tares:
        raise LogError("the rig file has `tares`, which hold for whole runs; hold out a whole run (--holdout RUN)")
    tables = [LogTable(str(log), read_table(log)) for log in own]
    cuts = [round((1.0 - TESTS) * len(each.table)) for each in tables]
    fit = [LogTable(each.name, each.table.iloc[:cut]) for each, cut in zip(tables, cuts, strict=True)]
    test = [LogTable(f"{t.name} (end)", t.table.iloc[cut:]) for t, cut in zip(tables, cuts, strict=True)]
    return cast(Sequence[Log], fit), cast(Sequence[Log], test)


def _joint(found: CloseLoopResult, name: str, stored: ModelFile, rig: Rig) -> JointComparison:
    joint, model = found.joints[name], stored.models[name]
    reference = _reference(stored, name)
    temperature = (_mean_temperature(reference), _mean_temperature(reference_of(joint, final=True)))
    parameters, odds = parameter_changes(joint, model, rig, temperature, reference)
    effects = (*_gone(joint, model, parameters), *_appeared(joint, odds))
    floor = max(joint.noise_floor, 1e-300)
    then, now = _error_then(joint, model, rig), pooled(joint, (joint.after.train, joint.after.heldout))
    comparison = JointComparison(
        name, "unchanged", "", parameters, effects, then / floor, now / floor, temperature, joint
    )
    verdict, why = _verdict(comparison, stored.provenance.get("error", {}).get(name))
    return replace(comparison, verdict=verdict, why=why)


def _reference(stored: ModelFile, joint: str) -> Mapping[str, Any]:
    found = stored.provenance.get(REFERENCE, {})
    return found.get(joint, {}) if isinstance(found, Mapping) else {}


def _mean_temperature(reference: Mapping[str, Any]) -> float:
    return float(reference.get("temperature", (math.nan,) * 3)[1])


def _gone(joint: JointResult, model: ActuatorModel, parameters: Sequence[ParameterChange]) -> tuple[EffectChange, ...]:
    """Effects of the stored model beside viscous and Coulomb friction, present or gone.

    The size x of one that is gone is 0, that of one that is present the stored one:
        log odds = log N(x_1; 0, s_1^2) - log N(x_1; x_0, s_0^2 + s_1^2)
    """
    out = []
    for value in model.effects:
        own = {p.name: p for p in parameters if p.key == value.key}
        sizes = sizes_of(value.key, own)
        if value.key in ("viscous", "coulomb", "rotor_inertia") or not sizes:
            continue
        odds = sum(_log_odds_gone(own[name]) for _, name in sizes)
        status: Literal["gone", "present"] = "gone" if odds > GONE else "present"
        now = {name: p.fitted for name, p in own.items()}
        out.append(EffectChange(value.key, value.effect.title, status, abs(odds), now))
    return tuple(out)


def _log_odds_gone(p: ParameterChange) -> float:
    now = max(p.fitted.deviation, 1e-12 * abs(p.then.value))
    both = math.hypot(now, p.then.deviation)
    absent = -0.5 * (p.fitted.value / now) ** 2 - math.log(now)
    return absent + 0.5 * ((p.fitted.value - p.then.value) / both) ** 2 + math.log(both)


def _appeared(joint: JointResult, odds: Mapping[str, float]) -> tuple[EffectChange, ...]:
    """Effects of the new logs that the model lacks, with the log odds of each given the stored numbers."""
    out = []
    for found in joint.effects:
        known = {name: Known.of(e.value, e.ci95) for name, e in found.parameters.items()}
        sizes = [known[name] for _, name in sizes_of(found.key, known)] or [*known.values()]
        sure = any(not k.ci95[0] <= 0.0 <= k.ci95[1] for k in sizes)
        told = min(_logit(found.stability), odds.get(found.key, math.inf))
        status: EffectStatus = "unlikely" if told < 0.0 else "appeared" if sure else "uncertain"
        if of_temperature(found.key):
            status = "heat"
        out.append(EffectChange(found.key, found.title, status, told, known))
    return tuple(out)


def _logit(probability: float) -> float:
    return math.log(max(probability, 1e-16) / max(1.0 - probability, 1e-16))


def _shared(cause: SharedEffect, stored: ModelFile) -> EffectChange:
    known = any(entry.get("effect") == cause.id and entry.get("where") == cause.where for entry in stored.shared)
    named = {name: Known.of(e.value, e.ci95) for name, e in cause.parameters.items()}
    status: Literal["present", "appeared"] = "present" if known else "appeared"
    return EffectChange(cause.id, cause.title, status, _logit(cause.stability), named, cause.where)


def _error_then(joint: JointResult, model: ActuatorModel, rig: Rig) -> float:
    """RMS error of all rows under the stored numbers [effort]; NaN where no coefficients have them, or the fit no gain.

    The ages of the channels a are those of the new logs: of the residual r of the stored numbers, the part A a is taken
    off, with a ~ N(0, S) by the prior of each age and the noise floor s: a = (A'A + s^2 S^-1)^-1 A'r.
    """
    named = {value.key: dict(value.parameters) for value in model.effects} | {"drive": {"gain": model.drive.gain}}
    groups, fitted = joint.baseline_parameters, joint.baseline
    known = all(name in named.get(key, {}) for key in groups for name in groups[key])
    if not known or fitted.gain == 0.0:  # the effort follows nothing that the effects of the stored model explain
        return math.nan
    wanted = {key: {name: named[key][name] for name in groups[key]} for key in groups}
    sides = (replace(joint.train, after=joint.train.before), replace(joint.heldout, after=joint.heldout.before))
    found = equation_residuals(fitted, wanted, sides)
    if found is None:
        return math.nan
    context = context_of(joint.train.samples, rig, joint.joint)
    measured = context.load == "torque"
    splits = [with_needed(Columns(side.samples), fitted.terms, fitted.beta, measured=measured) for side in sides]
    coulomb, viscous = (wanted.get(key, {}).get(key, 0.0) for key in ("coulomb", "viscous"))
    prior = JointModel(splits[0], splits[1], fitted.terms, context, None, fitted.gain, coulomb, viscous)
    ages = np.concatenate([split.age_columns(prior.ages, viscous) for split in splits])
    deviation = np.array([deviation for _, deviation in prior.ages.values()])
    columns, residual = ages * deviation, np.concatenate(found)
    weight = max(joint.noise_floor, 1e-300) ** 2 * np.eye(deviation.size)
    size = np.linalg.solve(columns.T @ columns + weight, columns.T @ residual)
    return rms(residual - columns @ size)


def _verdict(joint: JointComparison, error: object) -> tuple[Verdict, str]:
    if joint.diagnosis.set_up_wrong:
        return "cannot_tell", "the logs contradict the rig file or the robot file"
    if any(each.status == "appeared" for each in joint.effects):
        return "new_effect", ""
    if any(each.status == "uncertain" for each in joint.effects):
        return (
            "cannot_tell",
            "the search found an effect whose size may be 0, and the changes depend on whether it is there",
        )
    if any(p.changed for p in joint.parameters) or any(each.status == "gone" for each in joint.effects):
        return "parameters_changed", ""
    before = float(error.get("heldout", math.nan)) if isinstance(error, Mapping) else math.nan
    left = joint.floors_now * joint.diagnosis.noise_floor
    if joint.floors_now > MORE_LEFT and left > MORE_LEFT * before:
        return "cannot_tell", "more is left than on the model's own logs, and no effect or parameter explains it"
    if joint.diagnosis.verdict == "cannot_tell":
        return "cannot_tell", "these logs could not have shown an effect of a tenth of the effort"
    wide = [what for what, share in _uncertain(joint).items() if not share < VISIBLE[what]]
    if wide:
        limits = " or ".join(f"{100.0 * VISIBLE[what]:.0f} % in the {what}" for what in wide)
        return "cannot_tell", f"these logs could not have shown a change of {limits}"
    return "unchanged", ""


def _uncertain(joint: JointComparison) -> dict[str, float]:
    """Half widths of the intervals of a change over the value: of the drive gain, and of friction at the RMS speed."""
    known = {p.name: p for p in joint.parameters if p.key in ("drive", "viscous", "coulomb")}
    samples = joint.diagnosis.train.samples
    speed = float(np.sqrt(np.mean(samples.signals.velocity[samples.rows] ** 2)))
    friction = [(known[n], s) for n, s in (("coulomb", 1.0), ("viscous", speed)) if n in known]
    size = sum(abs(p.then.value) * s for p, s in friction)
    half = 1.96 * math.hypot(*(p.change.deviation * s for p, s in friction))
    gain = known.get("gain")
    return {
        "gain": math.inf if gain is None else 1.96 * gain.change.deviation / abs(gain.then.value),
        "friction": half / size if size > 0.0 else 0.0,
    }
