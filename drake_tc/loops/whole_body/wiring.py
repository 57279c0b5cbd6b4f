"""`add_whole_body_loop`: robust TSID around the plant of a legged robot, in one call.

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

`state: plant` hands the plant's own state to the controller, `torque: direct` its torques to the joints. The loop of
Faraji, Colasanto and Ijspeert (2015) is `state: base_estimator` with `torque: series_elastic`.

All from the readings to the commands is wired by `add_whole_body_control`, which `drake_tc.loops.whole_body.controller`
calls for a controller without a plant.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import MatrixGain
from pydrake.trajectories import Trajectory

from drake_tc.actuation.joint_values import Models, model_list
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.actuation.wiring import add_actuators
from drake_tc.loops.boundary import Start
from drake_tc.loops.built_loop import WiredLoop
from drake_tc.loops.fused import FusedStages, StageValues
from drake_tc.loops.plant import require_live_ports
from drake_tc.loops.whole_body.control import WholeBodyControl, add_whole_body_control
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.loops.whole_body.sensors import WholeBodyBuilder, add_whole_body_sensors, check_rotors, required_models
from drake_tc.loops.whole_body.series_elastic_drives import add_spring_drives, drive_springs
from drake_tc.sensing.suite import SensorSuite
from drake_tc.tsid.law import Law
from drake_tc.types import FloatArray


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
        ParamsError: a plant that is not finalized or whose ports are sampled, models that are missing or whose rotors
            are not those of the law, or a stage or place that the loop does not have.

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
    state = plant.get_state_output_port()
    if robot.followers:
        known, moved = _without_followers(plant, law)
        state, touched = (
            _product(builder, *each) for each in (("known_state", known, state), ("known_contact", moved, touched))
        )
    named = [None if m is None else by_joint(m, law) for m in (models, controller_models or models)]
    check_rotors(law, named[1])
    wiring = WholeBodyBuilder(
        builder,
        spec,
        plant,
        law.period,
        {"state": state, "contact": touched},
        stages=stages or {},
        between=between or {},
        law=law,
        models=named[0],
        controller_models=named[1],
    )
    sensed = spec.state != "plant" or spec.torque == "drives"
    sensors = add_whole_body_sensors(wiring, plant) if sensed else None
    readings = None if sensors is None else sensors.readings
    actuators, springs = add_spring_drives(wiring, plant) if spec.torque == "series_elastic" else (None, None)
    control = add_whole_body_control(wiring, readings, springs, references or {}, contacts)
    starts = [*control.starts, *_drive(wiring, plant, actuators, control)]
    return WholeBodyLoop(
        systems=wiring.systems,
        sensors=sensors,
        signals=wiring.signals,
        flag_names=wiring.flag_names,
        period=law.period,
        starts=tuple(starts),
    )


def _without_followers(plant: MultibodyPlant, law: Law) -> tuple[FloatArray, FloatArray]:
    """What the law's [q; v] is of the plant's, and its generalized forces of the plant's, where joints follow others.

    Args:
        plant: With the robot alone.
        law: Of the controller.
    """
    model, robot = law.model, law.model.robot
    whole: Any = plant
    positions, velocities = np.zeros(model.nq, dtype=int), np.zeros(model.nv, dtype=int)
    if not robot.fixed_base:
        body, (q, v) = whole.GetBodyByName(robot.base), model.base_places
        positions[q : q + 7] = body.floating_positions_start() + np.arange(7)
        velocities[v : v + 6] = body.floating_velocities_start_in_v() + np.arange(6)
    joints = [whole.GetJointByName(name) for name in robot.joints]
    positions[model.positions] = [joint.position_start() for joint in joints]
    velocities[model.actuated] = [joint.velocity_start() for joint in joints]
    known = np.eye(whole.num_multibody_states())[[*positions, *(whole.num_positions() + velocities)]]
    moved = np.eye(whole.num_velocities())[velocities]
    for name, follows in robot.followers.items():
        row = model.actuated[robot.joints.index(follows.of)]
        moved[row, whole.GetJointByName(name).velocity_start()] = follows.multiplier
    return known, moved


def _product(builder: DiagramBuilder, name: str, matrix: FloatArray, port: OutputPort) -> OutputPort:
    gain: Any = matrix
    system = builder.AddNamedSystem(name, MatrixGain(D=gain))
    builder.Connect(port, system.get_input_port())
    product: OutputPort = system.get_output_port()
    return product


def by_joint(models: Models, law: Law) -> dict[str, Any]:
    """Joint to its model, of models by joint or in the order of the robot's joints."""
    joints = law.model.robot.joints
    return dict(zip(joints, model_list(models, joints), strict=True))


def _drive(
    wiring: WholeBodyBuilder, plant: MultibodyPlant, actuators: ActuatorPlant | None, control: WholeBodyControl
) -> list[Start]:
    """The commands on their way to the joints: directly, or through drives; what has to be started for it."""
    if actuators is not None and control.springs is not None:
        return [drive_springs(wiring, actuators, control.springs)]
    if wiring.scenario.torque == "drives":
        models = required_models(wiring, "models")
        actuators = add_actuators(wiring.builder, plant, models, plant.time_step() or wiring.period)
        wiring.systems["actuators"] = actuators
        wiring.builder.Connect(control.command, actuators.GetInputPort("command"))
        wiring.signals["applied_torque"] = actuators.GetOutputPort("actuation")
    else:
        wiring.signals["applied_torque"] = control.command
        wiring.builder.Connect(control.command, plant.get_actuation_input_port())
    return []
