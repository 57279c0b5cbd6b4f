"""The stages that undo delay and disturbance: model filter, disturbance observer, delay predictor."""

from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import OutputPort
from pydrake.systems.primitives import Demultiplexer

from drake_tc.estimation.delay_predictor import DelayPredictor
from drake_tc.estimation.disturbance_observer import DisturbanceObserver, ObserverSpec
from drake_tc.estimation.joint_torque import JointTorqueEstimator
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.torque.builder import TorqueLoopBuilder
from drake_tc.loops.torque.ports import base_now, zeroed


def prediction(
    parts: TorqueLoopBuilder, delayed: Mapping[str, OutputPort]
) -> tuple[dict[str, OutputPort], DisturbanceObserver | None]:
    """What is known of the joints now, for inverse dynamics and torque control.

    Args:
        parts: Of the loop.
        delayed: `joint_estimate`, `estimated_torque` and `position` as filters, estimator and encoders have them.

    Returns:
        The same ports, predicted where the scenario has a predictor, with `disturbance` where it has an observer; and
        the observer, which both need, to be connected later.
    """
    scenario, builder = parts.scenario, parts.builder
    if scenario.predictor is None and scenario.observer is None:
        return dict(delayed), None
    n, dt = len(parts.robot.joints), scenario.dt
    spec = scenario.observer or ObserverSpec()
    forward = scenario.compensation.acceleration == "reference"
    system = DisturbanceObserver(
        parts.controller_robot, parts.models, spec, dt, rotor_inertia=scenario.rotor_inertia, fed_forward=forward
    )
    observer = parts.add("disturbance_observer", system)
    parts.signals["disturbance"] = observer.GetOutputPort("disturbance")
    known = dict(delayed)
    if scenario.observer is not None:
        known["disturbance"] = observer.GetOutputPort("compensation")
    if scenario.predictor is not None:
        wires = {name: observer.GetOutputPort(name) for name in ("link_torque", "motion", "fault")} | dict(delayed)
        predictor = parts.add("delay_predictor", DelayPredictor(n, scenario.predictor, dt), **wires)
        smooth = SavitzkyGolayFilter(n, scenario.filters.window, scenario.filters.encoder_order, dt)
        parts.add("model_filter", smooth, signal=predictor.GetOutputPort("model_torque"))
        builder.Connect(smooth.GetOutputPort("value"), predictor.GetInputPort("delayed_model_torque"))
        known |= {name: predictor.GetOutputPort(name) for name in delayed}
        parts.signals["predicted_torque"] = predictor.GetOutputPort("estimated_torque")
    return known, observer


def live_torque(parts: TorqueLoopBuilder, observer: DisturbanceObserver) -> JointTorqueEstimator:
    """A torque estimate of this tick, from raw readings (the F/T sensors zeroed) and the observer's motion."""
    builder = parts.builder
    delayed: Any = builder.GetSubsystemByName("torque_estimator")
    wires = {"joint_estimate": observer.GetOutputPort("motion")}
    if parts.base_from == "imu":
        wires["imu_estimate"] = base_now(parts)
    if parts.sensors.force_torque is not None:
        wires["wrench_estimate"] = parts.sensors.force_torque.GetOutputPort("reading")
        if builder.HasSubsystemNamed("wrench_tare"):
            wires["wrench_estimate"] = zeroed(parts, "live_wrench", wires["wrench_estimate"])
    return parts.add("live_torque", JointTorqueEstimator(delayed.model), **wires)  # type: ignore[no-any-return]


def connect_observer(
    parts: TorqueLoopBuilder,
    observer: DisturbanceObserver,
    delayed: Mapping[str, OutputPort],
    known: Mapping[str, OutputPort],
    reference: OutputPort,
    sent: OutputPort,
) -> None:
    """Wire the observer to what is made behind it: it reads all of it for its next state only.

    Args:
        parts: Of the loop.
        observer: From `prediction`.
        delayed: As there.
        known: From there.
        reference: Desired motion.
        sent: What leaves the guard.
    """
    n, builder, scenario = len(parts.robot.joints), parts.builder, parts.scenario
    spec = scenario.observer or ObserverSpec()
    feedforward = parts.output("inverse_dynamics", "feedforward_torque")
    wires = dict(delayed) | {name: parts.output("torque_control", name) for name in ("commanded_torque", "command")}
    estimated = scenario.compensation.velocity == "estimate"
    wires["compensated_motion"] = known["joint_estimate"] if estimated else reference
    wires |= {"feedforward_torque": feedforward, "reference": reference, "sent_command": sent}
    split = builder.AddNamedSystem("reference_acceleration", Demultiplexer([2 * n, n]))
    builder.Connect(reference, split.get_input_port())
    wires["delayed_reference"] = parts.join("model_signals", [feedforward, split.get_output_port(1)])
    estimator: Any = builder.GetSubsystemByName("torque_estimator")
    if spec.torque == "live":
        wires["joint_estimate"] = observer.GetOutputPort("motion")
        estimator = live_torque(parts, observer)
        wires["estimated_torque"] = estimator.GetOutputPort("estimated_torque")
    else:
        filters = scenario.filters
        at = None if spec.delay is None else filters.window - 1 - spec.delay / scenario.dt
        smooth = SavitzkyGolayFilter(2 * n, filters.window, filters.encoder_order, scenario.dt, at)
        parts.add("reference_filter", smooth, signal=wires["delayed_reference"])
        wires["delayed_reference"] = smooth.GetOutputPort("value")
    wires["torque_fault"] = estimator.GetOutputPort("fault")
    for name, port in wires.items():
        builder.Connect(port, observer.GetInputPort(name))
