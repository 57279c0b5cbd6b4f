"""`add_whole_body_loop`: robust TSID around the plant of a legged robot, in one call.

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

`state: plant` hands the plant's own state to the controller, `torque: direct` its torques to the joints. The loop of
Faraji, Colasanto and Ijspeert (2015) is `state: base_estimator` with `torque: series_elastic`.

Torques that err: e ~ N(0, Sigma), drawn anew every `period`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem, OutputPort, System
from pydrake.systems.primitives import Adder, TrajectorySource
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.control.reference_source import StoppingReference
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import WiredLoop
from drake_tc.loops.fused import FusedStages, StageValues
from drake_tc.loops.plant import require_live_ports
from drake_tc.loops.scenarios.base import SEEDS
from drake_tc.loops.whole_body.base_estimation import base_state
from drake_tc.loops.whole_body.drives import add_drives
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.loops.whole_body.sensor_validation import ValidatedSensors, add_flags, add_sensor_validation, stopped
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, add_whole_body_sensors, estimated_state
from drake_tc.loops.whole_body.series_elastic_drives import (
    SpringDrives,
    Start,
    add_spring_drives,
    control_springs,
    link_position,
)
from drake_tc.sensing.suite import SensorSuite
from drake_tc.tsid.controller import RobustTsid, reference_port
from drake_tc.tsid.law import Law
from drake_tc.tsid.robust.options import TorqueError
from drake_tc.types import FloatArray


class TorqueNoise(LeafSystem):
    """A torque error e = scale L zeta, zeta ~ N(0, I), L L^T = Sigma; held for `period`.

    Output:
        torque_error (n): e[k] [N m]; follows the state alone.
    State: e (n), k.  e[k], zeta[k] a function of (seed, k): the stream is counter-based, so it has no memory.
    """

    def __init__(self, error: TorqueError, period: float, seed: int, scale: float = 1.0) -> None:
        """Declare the port.

        Args:
            error: Sigma.
            period: How long a draw lasts [s].
            seed: Of the draws, from 0 to 2^64 - 1.
            scale: On e.

        Raises:
            ParamsError: a period that is not positive, or a seed that is not possible.
        """
        super().__init__()
        if not (np.isfinite(period) and period > 0.0):
            raise ParamsError(f"torque noise: expected a positive period [s], got {period!r}")
        if not 0 <= seed < SEEDS:
            raise ParamsError(f"torque noise: expected a seed from 0 to 2^64 - 1, got {seed}")
        self._root, self._seed = scale * error.root, seed
        first: Any = self._draw(0)
        now = self.DeclareDiscreteState(first)
        zero: Any = np.zeros(1)
        count = self.DeclareDiscreteState(zero)
        self._now, self._count = int(now), int(count)
        self.DeclareStateOutputPort("torque_error", now)
        self.DeclarePeriodicDiscreteUpdateEvent(period, period, self._update)

    def _draw(self, tick: int) -> FloatArray:
        """e[k]."""
        key = np.array([self._seed, tick], dtype=np.uint64)
        zeta = np.random.Generator(np.random.Philox(key=key)).standard_normal(self._root.shape[1])
        return np.asarray(self._root.dot(zeta))

    def _update(self, context: Any, values: DiscreteValues) -> None:
        """The next e."""
        new: Any = values
        tick = int(context.get_discrete_state(self._count).value()[0]) + 1
        new.set_value(self._now, self._draw(tick))
        new.set_value(self._count, np.array([float(tick)]))


OUTPUTS = ("torque", "acceleration", "contact_force", "status")
"""Ports of the controller that are signals of the loop."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WholeBodyLoop(WiredLoop):
    """A whole-body loop in a diagram.

    Stages: `tsid`, and as far as there are such stages `standing_state`, `base_estimator`, `torque_estimator`,
    `torque_control`, `guard`, `actuators`. Signals: `state` [q; v] of the plant, `estimated_state`, `torque`,
    `acceleration`, `contact_force`, `status`, `applied_torque`, and more; `flags` with sensor validation.

    Attributes:
        sensors: Encoders, IMU, F/T sensors; None where nothing is sensed.
        starts: Put parts of the diagram's context where the robot starts, in this order.
    """

    sensors: SensorSuite | None
    starts: tuple[Start, ...]

    def start(self, context: Context, stages: FusedStages | None = None) -> None:
        """Put estimators and drives where a robot that has stood for long has them.

        Args:
            context: Of the whole diagram.
            stages: What `fuse` returned for the loop's builder; None where it was not called.
        """
        values = StageValues(context, stages)
        for start in self.starts:
            start(values)


