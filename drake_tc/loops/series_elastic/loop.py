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
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Demultiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.recorded_run import Link
from drake_tc.control.series_elastic import SeriesElasticControl
from drake_tc.errors import SimulationError
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.joint_bench import JOINT, make_plant
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.recording import Progress, Recording, write_log, write_rig
from drake_tc.loops.series_elastic.scenario import HandSpec, ReferenceSpec, SeaScenario, spring_compliance
from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop
from drake_tc.types import FloatArray


class Hand(LeafSystem):
    """torque = k (q_h - q) + d (q'_h - q'), on the link.

    Inputs: state (2): [q; q'] of the link; motion (2): [q_h; q'_h].
    Output, with direct feedthrough, no state: torque (1) [N m].
    """

    def __init__(self, stiffness: float, damping: float) -> None:
        """Declare ports; [N m/rad], [N m s/rad]."""
        super().__init__()
        self._gains = np.array([stiffness, damping])
        self._state: Any = self.DeclareVectorInputPort("state", 2)
        self._motion: Any = self.DeclareVectorInputPort("motion", 2)
        self.DeclareVectorOutputPort("torque", 1, self._write, {self._state.ticket(), self._motion.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        vector.SetAtIndex(0, float(self._gains @ (self._motion.Eval(context) - self._state.Eval(context))))


class PositionLoop(LeafSystem):
    """tau_ref = M q''_d + m g l sin q_d + k (q_d - q) + d (q'_d - q'), of one link.

    Inputs: state (2): [q; q'] of the link, as known; motion (3): [q_d; q'_d; q''_d].
    Output, with direct feedthrough, no state: torque (1) [N m].
    """

    def __init__(self, link: Link, stiffness: float, damping: float) -> None:
        """Declare ports; gains [N m/rad], [N m s/rad]."""
        super().__init__()
        self._link, self._gains = link, np.array([stiffness, damping])
        self._state: Any = self.DeclareVectorInputPort("state", 2)
        self._motion: Any = self.DeclareVectorInputPort("motion", 3)
        self.DeclareVectorOutputPort("torque", 1, self._write, {self._state.ticket(), self._motion.ticket()})

    def _write(self, context: Context, vector: BasicVector) -> None:
        motion = self._motion.Eval(context)
        carried = self._link.inertia * motion[2] + self._link.gravity_moment * np.sin(motion[0])
        vector.SetAtIndex(0, float(carried + self._gains @ (motion[:2] - self._state.Eval(context))))


class LinkState(LeafSystem):
    """The link behind the spring as the fine encoder and the gauge tell it, every dt.

        y = theta - c tau,   v[n+1] = v[n] + SHARE (z[n] - v[n]),   z[n] = (y[n] - y[n-1])/dt

    Inputs: motor_angle (1) [rad]; torque (1) [N m].
    Output: state (2): [y; v'], v' the speed with this tick's z in it; feeds through.
    State: y, v of the last tick, and whether there was one.
    """

    SHARE = 0.2

    def __init__(self, compliance: float, dt: float) -> None:
        """Declare ports and state; c of the spring [rad/(N m)], period [s]."""
        super().__init__()
        self._compliance, self._dt = compliance, dt
        self._angle: Any = self.DeclareVectorInputPort("motor_angle", 1)
        self._torque: Any = self.DeclareVectorInputPort("torque", 1)
        index = self.DeclareDiscreteState(3)
        self._last = int(index)
        tickets = {self._angle.ticket(), self._torque.ticket(), self.discrete_state_ticket(index)}
        self.DeclareVectorOutputPort("state", 2, self._write, tickets)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _now(self, context: Any) -> tuple[float, float]:
        y = float(self._angle.Eval(context)[0] - self._compliance * self._torque.Eval(context)[0])
        last, speed, started = context.get_discrete_state(self._last).value().tolist()
        return y, speed + self.SHARE * ((y - last) / self._dt - speed) if started > 0.5 else 0.0

    def _write(self, context: Context, vector: BasicVector) -> None:
        now: Any = np.array(self._now(context))
        vector.SetFromVector(now)

    def _update(self, context: Context, values: Any) -> None:
        values.set_value(self._last, np.array([*self._now(context), 1.0]))


def reference_path(spec: ReferenceSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """The reference torque or angle (1), exact at the ticks, with two derivatives."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    rise = smooth_step((time - spec.begin) / spec.ramp)
    phase = 2.0 * np.pi * spec.frequency_hz * (time - spec.begin)
    values = rise * (spec.offset + spec.amplitude * np.sin(phase))
    make: Any = PiecewisePolynomial.CubicWithContinuousSecondDerivatives
    path: PiecewisePolynomial = make(time, values[None, :], np.zeros(1), np.zeros(1))
    return path


def hand_path(spec: HandSpec, duration: float, dt: float) -> PiecewisePolynomial:
    """(2) [q_h; q'_h]: straight lines whose corners are rounded by a running mean over `rounding`."""
    time = np.arange(round(duration / dt) + 3, dtype=np.float64) * dt
    if not spec.times:
        return _path(PiecewisePolynomial.ZeroOrderHold, np.array([0.0, duration + 1.0]), np.zeros((2, 2)))
    fine = np.linspace(-0.5, 0.5, 41) * spec.rounding
    values = np.mean([np.interp(time + shift, spec.times, spec.knots) for shift in fine], axis=0)
    both: Any = np.stack([values, np.gradient(values, dt)])
    return _path(PiecewisePolynomial.FirstOrderHold, time, both)


def _path(make: Any, time: Any, values: Any) -> PiecewisePolynomial:
    path: PiecewisePolynomial = make(time, values)
    return path


def smooth_step(x: FloatArray) -> FloatArray:
    """0 before 0, 1 after 1, 10 x^3 - 15 x^4 + 6 x^5 between: two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))


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
    """The reference torque, and with a position loop the reference acceleration of the link."""
    scenario, builder = loop.scenario, loop.builder
    spec = scenario.reference
    path = reference_path(spec, scenario.duration, scenario.dt)
    if spec.of == "torque":
        torque: OutputPort = builder.AddNamedSystem("reference", TrajectorySource(path)).get_output_port()
        builder.Connect(torque, control.GetInputPort("reference_torque"))
        return torque
    source = builder.AddNamedSystem("reference", TrajectorySource(path, 2))
    readings = {"motor_angle": loop.signals["motor_encoder"], "torque": loop.signals["torque_sensor"]}
    known = LinkState(spring_compliance(scenario.controller_actuator()), scenario.dt)
    loop.add("link_state", known, **readings)
    position_loop = loop.add(
        "position_loop",
        PositionLoop(scenario.link, spec.stiffness, spec.damping),
        motion=source.get_output_port(),
        state=known.get_output_port(),
    )
    parts = builder.AddNamedSystem("reference_parts", Demultiplexer([2, 1]))
    builder.Connect(source.get_output_port(), parts.get_input_port())
    builder.Connect(parts.get_output_port(1), control.GetInputPort("reference_acceleration"))
    builder.Connect(position_loop.get_output_port(), control.GetInputPort("reference_torque"))
    loop.signals["reference_motion"] = source.get_output_port()
    port: OutputPort = position_loop.get_output_port()
    return port


def _add_hand(loop: LoopBuilder[SeaScenario], plant: MultibodyPlant, spec: HandSpec) -> OutputPort:
    """The hand on the link; its torque is a force from outside."""
    motion = loop.builder.AddNamedSystem(
        "hand_motion", TrajectorySource(hand_path(spec, loop.scenario.duration, loop.scenario.dt))
    )
    hand = loop.add(
        "hand",
        Hand(spec.stiffness, spec.damping),
        motion=motion.get_output_port(),
        state=plant.get_state_output_port(),
    )
    loop.builder.Connect(hand.get_output_port(), plant.get_applied_generalized_force_input_port())
    port: OutputPort = hand.get_output_port()
    return port


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
