"""What other programs read of a result: report.json, schema 1 (the contract in the README), and the residuals as MCAP.

The MCAP file, for Foxglove, Rerun and PlotJuggler, has measured and modelled effort and position of every run. A topic
`/RUN/JOINT/effort` has the rows of the regression, `/RUN/JOINT/position` the free run of a run. Each message is a
`drake_tc_msgs/msg/Compared` in ROS 2's encoding (CDR), whose definition stands in the file. Its stamp is the time since
the start of the run, so that runs lie over each other.
"""

import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.actuation.remainder import SIGNALS
from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.config.quoted import json_value
from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.applications import ClosedLoop, ExportTrial
from drake_tc.diagnosis.result.errors import MODELS, mean_absolute_errors, position_errors
from drake_tc.diagnosis.result.joint_result import JointResult, Refinement, RunErrors
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.models import MODEL_FILE
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.errors import LogError
from drake_tc.report.notes import next_experiment, note_sentences, set_up_json
from drake_tc.report.plots.time_plots import Trace, effort_traces
from drake_tc.report.words import REASONS, why_rejected
from drake_tc.types import FloatArray


def loop_entry(closed: ClosedLoop | None, joint: str) -> dict[str, Any] | None:
    """`joints.NAME.closed_loop`: figures in SI; None where there is no loop."""
    if closed is None or joint not in closed.joints:
        return None
    found = closed.joints[joint]
    return {
        "simulated": True,
        "changed": found.changed,
        "gains": dict(found.gains),
        "before": json_value(asdict(found.before)),
        "after": json_value(asdict(found.after)),
    }


def loop_summary(closed: ClosedLoop | None) -> dict[str, Any] | None:
    """`closed_loop`: what the figures of all joints have in common."""
    if closed is None:
        return None
    return _fields(closed, "plant controller changed notes") | {"reference": _fields(closed, "run start end")}


def uncertainty_entry(
    uncertainty: TorqueUncertainty | None, joint: str, units: JointUnits = TURNING
) -> dict[str, Any] | None:
    """`joints.NAME.torque_uncertainty`: sigma of the held-out residual as link-side torque or force."""
    if uncertainty is None or joint not in uncertainty.joints:
        return None
    at = uncertainty.joints.index(joint)
    entry: dict[str, Any] = json_value(
        {
            "unit": units.text(TORQUE),
            "sigma": float(uncertainty.sigma[at]),
            "ci95": uncertainty.ci95[at],
            "mean": float(uncertainty.mean[at]),
            "correlation_time": float(uncertainty.correlation_time[at]),
            "effective_samples": float(uncertainty.effective_samples[at]),
        }
    )
    return entry


def free_runs_json(joint: JointResult) -> list[dict[str, Any]]:
    """Errors of each held-out run's free runs [rad], by model; null for one that there is not."""
    rows = []
    for run, trace in joint.free_run.items():
        found = {name: position_errors(trace, name) for name in MODELS}
        entry = {
            name: None if errors is None else {"rms": errors[0], "mean_absolute": errors[1]}
            for name, errors in found.items()
        }
        rows.append(json_value({"run": run, **entry}))
    return rows


def refinement_json(refinement: Refinement | None) -> dict[str, Any] | None:
    """What the output error did; null where no free run was asked for."""
    if refinement is None:
        return None
    pairs = {"train": refinement.train, "cross_validated": refinement.cross_validated}
    document = {
        "status": refinement.status,
        "why": refinement.why or None,
        "model": MODEL_FILE if refinement.accepted else None,
        "free_run_mean_absolute": {
            name: None if pair is None else {"after": pair[0], "refined": pair[1]} for name, pair in pairs.items()
        },
        "error": {
            "train": refinement.error_train,
            "heldout": refinement.error_heldout,
            "free_run_heldout": refinement.free_run_heldout,
        },
        "parameters": [
            {"effect": p.key, "parameter": p.name} | _fields(p, "unit equation_error output_error at_bound")
            for p in refinement.parameters
        ],
    }
    return dict(json_value(document))


def _fields(thing: object, names: str) -> dict[str, Any]:
    """The attributes that stand under their own names."""
    return {name: getattr(thing, name) for name in names.split()}


def _estimate(e: Estimate) -> dict[str, Any]:
    return _fields(e, "value unit ci95 at_bound")


def _run(errors: RunErrors) -> dict[str, Any]:
    return _fields(errors, "run heldout rows") | {
        "before": {"rms": errors.before, "mean_absolute": errors.mean_absolute_before},
        "after": {"rms": errors.after, "mean_absolute": errors.mean_absolute_after},
    }


def _load(joint: JointResult) -> dict[str, Any] | None:
    """What was fitted of an unknown load; null where the load is known."""
    if joint.load is None:
        return None
    title, parameters = joint.load
    return {"title": title, "parameters": {name: _estimate(p) for name, p in parameters.items()}}


