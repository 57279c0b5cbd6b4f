"""What the examples in the docstrings of public names may use without saying where it comes from."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LinearSystem, MatrixGain

import drake_tc
import drake_tc.models
from drake_tc.analysis.frequency_response import Sweep

PACKAGES = (
    "actuation",
    "analysis",
    "control",
    "filtering",
    "identification",
    "loops",
    "robot",
    "sensing",
    "sensor_validation",
    "tsid",
)
RIG = "joint: knee\ndrive: current\nload: torque\ndeclared: {rotor_inertia: 0.05}\n"


def public_names() -> dict[str, Any]:
    """Every name that a package exports, with its object."""
    found = {name: getattr(drake_tc, name) for name in drake_tc.__all__}
    for package in PACKAGES:
        module = importlib.import_module(f"drake_tc.{package}")
        for name in module.__all__:
            value = getattr(module, name)
            assert found.setdefault(name, value) is value, f"{package}.{name} is another object than drake_tc.{name}"
    return found


def small_loop() -> Diagram:
    """x[n+1] = x[n] - 0.1 x[n] every 10 ms."""
    builder = DiagramBuilder()
    one = np.eye(1)
    integrator = builder.AddNamedSystem("integrator", LinearSystem(one, one, one, 0.0 * one, 0.01))
    gain = builder.AddNamedSystem("gain", MatrixGain(-0.1 * one))
    builder.Connect(integrator.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), integrator.get_input_port())
    return builder.Build()


def namespace(folder: Path) -> dict[str, Any]:
    """Public names, numpy, Drake's builder, the folder of the models, one for files, and a small bench."""

    def leg_rig_file() -> Path:
        path = folder / "knee.yaml"
        path.write_text(RIG, encoding="utf-8")
        return path

    def leg_log(seed: int = 0) -> Path:
        """A pendulum of 2 kg at 0.3 m on a current drive of 0.4 A/(N m), as its rig describes it."""
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, 16.0, 0.01)
        w, size = 2.0 * np.pi * np.array([0.13, 0.41, 0.97]), np.array([1.4, 0.6, 0.2])
        angle = np.outer(time, w) + rng.uniform(0.0, 2.0 * np.pi, 3)
        q, v, a = np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)
        load = 0.18 * a + 5.9 * np.sin(q)
        torque = load + 0.05 * a + 1.5 * v + 0.8 * np.tanh(v / 1e-3)
        noise = rng.normal(size=(3, time.size)) * [[1e-4], [0.01], [0.02]]
        columns = {"time": time, "knee/position": q, "knee/current": 0.4 * torque, "knee/torque": load}
        table = pd.DataFrame(columns)
        table.iloc[:, 1:] += noise.T
        path = folder / ("swing.csv" if seed == 0 else f"swing_{seed}.csv")
        table.to_csv(path, index=False)
        return path

    def leg_rig() -> Any:
        return drake_tc.load_rig(leg_rig_file())

    def leg_runs() -> Any:
        return drake_tc.load_runs([leg_log()], leg_rig())

    own = {"leg_log": leg_log, "leg_rig": leg_rig, "leg_rig_file": leg_rig_file, "leg_runs": leg_runs}
    drake = {"DiagramBuilder": DiagramBuilder, "MultibodyPlant": MultibodyPlant, "Parser": Parser}
    more = {"np": np, "Path": Path, "Sweep": Sweep, "FOLDER": folder, "small_loop": small_loop}
    return {**public_names(), **drake, **more, **own, "MODELS": Path(drake_tc.models.__file__).parent}
