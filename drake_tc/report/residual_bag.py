"""Measured and modelled effort and position of every run as one MCAP file, for Foxglove, Rerun and PlotJuggler.

A topic `/RUN/JOINT/effort` has the rows of the regression, `/RUN/JOINT/position` the free run of a run. Each message is
a `drake_tc_msgs/msg/Compared` in ROS 2's encoding (CDR), whose definition stands in the file. Its stamp is the time
since the start of the run, so that runs lie over each other.
"""

import re
import shutil
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from drake_tc.diagnosis.result.errors import MODELS
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import LogError
from drake_tc.report.plots.time_plots import Trace, effort_traces
from drake_tc.types import FloatArray

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
