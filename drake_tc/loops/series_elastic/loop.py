"""One voltage-driven series-elastic joint under torque control (Faraji et al., 2015): held, moved by a hand, or free.

The wiring is that of `add_series_elastic_loop`; this file adds the link, the
hand and the reference. `reference: {of: position}` puts a soft position loop around it, whose link speed comes from
the motor's encoder minus the spring's deflection.

What acts on the joint from outside: the hand, and the reference.

Run the series-elastic joint, and what the run leaves behind.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LinearSystem, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.control.series_elastic import SeriesElasticControl
from drake_tc.errors import SimulationError
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.joint_bench import JOINT, make_plant
from drake_tc.loops.loop_builder import LoopBuilder, behind, product, split, total
from drake_tc.loops.recording import Progress, Recording, write_log, write_rig
from drake_tc.loops.series_elastic.scenario import HandSpec, ReferenceSpec, SeaScenario, spring_compliance
from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop
from drake_tc.loops.torque.references import risen, table_source
from drake_tc.types import FloatArray

SHARE = 0.2
"""Of the newest difference of positions in the speed of the link that the position loop knows."""


def reference_path(spec: ReferenceSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """The reference torque or angle (1), exact at the ticks, with two derivatives."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    rise = risen((time - spec.begin) / spec.ramp)
    phase = 2.0 * np.pi * spec.frequency_hz * (time - spec.begin)
    values = rise * (spec.offset + spec.amplitude * np.sin(phase))
    make: Any = PiecewisePolynomial.CubicWithContinuousSecondDerivatives
    path: PiecewisePolynomial = make(time, values[None, :], np.zeros(1), np.zeros(1))
    return path