def _plausible(joint: JointResult) -> dict[str, dict[str, Any]]:
    return {
        key: {name: {"range": [r.lower, r.upper], "source": r.source} for name, r in group.items()}
        for key, group in joint.plausible.items()
    }


def joint_json(joint: JointResult) -> dict[str, Any]:
    """The entry of one joint."""
    left = joint.unexplained
    document = {
        "baseline": {
            "effects": [t.effect.id for t in joint.baseline.terms if t.effect.key in joint.baseline_parameters],
            "parameters": {
                key: {name: e.value for name, e in group.items()} for key, group in joint.baseline_parameters.items()
            },
        },
        "parameters": {
            key: {name: _estimate(e) for name, e in group.items()} for key, group in joint.final_parameters.items()
        },
        "correlation": None if joint.correlation is None else asdict(joint.correlation),
        "load": _load(joint),
        "noise_floor": joint.noise_floor,
        "error": {
            "unit": joint.unit,
            "before": asdict(joint.before),
            "after": asdict(joint.after),
            "mean_absolute": mean_absolute_errors(joint),
        },
        "effects": [
            _fields(e, "id key title heldout_gain stability")
            | {
                "parameters": {name: _estimate(p) for name, p in e.parameters.items()},
                "robot_heldout_gain": e.robot_gain,
            }
            for e in joint.effects
        ],
        "rejected": [
            _fields(r, "id key heldout_gain log_odds reason") | {"why": why_rejected(r)} for r in joint.rejected
        ],
        "indistinguishable": joint.indistinguishable,
        "next_experiment": next_experiment(joint),
        "did_not_hold": [_fields(d, "id key reason") | {"why": REASONS[d.reason][1]} for d in joint.did_not_hold],
        "unexplained": _fields(
            left, "floors floors_anywhere share_of_signal fraction structured depends_on period_hz explainable_rms"
        )
        | {
            "confined_to": [{"run": s.run, "start": s.start, "end": s.end} for s in left.confined_to],
            "beyond": None if left.beyond is None else asdict(left.beyond),
        },
        "remainder": _remainder(joint),
        "runs": [_run(errors) for errors in joint.runs],
        "free_runs": free_runs_json(joint),
        "refinement": refinement_json(joint.refinement),
        "plausible": _plausible(joint),
        "gain_identified": joint.gain_identified,
        "shared_band": None if joint.shared_band is None else asdict(joint.shared_band),
        "notes": list(note_sentences(joint.notes, joint.units)),
    }
    return dict(json_value(document))


def _remainder(joint: JointResult) -> dict[str, Any] | None:
    """The smooth part of what is left."""
    found = joint.remainder
    if found is None:
        return None
    share = {"value": found.model.share, "ci95": list(found.model.share_ci95)}
    return {"signals": list(SIGNALS), "share": share, "rms": found.rms, "in_model": found.holds}


def shared_json(cause: SharedEffect) -> dict[str, Any]:
    """The entry of a cause that no single joint owns."""
    return _fields(cause, "id where heldout_gain stability") | {
        "parameters": {name: _estimate(p) for name, p in cause.parameters.items()},
        "joints": dict(cause.joints),
        "indistinguishable": [{"id": name, "where": where} for name, where in cause.indistinguishable],
    }


def links_json(links: FittedLinks) -> dict[str, Any]:
    """The links' inertial parameters, where they were fitted."""
    return {
        "parameters": [
            {"link": p.link, "parameter": p.name, "declared": p.declared, "narrowed": p.narrowed}
            | _estimate(p.estimate)
            for p in links.parameters
        ],
        "base": [
            {"name": p.name, "weights": dict(p.weights), "declared": p.declared} | _estimate(p.estimate)
            for p in links.base
        ],
        "payloads": {
            run: {name: _estimate(e) for name, e in parameters.items()} for run, parameters in links.payloads.items()
        },
    }


def export_json(trial: ExportTrial | None, units: Mapping[str, JointUnits]) -> dict[str, Any] | None:
    """The entry of report.json; null where no export was tried."""
    if trial is None:
        return None
    document = {"to": trial.to, "runner": trial.runner, "model": trial.model_file, "losses": list(trial.losses)}
    rows = [asdict(row) | {"unit": units[row.joint].position} for row in trial.rows]
    return document | {"free_runs": rows}


