"""The model files before and after: `ActuatorModel`s of a result, loadable by every diagram."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import TORQUE_AS_EFFORT, ModelFile
from drake_tc.actuation.remainder import Remainder
from drake_tc.config.files import path_from, utf8_name
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.notes import TorqueAsEffort
from drake_tc.diagnosis.result.joint_result import Errors, JointResult
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect

MODEL_FILE = "model_refined.yaml"
"""File of the model that was refined on free runs."""
REFERENCE = "reference"
"""Entry of the provenance that a later comparison reads, see `reference_of`."""
LOADED = 0.2
"""Load torque over its RMS beyond which a gear lies against one flank."""


def model_of(joint: JointResult, *, final: bool) -> ActuatorModel:
    """The joint's model without or with the missing effects; what is declared and held is part of both."""
    parameters = joint.final_parameters if final else joint.baseline_parameters
    effects = []
    inertia = joint.train.samples.signals.rotor_inertia
    if inertia > 0.0 and "rotor_inertia" not in parameters:
        effects.append(EffectValue("rotor_inertia", {"rotor_inertia": inertia}))
    effects += [EffectValue(key, values) for key, values in joint.held.items() if key not in parameters]
    for key, group in parameters.items():
        if key == "drive":
            continue
        effects.append(
            EffectValue(
                key,
                {name: e.value for name, e in group.items()},
                {name: e.ci95 for name, e in group.items()},
                tuple(name for name, e in group.items() if e.at_bound),
            )
        )
    drive = Drive(joint.drive, parameters["drive"]["gain"].value)
    return ActuatorModel(joint.joint, drive, tuple(effects), joint.units.joint_type)


def models_of(result: CloseLoopResult, out: Path, home: Path | None = None) -> tuple[str, str]:
    """Write model_before.yaml and model_after.yaml into `out` and return their texts.

    The files name the rig file by its path from `home`, the folder in which they are to stand; None: `out`. Where the
    refinement on free runs of a joint was accepted, model_refined.yaml is written too: the model after, with the
    refined numbers of those joints and without their intervals.
    """
    texts = []
    for name, final in (("model_before.yaml", False), ("model_after.yaml", True)):
        models = {j.joint: model_of(j, final=final) for j in result.joints.values()}
        provenance = _provenance(result, home or out) | {
            "error": {j.joint: _error(j, j.after if final else j.before) for j in result.joints.values()},
            REFERENCE: {j.joint: reference_of(j, final=final) for j in result.joints.values()},
        }
        file = ModelFile(models, provenance)
        if final:
            file = replace(file, **_found(result), remainders=remainders_of(result))
        file.save(out / name)
        texts.append((out / name).read_text(encoding="utf-8"))
    _save_refined(result, out / MODEL_FILE, home or out)
    return texts[0], texts[1]


def remainders_of(result: CloseLoopResult) -> dict[str, Remainder]:
    """By joint, the smooth part of what is left, where it explains some of the error of the held-out runs for sure."""
    return {
        name: j.remainder.model for name, j in result.joints.items() if j.remainder is not None and j.remainder.holds
    }


def simulation_models(result: CloseLoopResult) -> tuple[str, dict[str, ActuatorModel]]:
    """The models that simulate best, by joint, and the name of their file.

    That is model_refined.yaml where the refinement of a joint was accepted, and model_after.yaml elsewhere.
    """
    models = {name: model_of(joint, final=True) for name, joint in result.joints.items()}
    refined = {n: j.refinement.model for n, j in result.joints.items() if j.refinement and j.refinement.model}
    return (MODEL_FILE if refined else "model_after.yaml"), models | refined


def _save_refined(result: CloseLoopResult, path: Path, home: Path) -> None:
    """Write the refined models, or remove those of an earlier call."""
    found = {name: j.refinement for name, j in result.joints.items() if j.refinement and j.refinement.model}
    if not found:
        path.unlink(missing_ok=True)
        return
    models = simulation_models(result)[1]
    free = {name: each.train for name, each in found.items() if each.train is not None}
    errors = {
        name: {
            "unit": result.joints[name].units.position,
            "after": float(f"{pair[0]:.4g}"),
            "refined": float(f"{pair[1]:.4g}"),
        }
        for name, pair in free.items()
    }
    provenance = _provenance(result, home) | {
        "refined": sorted(found),
        "mean_absolute_error_of_training_free_runs": errors,
    }
    ModelFile(models, provenance, **_found(result)).save(path)