def hand_path(spec: HandSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """(2) [q_h; q'_h]: straight lines whose corners are rounded by a running mean over `rounding`."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    fine = np.linspace(-0.5, 0.5, 41) * spec.rounding
    times, knots = (spec.times, spec.knots) if spec.times else ((0.0,), (0.0,))
    values = np.mean([np.interp(time + shift, times, knots) for shift in fine], axis=0)
    make: Any = PiecewisePolynomial.FirstOrderHold
    path: PiecewisePolynomial = make(time, np.stack([values, np.gradient(values, dt)]))
    return path


@dataclass(frozen=True, eq=False, kw_only=True)
class SeaLoop(BuiltLoop[SeaScenario]):
    """A built loop of one joint, which starts at rest, its link hanging, where the hand is.

    Attributes:
        control: The torque control.
    """

    control: SeriesElasticControl

    @property
    def period(self) -> float:
        """Period of the control [s]."""
        return self.scenario.dt


def build_sea(scenario: SeaScenario) -> SeaLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.

    Raises:
        ParamsError: values that do not fit.
    """
    builder = DiagramBuilder()
    plant = make_plant(scenario.link, scenario.dt)
    builder.AddNamedSystem("plant", plant)
    models, assumed = ([replace(m, joint=JOINT)] for m in (scenario.actuator(), scenario.controller_actuator()))
    loop = add_series_elastic_loop(builder, plant, models, spec=scenario, controller_models=assumed)
    parts = LoopBuilder(builder, scenario, plant, scenario.dt, loop.signals)
    control = loop.systems["torque_control"]
    loop.signals["reference_torque"] = _add_reference(parts, control)
    if scenario.hand is not None:
        loop.signals["hand_torque"] = _add_hand(parts, plant, scenario.hand)
    diagram, log = loop.build(builder, "sea_joint")
    return SeaLoop(
        scenario=scenario, diagram=diagram, plant=plant, control=control, log=log, flag_names=loop.flag_names
    )


def _add_reference(loop: LoopBuilder[SeaScenario], control: SeriesElasticControl) -> OutputPort:
    """The reference torque, and with a position loop the reference acceleration of the link.

    tau_ref = M q''_d + m g l sin q_d + k (q_d - q) + d (q'_d - q'),  q of the link as it is known
    """
    scenario, builder = loop.scenario, loop.builder
    spec = scenario.reference
    path = reference_path(spec, scenario.duration, scenario.dt)
    positions = spec.of == "position"
    torque = behind(builder, "reference", TrajectorySource(path, 2 if positions else 0))
    if positions:
        loop.signals["reference_motion"] = torque
        place, acceleration = split(builder, "reference_parts", torque, [2, 1])
        builder.Connect(acceleration, control.GetInputPort("reference_acceleration"))
        feedback = _pulled(loop, "feedback", spec, place, _known(loop))
        torque = total(builder, "position_loop", _carried(loop, path), feedback)
    builder.Connect(torque, control.GetInputPort("reference_torque"))
    return torque


def _known(loop: LoopBuilder[SeaScenario]) -> OutputPort:
    """[y; v'] of the link behind the spring, as the fine encoder and the gauge tell it, every dt.

    y[n] = theta[n] - c tau[n],   v'[n] = v'[n-1] + SHARE ((y[n] - y[n-1])/dt - v'[n-1])
    """
    dt, compliance = loop.scenario.dt, spring_compliance(loop.scenario.controller_actuator())
    readings = loop.join("link_readings", [loop.signals["motor_encoder"], loop.signals["torque_sensor"]])
    of_last: Any = np.array([[0.0, 0.0], [-SHARE / dt, 1.0 - SHARE]])
    of_now: Any = np.outer([1.0, SHARE / dt], [1.0, -compliance])
    return behind(loop.builder, "link_state", LinearSystem(of_last, of_now, of_last, of_now, dt), readings)


def _carried(loop: LoopBuilder[SeaScenario], path: PiecewisePolynomial) -> OutputPort:
    """M q''_d + m g l sin q_d at the ticks, which the link needs for its motion [N m]."""
    link = loop.scenario.link
    time = np.arange(round(loop.scenario.duration / loop.scenario.dt) + 3, dtype=np.float64) * loop.scenario.dt
    orders: list[Any] = [path, path.derivative(2)]
    angle, acceleration = (each.vector_values(time)[0] for each in orders)
    torque = link.inertia * acceleration + link.gravity_moment * np.sin(angle)
    return behind(loop.builder, "carried_torque", table_source(time, torque[:, None]))


def _pulled(
    loop: LoopBuilder[SeaScenario], name: str, spec: HandSpec | ReferenceSpec, place: OutputPort, state: OutputPort
) -> OutputPort:
    """Torque k (q_0 - q) + d (q'_0 - q') [N m] of a spring and a damper between two places [q; q']."""
    gains = np.array([[spec.stiffness, spec.damping, -spec.stiffness, -spec.damping]])
    return product(loop.builder, name, gains, loop.join(f"{name}_states", [place, state]))


def _add_hand(loop: LoopBuilder[SeaScenario], plant: MultibodyPlant, spec: HandSpec) -> OutputPort:
    """The hand on the link; its torque is a force from outside."""
    path = hand_path(spec, loop.scenario.duration, loop.scenario.dt)
    motion = behind(loop.builder, "hand_motion", TrajectorySource(path))
    torque = _pulled(loop, "hand", spec, motion, plant.get_state_output_port())
    loop.builder.Connect(torque, plant.get_applied_generalized_force_input_port())
    return torque


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


def simulate_sea(scenario: SeaScenario, progress: Progress | None = None) -> SeaRecording:
    """Build a scenario's joint, run it, and return what was logged.

    Args:
        scenario: What to run.
        progress: Told what is done and which share.

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

    The position is the motor's: what passes the gear turns with it, and the spring is behind the torque sensor. The
    voltage is what reached the motor: as sent, `delay` later, and 0 before that.

    Raises:
        LogError: a file that cannot be written.
    """
    joint, ticks = recording.scenario.joint, round(recording.scenario.delay / recording.scenario.dt)
    columns = {
        "time": recording.time,
        f"{joint}/position": recording["motor_encoder"],
        f"{joint}/voltage": np.concatenate([np.zeros(ticks), recording["voltage"]])[: recording.time.size],
        f"{joint}/torque": recording["torque_sensor"],
    }
    inertia = recording.scenario.controller_actuator().inertia
    rig = {"joints": [joint], "drive": "voltage", "load": "torque", "declared": {joint: {"rotor_inertia": inertia}}}
    return [write_log(columns, folder / f"log.{ending}"), write_rig(rig, folder / "rig.yaml")]