def result_json(result: CloseLoopResult) -> dict[str, Any]:
    """The whole report."""
    document = {
        "schema": 1,
        "verdict": result.verdict,
        "joints": {
            name: joint_json(joint)
            | {
                "closed_loop": loop_entry(result.closed_loop, name),
                "torque_uncertainty": uncertainty_entry(result.uncertainty, name, joint.units),
            }
            for name, joint in result.joints.items()
        },
        "shared": [shared_json(cause) for cause in result.shared],
        "links": None if result.links is None else links_json(result.links),
        "set_up": set_up_json(result.set_up),
        "notes": list(note_sentences(result.notes)),
        "closed_loop": loop_summary(result.closed_loop),
        "export": export_json(result.export, {name: joint.units for name, joint in result.joints.items()}),
        "seconds": result.seconds,
        "logs": list(result.train_files),
        "holdout": list(result.heldout_files),
    }
    return dict(json_value(document))


FILE = "residuals.mcap"
TYPE = "drake_tc_msgs/msg/Compared"
FIELDS = ("measured", *MODELS, *(f"residual_{name}" for name in MODELS))
"""Numbers of a message; the residual is the modelled value less the measured one, NaN where there is no such model."""
DEFINITION = "\n".join(
    [
        "# Measured and modelled effort or position of a joint, in the unit that the metadata of the bag states.",
        "builtin_interfaces/Time stamp",
        *(f"float64 {name}" for name in FIELDS),
        "",
    ]
)
MESSAGE = np.dtype([("head", "u1", 4), ("sec", "<i4"), ("nanosec", "<u4"), ("values", "<f8", len(FIELDS))])
"""A message as CDR has it: four bytes of encapsulation, then the fields, all of which are aligned."""
LITTLE_ENDIAN = (0, 1, 0, 0)
SECOND = 1_000_000_000


def require_rosbags() -> None:
    """Refuse to write an MCAP file where the package is missing.

    Raises:
        LogError: rosbags is not installed.
    """
    if find_spec("rosbags") is None:
        raise LogError(f"{FILE}: writing an MCAP file needs the package rosbags: pip install 'drake-tc[bags]'")


def save_residuals(result: CloseLoopResult, path: Path) -> None:
    """Write the MCAP file.

    Args:
        result: Of close-loop.
        path: File to write; it takes the place of one that is there.

    Raises:
        LogError: rosbags is not installed.
    """
    require_rosbags()
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    typestore = get_typestore(Stores.ROS2_HUMBLE)
    typestore.register(get_types_from_msg(DEFINITION, TYPE))
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".drake-tc-") as scratch:
        bag = Path(scratch) / path.stem
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            sent = []
            for topic, unit, trace in _topics(result):
                connection = writer.add_connection(topic, TYPE, typestore=typestore)
                writer.set_custom_data(topic, f"unit: {unit}; run: {trace.run}; held out: {trace.heldout}")
                stamps, messages = _messages(trace)
                sent += [(int(stamp), connection, message) for stamp, message in zip(stamps, messages, strict=True)]
            for stamp, connection, message in sorted(sent, key=lambda each: each[0]):
                writer.write(connection, stamp, message)
        (written,) = bag.glob("*.mcap")
        shutil.move(written, path)


def _topics(result: CloseLoopResult) -> Iterator[tuple[str, str, Trace]]:
    """Topic, unit and trace of every run and joint."""
    taken: set[str] = set()
    for name, joint in result.joints.items():
        for quantity, unit, traces in (
            ("effort", joint.unit, effort_traces(joint)),
            ("position", joint.units.position, _free_runs(joint)),
        ):
            for trace in traces:
                topic = f"/{_word(trace.run)}/{_word(name)}/{quantity}"
                while topic in taken:
                    topic += "_"
                taken.add(topic)
                yield topic, unit, trace


def _free_runs(joint: JointResult) -> list[Trace]:
    """Positions of the free runs, however far they go."""
    held = joint.heldout.samples.runs
    return [
        Trace(
            run,
            run in held,
            each["time"],
            each["recorded"],
            {name: each[name] - each["recorded"] for name in MODELS if name in each},
        )
        for run, each in joint.free_run.items()
    ]


def _word(name: str) -> str:
    """A name as a part of a topic of ROS: letters, digits and underscores, no digit first."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{word}" if word[:1].isdigit() else word


def _messages(trace: Trace) -> tuple[np.ndarray, list[bytes]]:
    """Stamps (M,) [ns] and messages of the samples that are no breaks of the line."""
    known = np.isfinite(trace.measured)
    time = trace.time[known] - min(float(trace.time.min()), 0.0)
    nothing: FloatArray = np.full(trace.measured.size, np.nan)
    errors = [trace.errors.get(name, nothing)[known] for name in MODELS]
    measured = trace.measured[known]
    stamps = np.round(time * SECOND).astype(np.int64)
    packed = np.zeros(stamps.size, dtype=MESSAGE)
    packed["head"] = LITTLE_ENDIAN
    packed["sec"], packed["nanosec"] = np.divmod(stamps, SECOND)
    packed["values"] = np.column_stack([measured, *(measured + error for error in errors), *errors])
    return stamps, [each.tobytes() for each in packed]