def _found(result: CloseLoopResult) -> dict[str, Any]:
    """What was found beside the joints' own effects: shared causes and links, as a model file has them."""
    links = {} if result.links is None else links_entry(result.links)
    return {"shared": [shared_entry(cause) for cause in result.shared], "links": links}


def _provenance(result: CloseLoopResult, home: Path) -> dict[str, object]:
    unscaled = [j.joint for j in result.joints.values() if any(isinstance(n, TorqueAsEffort) for n in j.load_notes)]
    provenance: dict[str, object] = {
        "identified_by": "drake-tc close-loop",
        "rig": path_from(home, result.rig_file),
        "logs": [utf8_name(path) for path in result.train_files],
        "holdout": [utf8_name(path) for path in result.heldout_files],
    }
    return provenance | {TORQUE_AS_EFFORT: unscaled} if unscaled else provenance


def shared_entry(cause: SharedEffect) -> dict[str, object]:
    """A link's or a sensor's error, as the model file has it."""
    return {
        "effect": cause.id,
        "where": cause.where,
        **{name: float(e.value) for name, e in cause.parameters.items()},
        "ci95": {name: [float(bound) for bound in e.ci95] for name, e in cause.parameters.items()},
    }


def links_entry(links: FittedLinks) -> dict[str, dict[str, float]]:
    """By link, its inertial parameters about its origin."""
    out: dict[str, dict[str, float]] = {}
    for p in links.parameters:
        out.setdefault(p.link, {})[p.name] = float(f"{p.estimate.value:.6g}")
    return out


def reference_of(joint: JointResult, *, final: bool) -> dict[str, object]:
    """What a later comparison needs of a joint beside its model.

    `gain_ci95`: 95 % interval of the drive gain; `run_spread`: standard deviation of each friction from run to run over
    its mean; `temperature`: smallest, mean and largest value of the training rows [°C], where it was recorded; `gap`:
    see `gap_between_encoders`.
    """
    parameters = joint.final_parameters if final else joint.baseline_parameters
    out: dict[str, object] = {
        "gain_ci95": [float(bound) for bound in parameters["drive"]["gain"].ci95],
        "run_spread": float(joint.run_spread),
    }
    samples = joint.train.samples
    if samples.signals.has("temperature"):
        warm = samples.signals.temperature[samples.rows]
        out["temperature"] = [round(float(each), 2) for each in (np.nanmin(warm), np.nanmean(warm), np.nanmax(warm))]
    gap = gap_between_encoders(samples)
    return out if gap is None else out | {"gap": {"value": gap[0], "ci95": list(gap[1])}}


def gap_between_encoders(samples: Samples) -> tuple[float, tuple[float, float]] | None:
    """Gap of the gear b [rad] with its 95 % interval, by an encoder on either side; None without.

    The rows' twist is  theta - q = c_0 + c_1 tau + (b/2) sign(tau).  The balance at the motor does not contain it. The
    interval is that of rows which are alike within blocks of half a second.
    """
    signals = samples.signals
    if not signals.has("motor_position"):
        return None
    tau = signals.load_torque[samples.rows]
    twist = (signals.motor_position - signals.position)[samples.rows]
    loaded = np.isfinite(twist) & (np.abs(tau) > LOADED * np.sqrt(np.mean(tau**2)))
    if np.unique(np.sign(tau[loaded])).size < 2:
        return None
    columns = np.column_stack([np.ones(loaded.sum()), tau[loaded], 0.5 * np.sign(tau[loaded])])
    found = np.linalg.lstsq(columns, twist[loaded], rcond=None)[0]
    scores = columns * (twist[loaded] - columns @ found)[:, None]
    blocks = samples.block[loaded]
    sums = np.array([scores[blocks == each].sum(axis=0) for each in np.unique(blocks)])
    inverse = np.linalg.inv(columns.T @ columns)
    half = 1.96 * float(np.sqrt((inverse @ sums.T @ sums @ inverse)[2, 2]))
    return float(found[2]), (float(found[2]) - half, float(found[2]) + half)


def _error(joint: JointResult, errors: Errors) -> dict[str, object]:
    return {"unit": joint.unit, "train": float(f"{errors.train:.4g}"), "heldout": float(f"{errors.heldout:.4g}")}
