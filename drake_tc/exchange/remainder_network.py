"""ONNX: the remainder of a joint's model as a network, one file a joint, for simulators that can evaluate one.

The graph is the equation of `drake_tc.actuation.remainder`, with its bound and its decay outside the data:

    torque = exp(-(max(min_j |z - p_j| - r, 0)/EDGE)^2/2) clip(sqrt(2/K) c'cos(W z + b), -m, m)
    z      = ((position, velocity, tanh(velocity/v_s), load_torque) - center)/scale

Inputs and output have the shape (batch, 1). The torque resists as friction does: subtract it from the torque of the
joint. No exported actuator refers to the file, so that it acts only where a user evaluates it.

Source: ONNX operator set 17, IR version 8 (ONNX 1.12), which all runtimes since 2022 read.
"""

import math
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from drake_tc.actuation.remainder import EDGE, SIGNALS, Remainder, frequencies
from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from onnx import ModelProto

TARGETS_OF_NETWORKS = ("isaaclab", "isaaclab-bam", "newton")
"""Targets whose simulators evaluate networks beside their actuators."""
INPUTS = {
    "position": "position of the joint [rad]",
    "velocity": "velocity of the joint [rad/s]",
    "load_torque": "torque that the joint exerts on its load, after friction and inertia of the drive [N m]",
}
OUTPUT = ("torque", "torque that resists, to be subtracted from that of the joint [N m]")
OPERATORS, FORMAT = 17, 8


def to_onnx(
    remainder: Remainder, joint: str, joint_type: JointType = "revolute", *, double: bool = False
) -> "ModelProto":
    """The remainder as a network.

    Args:
        remainder: Of one joint.
        joint: Its name, which the file states.
        joint_type: Whether it turns or slides; the inputs and the output state their units.
        double: Numbers of 64 bits in place of 32. Those of 32 bits round to about 1e-7 of the sum of the |c_k|.

    Raises:
        ParamsError: the package `onnx` is not installed.
    """
    onnx = _onnx()
    helper, dtype = onnx.helper, np.float64 if double else np.float32
    element = helper.np_dtype_to_tensor_dtype(np.dtype(dtype))
    w, b = frequencies(remainder.weights.size)
    constants = {
        "slow": remainder.slow,
        "center": remainder.center,
        "scale": remainder.scale,
        "frequencies": w.T,
        "phases": np.remainder(b + np.pi, 2.0 * np.pi) - np.pi,
        "weights": np.sqrt(2.0 / b.size) * remainder.weights[:, None],
        "least": -remainder.largest,
        "largest": remainder.largest,
        "points": remainder.points,
        "radius": remainder.radius,
        "edge": EDGE,
        "minus_half": -0.5,
    }
    stored = [onnx.numpy_helper.from_array(np.asarray(value, dtype), name) for name, value in constants.items()]
    axes = {"after_batch": 1, "signals": 2}
    stored += [onnx.numpy_helper.from_array(np.array([axis], np.int64), name) for name, axis in axes.items()]
    nodes = [
        helper.make_node(operator, names.split(), [to], **attributes) for operator, names, to, attributes in _steps()
    ]

    def told(name: str, about: str) -> Any:
        return helper.make_tensor_value_info(name, element, ["batch", 1], in_units_of(joint_type, about))

    about = f"torque of joint {joint} that no effect of its model explains, by drake-tc"
    graph = helper.make_graph(nodes, "remainder", [told(*each) for each in INPUTS.items()], [told(*OUTPUT)], stored)
    operators = [helper.make_opsetid("", OPERATORS)]
    model = helper.make_model(graph, opset_imports=operators, ir_version=FORMAT, producer_name="drake-tc")
    model.doc_string = about
    onnx.checker.check_model(model, full_check=True)
    return model  # type: ignore[no-any-return]


def _steps() -> "list[tuple[str, str, str, dict[str, Any]]]":
    """Operator, names of what it reads, name of what it gives, and attributes, in the order of evaluation."""
    return [
        ("Div", "velocity slow", "relative_velocity", {}),
        ("Tanh", "relative_velocity", "direction", {}),
        ("Concat", " ".join(SIGNALS), "x", {"axis": 1}),
        ("Sub", "x center", "centered", {}),
        ("Div", "centered scale", "z", {}),
        ("MatMul", "z frequencies", "turns", {}),
        ("Add", "turns phases", "angles", {}),
        ("Cos", "angles", "features", {}),
        ("MatMul", "features weights", "unbounded", {}),
        ("Clip", "unbounded least largest", "bounded", {}),
        ("Unsqueeze", "z after_batch", "z_of_points", {}),
        ("Sub", "z_of_points points", "apart", {}),
        ("Mul", "apart apart", "squares", {}),
        ("ReduceSum", "squares signals", "square", {"keepdims": 0}),
        ("ReduceMin", "square", "least_square", {"axes": [1], "keepdims": 1}),
        ("Sqrt", "least_square", "distance", {}),
        ("Sub", "distance radius", "signed_excess", {}),
        ("Relu", "signed_excess", "excess", {}),
        ("Div", "excess edge", "edges", {}),
        ("Mul", "edges edges", "square_edges", {}),
        ("Mul", "square_edges minus_half", "exponent", {}),
        ("Exp", "exponent", "inside", {}),
        ("Mul", "inside bounded", OUTPUT[0], {}),
    ]


def _onnx() -> Any:
    try:
        import onnx
        import onnx.checker
        import onnx.helper
        import onnx.numpy_helper
    except ImportError:
        raise ParamsError("writing ONNX files needs the package onnx: pip install 'drake-tc[onnx]'") from None
    return onnx


def network_names(joints: Iterable[str]) -> dict[str, str]:
    """Joint to the name of its file, in which characters that file names cannot have are replaced by "_".

    Raises:
        ParamsError: two joints whose files would have the same name.
    """
    files = {joint: f"{re.sub(r'[^A-Za-z0-9_.-]', '_', joint)}.onnx" for joint in joints}
    for joint, file in files.items():
        same = [other for other, name in files.items() if name == file and other != joint]
        if same:
            raise ParamsError(f"joints {joint!r} and {same[0]!r} would have the same file {file}; export one at a time")
    return files


def lost_remainder(joint: str, remainder: Remainder, joint_type: JointType, target: str) -> str:
    """A sentence on a remainder that the exported file does not have."""
    text = f"{joint}: the remainder of the model, {_size(remainder)}, is lost: "
    if target in TARGETS_OF_NETWORKS:
        text += "--remainder FOLDER writes it as a network."
    else:
        text += "the target has no such function of motion and load."
    return in_units_of(joint_type, text)


def written_remainder(joint: str, remainder: Remainder, joint_type: JointType, file: str) -> str:
    """A sentence on a remainder that was written as the network `file`; further arguments as of `lost_remainder`."""
    text = (
        f"{joint}: the remainder of the model, {_size(remainder)}, is the network {file}: inputs {', '.join(INPUTS)},"
        f" output {OUTPUT[0]}, each (batch, 1) in SI units. No actuator of the exported file uses it: subtract its"
        f" torque from that of the joint."
    )
    return in_units_of(joint_type, text)


def _size(remainder: Remainder) -> str:
    size = f"{remainder.rms:.3g} N m RMS over the range of the data"
    if math.isnan(remainder.share):
        return size
    return f"{size} ({100.0 * remainder.share:.0f} % of the squared held-out error)"
