"""A joint bench as a rig that is being measured: what it is, and one recorded run of it."""

from dataclasses import dataclass, replace

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.recorded_run import Link
from drake_tc.effects.base import plain_signals
from drake_tc.errors import ParamsError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import COMMAND_COLUMN
from drake_tc.loops.joint_bench.diagram import Rates, Table, build_bench, start_bench
from drake_tc.loops.scenarios.base import ScenarioBase
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class BenchScenario(ScenarioBase):
    """A rig and how it is recorded.

    Attributes:
        duration: [s].
        log_period: Sampling period of the record [s].
        step: Period of plant and actuator [s]; divides `log_period`.
        link_inertia: Of the link about the joint [kg m^2].
        gravity_moment: m g l [N m]; 0 for a joint about a vertical axis. The link hangs at q = 0.
        encoder_resolution: Step of the encoder [rad]; 0 for a perfect one.
        torque_noise: Standard deviation of the torque sensor [N m], white.
        seed: Seed of all random numbers.

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
                raise ParamsError(f"scenario.{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in ("gravity_moment", "encoder_resolution", "torque_noise", "seed"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ParamsError(f"scenario.{name}: expected a number >= 0, got {getattr(self, name)!r}")
        ratio = self.log_period / self.step
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            raise ParamsError(
                f"scenario.step: expected log_period {self.log_period} over a whole number, got {self.step}"
            )


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

    Starts at rest where a servo is commanded to be, or hanging for the other drives. The log shows the rotor inertia
    `simulated_inertia(model, scenario.step)`, which its rig file declares; that of `model_to_simulate(model, step)`
    shows the model's own.

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
