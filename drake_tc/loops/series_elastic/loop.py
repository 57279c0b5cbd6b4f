"""One voltage-driven series-elastic joint under torque control (Faraji et al., 2015): held, moved by a hand, or free.

The wiring is that of `add_series_elastic_loop` (`drake_tc.loops.series_elastic.wiring`); this file adds the link, the
hand and the reference. `reference: {of: position}` puts a soft position loop around it, whose link speed comes from
the motor's encoder minus the spring's deflection.

What acts on the joint from outside: the hand, and the reference.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Demultiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.actuation.recorded_run import Link
from drake_tc.control.series_elastic.control import SeriesElasticControl
from drake_tc.loops.built_loop import BuiltLoop
from drake_tc.loops.joint_bench.diagram import JOINT, make_plant
from drake_tc.loops.loop_builder import LoopBuilder
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


def build_sea(scenario: SeaScenario, *, meshcat: bool = False) -> SeaLoop:
    """Build the diagram of a scenario.

    Args:
        scenario: What to build.
        meshcat: Not of use here: the joint has no shape.

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