def add_whole_body_loop(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    law: Law,
    spec: WholeBodySpec | None = None,
    *,
    models: Models | None = None,
    controller_models: Models | None = None,
    references: Mapping[str, System | Trajectory] | None = None,
    contacts: OutputPort | None = None,
    stages: Mapping[str, System] | None = None,
    between: Mapping[str, System] | None = None,
) -> WholeBodyLoop:
    """Add controller, and as `spec` says sensors, estimation and drives, to a plant, and connect all of them.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant of the law's robot with live ports, on its floor.
        law: Of the controller, from `load_law`.
        spec: What stands between controller and robot; None: its state is known, its torques go to the joints.
        models: Of the simulated drives; needed unless `torque` is "direct".
        controller_models: What their torque control takes the drives for; None: what they are.
        references: Task to a system whose output it follows, or to a trajectory of its place; others rest.
        contacts: (contacts) 1 where the controller stands on one, else 0; None: it stands on all of them.
        stages: Stage to a system of your own in its place, as in `add_torque_loop`; `tsid` needs the input
            `estimated_state` and the outputs of `OUTPUTS`.
        between: "stage.port" to a system of your own behind that output port.

    Raises:
        ParamsError: a plant that is not finalized or whose ports are sampled, models that are missing, or a stage or
            place that the loop does not have.

    Example:
        >>> law = load_law(MODELS / "hrp2_like" / "hrp2_like_tsid.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, law.model.robot)
        >>> loop = add_whole_body_loop(builder, plant, law)
        >>> loop.signals["torque"].size() == law.model.n
        True
    """
    require_live_ports(plant)
    spec = WholeBodySpec() if spec is None else spec
    robot = law.model.robot
    touched = plant.get_generalized_contact_forces_output_port(plant.GetModelInstanceByName(robot.name))
    named = [None if m is None else _by_joint(m, law) for m in (models, controller_models or models)]
    wiring = WholeBodyBuilder(
        builder,
        spec,
        plant,
        law.period,
        {"state": plant.get_state_output_port(), "contact": touched},
        stages=stages or {},
        between=between or {},
        law=law,
        models=named[0],
        controller_models=named[1],
    )
    sensed = spec.state != "plant" or spec.torque == "drives"
    sensors = add_whole_body_sensors(wiring) if sensed else None
    springs = add_spring_drives(wiring) if spec.torque == "series_elastic" else None
    wiring.add("tsid", lambda: RobustTsid(law))
    _connect_references(wiring, references or {}, contacts)
    starts = _close(wiring, sensors, springs, contacts)
    wiring.check_own_systems()
    return WholeBodyLoop(
        systems=wiring.systems,
        sensors=sensors,
        signals=wiring.signals,
        flag_names=wiring.flag_names,
        period=law.period,
        starts=tuple(starts),
    )


def _by_joint(models: Models, law: Law) -> dict[str, Any]:
    joints = law.model.robot.joints
    return dict(zip(joints, model_list(models, joints), strict=True))


