"""A joint on a bench: command -> actuator -> link in a MultibodyPlant -> encoder and torque sensor.

    command (table) --> ActuatorPlant --actuation--> MultibodyPlant(one revolute joint) --state--> encoder
                             ^---------------- state --------|------ reaction torque ----------> torque sensor
    applied (table) ------------ torque on the link -------->|

`record_bench` runs it as a rig that is being measured; `python -m drake_tc.diagrams.joint_bench` writes such a
record. `drake_tc.loops.joint_bench.free_run` drives the same diagram with a record.
"""

import argparse
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.recorded_run import Link
from drake_tc.effects.base import plain_signals
from drake_tc.errors import DrakeTcError, ParamsError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.loops.joint_bench.diagram import Rates, Table, build_bench, start_bench
from drake_tc.types import FloatArray

SCENARIO_FILE = Path(__file__).with_name("joint_bench.scenario.yaml")


@dataclass(frozen=True)
class BenchScenario:
    """A rig and how it is recorded.

    Attributes:
        duration: [s].
        log_period: Sampling period of the record [s].
        step: Period of plant and actuator [s]; divides `log_period`.
        link_inertia: Of the link about the joint [kg m^2].
        gravity_moment: m g l [N m]; 0 for a joint about a vertical axis. The link hangs at q = 0.
        encoder_resolution: Step of the encoder [rad]; 0 for a perfect one.
        torque_noise: Standard deviation of the torque sensor [N m], white.
        seed: Of the one generator.

    Raises:
        ParamsError: a value that is not possible.
    """

    duration: float = 10.0
    log_period: float = 1e-3
    step: float = 2.5e-4
    link_inertia: float = 0.08
    gravity_moment: float = 9.0
    encoder_resolution: float = 0.0
    torque_noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("duration", "log_period", "step", "link_inertia"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ParamsError(f"scenario.{name}: wanted a positive number; got {getattr(self, name)!r}")
        for name in ("gravity_moment", "encoder_resolution", "torque_noise", "seed"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ParamsError(f"scenario.{name}: wanted a number >= 0; got {getattr(self, name)!r}")
        ratio = self.log_period / self.step
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise ParamsError(
                f"scenario.step: wanted log_period {self.log_period} over a whole number; got {self.step}"
            )


def load_scenario(name: str, path: Path = SCENARIO_FILE) -> BenchScenario:
    """The scenario `name` of a scenario file.

    Raises:
        ParamsError: no such file or scenario, an unknown field, or a value that is not possible.
    """
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError) as error:
        raise ParamsError(f"{path}: wanted a scenario file (YAML); {' '.join(str(error).split())}") from error
    if not isinstance(document, dict) or name not in document:
        known = ", ".join(sorted(document)) if isinstance(document, dict) else "none"
        raise ParamsError(f"{path}: no scenario {name!r}; scenarios here: {known}")
    possible = {field.name for field in fields(BenchScenario)}
    unknown = sorted(set(document[name] or {}) - possible)
    if unknown:
        raise ParamsError(f"{path}: {name}: unknown field {unknown[0]!r}; possible: {', '.join(sorted(possible))}")
    try:
        return BenchScenario(**(document[name] or {}))
    except (ParamsError, TypeError) as error:
        raise ParamsError(f"{path}: {name}: {error}") from error


def quantise(values: FloatArray, step: float) -> FloatArray:
    """The nearest multiple of `step`; `values` themselves for a step of 0."""
    return values if step == 0.0 else np.asarray(np.round(values / step) * step)


def record_bench(
    model: ActuatorModel,
    table: Table,
    scenario: BenchScenario,
    generator: np.random.Generator | None = None,
    name: str = "bench",
) -> Run:
    """Run the bench and measure it, with the model's sensor errors, the encoder's steps and the torque sensor's noise.

    Starts at rest where a servo is commanded to be, or hanging for the other drives.

    Args:
        model: The actuator.
        table: Command and torque on the link from outside; time from 0.
        scenario: The rig.
        generator: Of the noise; None makes one from the scenario's seed.
        name: Of the run.

    Returns:
        `joint/position`, `joint/torque` (link side) and the command's column; `joint/temperature` and
            `joint/supply_voltage` where they are given.
    """
    rng = np.random.default_rng(scenario.seed) if generator is None else generator
    link = Link(scenario.link_inertia, scenario.gravity_moment)
    rates = Rates(scenario.step, scenario.log_period)
    bench = build_bench(model, link, table, rates, scenario.torque_noise)
    start = float(table.command[0]) if model.drive.kind == "position_servo" else 0.0
    simulator = start_bench(bench, start, 0.0, int(rng.integers(2**31)))
    simulator.AdvanceTo(scenario.duration)
    context = simulator.get_context()
    log = bench.state_log.FindLog(context)
    time = np.asarray(log.sample_times())
    torque = np.asarray(bench.torque_log.FindLog(context).data()[0]) if bench.torque_log else np.zeros_like(time)
    known = {"time": time, "position": np.asarray(log.data()[0]), "load_torque": torque}
    signals = replace(plain_signals(time.size, known), period=float(time[1] - time[0]))
    for effect, parameters in model.sensor_effects:
        signals = effect.corrupt(signals, parameters)
    row = np.clip(np.searchsorted(table.time, time + 0.25 * scenario.step, side="right") - 1, 0, None)
    columns = {
        f"{model.joint}/position": quantise(signals.position, scenario.encoder_resolution),
        f"{model.joint}/{COMMAND_COLUMN[model.drive.kind]}": table.command[row],
        f"{model.joint}/torque": signals.load_torque,
    }
    for channel in ("temperature", "supply_voltage"):
        values = getattr(table, channel)
        if values is not None:
            columns[f"{model.joint}/{channel}"] = values[row]
    usable = np.zeros(time.size, dtype=np.int64)
    return Run(name, None, time, scenario.log_period, columns, usable)


def growing_sinusoid(scenario: BenchScenario, start: float, growth: float, frequency_hz: float) -> Table:
    """q(t) = (a0 + a t) sin(2 pi f t) (EQUATIONS A4), start a0, growth a [unit/s], as a command table."""
    time = np.arange(round(scenario.duration / scenario.log_period) + 1, dtype=np.float64) * scenario.log_period
    return Table(time, (start + growth * time) * np.sin(2.0 * np.pi * frequency_hz * time))


DEMO_MODEL = ActuatorModel(
    "joint",
    Drive("position_servo", 2e-3),
    (
        EffectValue("rotor_inertia", {"rotor_inertia": 0.2}),
        EffectValue("viscous", {"viscous": 4.0}),
        EffectValue("coulomb", {"coulomb": 2.0}),
    ),
)
"""A geared servo joint: what `main` simulates when it is given no model file."""


def main(arguments: list[str] | None = None) -> int:
    """Record one run to CSV: 0 when it ran, 2 on input that cannot be used."""
    parser = argparse.ArgumentParser(prog="python -m drake_tc.diagrams.joint_bench", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenario-file", type=Path, default=SCENARIO_FILE)
    parser.add_argument("--scenario", default="pendulum", help="name in the scenario file")
    parser.add_argument("--model", type=Path, help="actuator YAML; its first joint is taken")
    parser.add_argument("--amplitude-growth", type=float, default=0.05, help="of the sinusoid [unit of command/s]")
    parser.add_argument("--frequency", type=float, default=0.5, help="of the sinusoid [Hz]")
    parser.add_argument("--out", type=Path, default=Path("joint_bench.csv"))
    options = parser.parse_args(arguments)
    try:
        scenario = load_scenario(options.scenario, options.scenario_file)
        model = next(iter(load_models(options.model).values())) if options.model else DEMO_MODEL
        table = growing_sinusoid(scenario, 0.0, options.amplitude_growth, options.frequency)
        run = record_bench(model, table, scenario)
    except DrakeTcError as error:
        print(error, file=sys.stderr)
        return 2
    pd.DataFrame({"time": run.time, **run.columns}).to_csv(options.out, index=False)
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
