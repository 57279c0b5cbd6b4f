"""The remainder of a joint as an ONNX file: its numbers by ONNX's own evaluator, its shapes, and what `export` says."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import ModelFile
from drake_tc.actuation.remainder import Remainder, frequencies
from drake_tc.cli.main import run
from drake_tc.errors import ParamsError
from drake_tc.exchange.remainder_network import network_names, to_onnx

onnx = pytest.importorskip("onnx", reason="pip install onnx")
BOUND = 0.6
"""Of the torque [N m]: its standard deviation is 1 N m without it."""
MODEL = ActuatorModel("knee", Drive("current", 0.5), (EffectValue("coulomb", {"coulomb": 3.0}),))


def remainder(seed: int) -> Remainder:
    """One whose data reach 2 deviations from its centre, and whose bound cuts off a part of it."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2.0, 2.0, (60, 4))
    scale = np.array([0.6, 1.5, 0.9, 8.0])
    return Remainder(rng.normal(size=4), scale, points, 0.8, 0.1, BOUND, rng.normal(size=300), 0.31, (0.2, 0.4))


def signals(one: Remainder, rng: np.random.Generator, dtype: type) -> dict[str, np.ndarray]:
    """(T, 1) inputs, of which a part is far outside the data."""
    z = rng.normal(0.0, 1.5, (400, 4))
    x = one.center + one.scale * z
    return {n: x[:, [k]].astype(dtype) for n, k in (("position", 0), ("velocity", 1), ("load_torque", 3))}


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_file_has_the_torque_of_the_model_inside_and_outside_the_data(tmp_path, seed, double):
    from onnx.reference import ReferenceEvaluator

    one, rng = remainder(seed), np.random.default_rng(100 + seed)
    onnx.save(to_onnx(one, "knee", double=double), tmp_path / "knee.onnx")
    given = signals(one, rng, np.float64 if double else np.float32)
    expected = one.torque(*(given[n][:, 0].astype(np.float64) for n in ("position", "velocity", "load_torque")))
    (found,) = ReferenceEvaluator(str(tmp_path / "knee.onnx")).run(None, given)
    assert found.shape == (400, 1) and found.dtype == given["position"].dtype
    # of the bound: rounding of 32 bits is 6e-8 of each of the 300 features, of 64 bits 1e-16
    np.testing.assert_allclose(found[:, 0], expected, rtol=0, atol=(1e-12 if double else 1e-6) * one.largest)
    assert np.mean(np.abs(expected) < 0.1 * one.largest) > 0.1 and np.mean(np.abs(expected) > 0.9 * one.largest) > 0.02


def test_inputs_and_output_are_named_and_have_a_batch_dimension_and_units():
    model = to_onnx(remainder(0), "slide", "prismatic")
    told = [*model.graph.input, *model.graph.output]
    shapes = {e.name: [d.dim_param or d.dim_value for d in e.type.tensor_type.shape.dim] for e in told}
    assert shapes == {name: ["batch", 1] for name in ("position", "velocity", "load_torque", "torque")}
    assert [e.doc_string.split("[")[1] for e in told] == ["m]", "m/s]", "N]", "N]"]
    inferred = onnx.shape_inference.infer_shapes(model, check_type=True, strict_mode=True)
    assert inferred.graph.output[0].type.tensor_type.elem_type == onnx.TensorProto.FLOAT


def test_one_joint_alone_is_a_batch_of_one():
    from onnx.reference import ReferenceEvaluator

    one = remainder(4)
    given = {n: v[:1] for n, v in signals(one, np.random.default_rng(5), np.float32).items()}
    (found,) = ReferenceEvaluator(to_onnx(one, "knee")).run(None, given)
    assert found.shape == (1, 1)


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.yaml"
    both = {name: replace(MODEL, joint=name) for name in ("left/knee", "ankle")}
    ModelFile(both, remainders={"left/knee": remainder(6)}).save(path)
    return str(path)


@pytest.mark.parametrize("target", ["isaaclab", "newton"])
def test_export_writes_one_file_a_joint_that_has_a_remainder_and_says_so(tmp_path, capsys, model, target):
    out, folder = tmp_path / "actuators", tmp_path / "networks"
    arguments = ["export", model, "--to", target, "--out", str(out), "--remainder", str(folder)]
    assert run(arguments) == 0
    told = capsys.readouterr().out
    assert [each.name for each in folder.glob("*.onnx")] == ["left_knee.onnx"]
    assert "left/knee: the remainder of the model, " in told and "is the network left_knee.onnx" in told
    assert "ankle: the remainder" not in told and "remainder" not in out.read_text()
    assert run([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["networks"] == [str(folder / "left_knee.onnx")]


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("mjcf", "is lost: the target has no such function of motion and load."),
        ("c", "is lost: the target has no such function of motion and load."),
        ("newton", "is lost: --remainder FOLDER writes it as a network."),
    ],
)
def test_without_it_the_remainder_is_named_as_lost_with_its_rms(tmp_path, capsys, model, target, why):
    out = tmp_path / ("model.c" if target == "c" else "model.xml")
    assert run(["export", model, "--to", target, "--out", str(out)]) == 0
    told = next(line for line in capsys.readouterr().out.splitlines() if "remainder" in line)
    one = remainder(6)
    w, b = frequencies(one.weights.size)
    raw = np.sqrt(2.0 / one.weights.size) * np.cos(one.points @ w.T + b) @ one.weights
    rms = np.sqrt(np.mean(np.clip(raw, -BOUND, BOUND) ** 2))
    assert told == (
        f"left/knee: the remainder of the model, {rms:.3g} N m RMS over the range of the data"
        f" (31 % of the squared held-out error), {why}"
    )


def test_targets_without_networks_are_refused_and_models_without_a_remainder_are_named(tmp_path, capsys, model):
    assert run(["export", model, "--to", "mjcf", "--remainder", str(tmp_path / "n")]) == 2
    assert "expected --to isaaclab, isaaclab-bam, newton, got --to mjcf" in capsys.readouterr().err
    assert run(["export", model, "--to", "newton", "--joint", "ankle", "--remainder", str(tmp_path / "n")]) == 0
    assert "No network was written: no joint of this model has a remainder." in capsys.readouterr().err
    assert not (tmp_path / "n").exists()
    with pytest.raises(ParamsError, match=r"'a b' and 'a/b' would have the same file a_b\.onnx"):
        network_names(["a b", "a/b"])


def test_a_missing_package_is_one_line(tmp_path, capsys, model, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert run(["export", model, "--to", "newton", "--remainder", str(tmp_path / "n")]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert error[-1].endswith("writing ONNX files needs the package onnx: pip install 'drake-tc[onnx]'")
    assert not (tmp_path / "n").exists()