def _close(
    wiring: WholeBodyBuilder, sensors: SensorSuite | None, springs: SpringDrives | None, contacts: OutputPort | None
) -> list[Start]:
    """State to the controller, its torques to the robot; what has to be started."""
    validated = _validated(wiring, sensors, springs, contacts)
    position = None
    if validated is not None:
        sensors, springs, contacts = validated.sensors, validated.springs, validated.contacts
        position = validated.position
    elif springs is not None and sensors is not None:
        position = link_position(wiring, springs, sensors.encoder.GetOutputPort("reading"))
    state, starts = _known_state(wiring, sensors, position, contacts)
    torque = _with_error(wiring, wiring.output("tsid", "torque"))
    if validated is not None:
        state, springs, torque = stopped(wiring, validated, state, torque)
    wiring.connect("tsid", "estimated_state", state)
    starts += _apply_torque(wiring, sensors, springs, torque, state)
    tsid = wiring.systems["tsid"]
    wiring.signals |= {name: wiring.output("tsid", name) for name in OUTPUTS if tsid.HasOutputPort(name)}
    if validated is not None:
        wiring.flag_names = add_flags(wiring, validated)
    return starts


def _connect_references(
    wiring: WholeBodyBuilder, references: Mapping[str, System | Trajectory], contacts: OutputPort | None
) -> None:
    """What moves; what does not stays as the controller has it. The contacts that carry, if they change."""
    wiring.references = tuple(references)
    for name, given in references.items():
        source: Any = TrajectorySource(given, 2) if isinstance(given, Trajectory) else given
        port = reference_port(name)
        if wiring.scenario.validated:
            source = StoppingReference(source, wiring.period)
        added = wiring.builder.AddNamedSystem(port, source)
        wiring.connect("tsid", port, added.get_output_port())
    if contacts is not None:
        wiring.connect("tsid", "active_contacts", contacts)


def _apply_torque(
    wiring: WholeBodyBuilder,
    sensors: SensorSuite | None,
    springs: SpringDrives | None,
    torque: OutputPort,
    state: OutputPort,
) -> list[Start]:
    """The torques on their way to the joints: directly, or through drives; what has to be started for it."""
    if springs is not None:
        return [control_springs(wiring, springs, torque)]
    if sensors is not None and wiring.scenario.torque == "drives":
        add_drives(wiring, sensors, torque, state)
    else:
        wiring.signals["applied_torque"] = torque
        wiring.builder.Connect(torque, wiring.plant.get_actuation_input_port())
    return []


def _validated(
    wiring: WholeBodyBuilder, sensors: SensorSuite | None, springs: SpringDrives | None, contacts: OutputPort | None
) -> ValidatedSensors | None:
    """The checks of the sensors, where the scenario has them."""
    if sensors is None or springs is None or not wiring.scenario.validated:
        return None
    return add_sensor_validation(wiring, sensors, springs, contacts)


def _known_state(
    wiring: WholeBodyBuilder, sensors: SensorSuite | None, position: OutputPort | None, contacts: OutputPort | None
) -> tuple[OutputPort, list[Start]]:
    """[q; v] as the controller gets it, and what has to be started for it; joints' encoders where no `position` is."""
    if sensors is None or wiring.scenario.state == "plant":
        return wiring.plant.get_state_output_port(), []
    position = sensors.encoder.GetOutputPort("reading") if position is None else position
    starts: list[Start] = []
    if wiring.scenario.state == "base_estimator":
        state, start = base_state(wiring, sensors, position, contacts)
        starts.append(start)
    else:
        state = estimated_state(wiring, sensors, contacts)
    wiring.signals["estimated_state"] = state
    return state, starts


def _with_error(wiring: WholeBodyBuilder, torque: OutputPort) -> OutputPort:
    """The torques with the errors on them that the spec asks for."""
    spec, law, builder = wiring.scenario.torque_error, wiring.law, wiring.builder
    if spec is None:
        return torque
    noise = builder.AddNamedSystem("torque_noise", TorqueNoise(law.error, spec.hold, wiring.scenario.seed, spec.scale))
    total = builder.AddNamedSystem("erring_torque", Adder(2, law.model.n))
    for number, port in enumerate((torque, noise.get_output_port())):
        builder.Connect(port, total.get_input_port(number))
    return total.get_output_port()
