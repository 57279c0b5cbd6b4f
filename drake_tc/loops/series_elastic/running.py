"""Run the series-elastic joint, and what the run leaves behind."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.errors import SimulationError
from drake_tc.loops.joint_bench.diagram import JOINT
from drake_tc.loops.recording import Progress, Recording, write_log, write_rig
from drake_tc.loops.series_elastic.loop import SeaLoop, build_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.types import FloatArray

RUNAWAY_SPEED = 100.0
"""A motor that is faster [rad/s], over the gear, has run away."""
SETTLED = 1.0
"""Torques are evaluated from here on [s], or over the second half of a run shorter than twice that."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SeaRecording(Recording):
    """A run of the series-elastic joint; signals: see `build_sea`.

    Attributes:
        scenario: What was simulated.
    """

    scenario: SeaScenario

    def __getitem__(self, name: str) -> FloatArray:
        """(T,) of a signal, (T, width) of one that has several elements.

        Raises:
            LogError: no such signal in this recording.
        """
        values = super().__getitem__(name)
        return values[:, 0] if values.shape[1] == 1 else values

    @property
    def evaluated(self) -> slice:
        """Samples that count."""
        begin = min(SETTLED, 0.5 * float(self.time[-1]))
        return slice(int(np.searchsorted(self.time, begin)), None)

    @property
    def torque_error(self) -> FloatArray:
        """tau_ref - tau of the spring (T,) [N m]."""
        return np.asarray(self["reference_torque"] - self["spring_torque"])

    @property
    def delayed_torque_error(self) -> FloatArray:
        """The same against the desired torque of `delay` ago: what a loop with that delay could have had."""
        desired = self["reference_torque"]
        ticks = min(round(self.scenario.delay / self.scenario.dt), desired.size)
        late = np.concatenate([np.full(ticks, desired[0]), desired[: desired.size - ticks]])
        return np.asarray(late - self["spring_torque"])

    def rms(self, values: FloatArray) -> float:
        """Over the evaluated samples."""
        return float(np.sqrt(np.mean(values[self.evaluated] ** 2)))


def simulate_sea(scenario: SeaScenario, progress: Progress | None = None, *, meshcat: bool = False) -> SeaRecording:
    """Build a scenario's joint, run it, and return what was logged.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.
        meshcat: Not of use: the joint has no shape.

    Raises:
        ParamsError: a scenario that cannot be built.
        SimulationError: the motor ran away; says when.
    """
    return run_sea(build_sea(scenario), progress)


def run_sea(loop: SeaLoop, progress: Progress | None = None) -> SeaRecording:
    """As `simulate_sea`, for a diagram that is built."""
    actuators = loop.diagram.GetSubsystemByName("actuators")
    motor: Any = actuators.GetOutputPort("motor_state")

    def watch(context: Context) -> Callable[[float], bool]:
        def goes_on(now: float) -> bool:
            speed = float(motor.Eval(actuators.GetMyContextFromRoot(context))[1])
            if not (math.isfinite(speed) and abs(speed) < RUNAWAY_SPEED):
                raise SimulationError(
                    f"joint {JOINT!r} ran away by t = {now:.3f} s: its motor turns at {speed:.3g} rad/s"
                )
            return True

        return goes_on

    return SeaRecording(**vars(loop.run(watch, progress)), scenario=loop.scenario)


def summarise_sea(recording: SeaRecording) -> dict[str, Any]:
    """Torque errors, largest torque and voltage, and what a hand had to give, as plain data."""
    error = recording.torque_error
    row = {
        "joint": recording.scenario.joint,
        "rms_error": recording.rms(error),
        "rms_error_but_for_delay": recording.rms(recording.delayed_torque_error),
        "max_error": float(np.abs(error[recording.evaluated]).max()),
        "max_torque": float(np.abs(recording["spring_torque"]).max()),
        "max_voltage": float(np.abs(recording["voltage"]).max()),
    }
    if "hand_torque" in recording.signals:
        row["hand_rms_torque"] = recording.rms(recording["hand_torque"])
    return {
        "robot": "sea_joint",
        "errors_from": float(recording.time[recording.evaluated.start]),
        "mode": recording.scenario.control.mode,
        "duration": float(recording.time[-1]),
        "real_time_factor": recording.real_time_factor,
        "joints": [row],
        "faults": recording.raised_flags(),
    }


def write_sea(
    recording: SeaRecording, folder: Path, ending: str, tell: Callable[[str], None] | None = None
) -> list[Path]:
    """Write `log.ENDING` and `rig.yaml`, which `close-loop` and `identify` read.

    The position is the motor's: what passes the gear turns with it, and the spring is behind the torque sensor.

    Raises:
        LogError: a file that cannot be written.
    """
    joint = recording.scenario.joint
    columns = {
        "time": recording.time,
        f"{joint}/position": recording["motor_encoder"],
        f"{joint}/voltage": felt_voltage(recording),
        f"{joint}/torque": recording["torque_sensor"],
    }
    inertia = recording.scenario.controller_actuator().inertia
    rig = {"joints": [joint], "drive": "voltage", "load": "torque", "declared": {joint: {"rotor_inertia": inertia}}}
    return [write_log(columns, folder / f"log.{ending}"), write_rig(rig, folder / "rig.yaml")]


def felt_voltage(recording: SeaRecording) -> FloatArray:
    """(T,) what reached the motor: as sent, `delay` later, and 0 before that [V]."""
    ticks = round(recording.scenario.delay / recording.scenario.dt)
    sent = recording["voltage"]
    return np.concatenate([np.zeros(ticks), sent])[: sent.size]
