"""A joint on a bench: command -> actuator -> link in a MultibodyPlant -> encoder and torque sensor.

    command (table) --> ActuatorPlant --actuation--> MultibodyPlant(one revolute joint) --state--> encoder
                             ^---------------- state --------|------ reaction torque ----------> torque sensor
    applied (table) ------------ torque on the link -------->|

`drake_tc.loops.joint_bench.record_bench` runs it as a rig that is being measured, and
`python -m drake_tc.diagrams.joint_bench` writes such a record. `drake_tc.loops.joint_bench` drives the same
diagram with a record.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models
from drake_tc.errors import DrakeTcError
from drake_tc.loops.joint_bench import BenchScenario, Table, record_bench

SCENARIO_FILE = Path(__file__).with_name("joint_bench.scenario.yaml")


def growing_sinusoid(scenario: BenchScenario, start: float, growth: float, frequency_hz: float) -> Table:
    """q(t) = (a0 + a t) sin(2 pi f t), start a0, growth a [unit/s], as a command table.

    Source: Del Prete et al., 2016, section 3.4.
    """
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
        scenario = BenchScenario.load(options.scenario_file, options.scenario)
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
