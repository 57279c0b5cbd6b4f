"""Put actuator models in front of a MultibodyPlant: rotor inertias, order of the joints, connections.

`sliding`: actuator models as a linear analysis takes them, in steady sliding.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Selector, SelectorParams

from drake_tc.actuation.joint_effects import JointValues, Models, joint_values, models_by_joint
from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.actuation.plant import ActuatorPlant
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


def actuated_joints(plant: MultibodyPlant) -> list[str]:
    """Names of the actuated joints, in the order of the plant's actuation vector."""
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    return [actuator.joint().name() for actuator in sorted(actuators, key=lambda a: int(a.input_start()))]


def _model_of(actuator: JointActuator, models: Mapping[str, ActuatorModel]) -> ActuatorModel:
    joint = actuator.joint().name()
    if joint not in models:
        raise ParamsError(f"no actuator model for joint {joint!r}; models: {', '.join(sorted(models))}")
    return models[joint]


def add_joint_actuators(plant: MultibodyPlant, models: Models, effort_limit: JointValues = np.inf) -> None:
    """Give a plant that is not finalized a JointActuator for each model's joint, in the order of the models.

    A `Parser` adds actuators only where a URDF has `<transmission>` elements (an SDF, effort limits). Joints that have
    an actuator already keep it. `add_robot` needs no such call.

    Args:
        plant: Not finalized; holds the joints.
        models: By joint, or a list of models that name their joints.
        effort_limit: [N m] of the actuators.

    Raises:
        ParamsError: a plant that is finalized, or a joint that is not there.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> plant = MultibodyPlant(1e-3)
        >>> _ = Parser(plant).AddModels(robot.urdf)
        >>> add_joint_actuators(plant, load_models(robot.actuators), effort_limit=100.0)
        >>> plant.num_actuators()
        6
    """
    if plant.is_finalized():
        raise ParamsError("add_joint_actuators: the plant is finalized already; call this before plant.Finalize()")
    by_joint = models_by_joint(models)
    known = {plant.get_joint(index).name() for index in plant.GetJointIndices()}
    actuated = {plant.get_joint_actuator(index).joint().name() for index in plant.GetJointActuatorIndices()}
    limits = joint_values("effort_limit", effort_limit, list(by_joint))
    for joint, limit in zip(by_joint, limits.tolist(), strict=True):
        if joint not in known:
            raise ParamsError(f"models: the plant has no joint {joint!r}; joints: {', '.join(sorted(known))}")
        if joint not in actuated:
            plant.AddJointActuator(joint, plant.GetJointByName(joint), limit)


def require_actuators(plant: MultibodyPlant) -> None:
    """Refuse a plant that no actuator model can drive, and say what to do.

    Raises:
        ParamsError: the plant is not finalized, or has no JointActuator.
    """
    if not plant.is_finalized():
        raise ParamsError("plant: expected a finalized plant; call plant.Finalize() first")
    if not plant.num_actuators():
        raise ParamsError(
            "plant: it has no joint actuators, because a Parser adds them only for <transmission> elements of the URDF;"
            " call drake_tc.add_joint_actuators(plant, models) before plant.Finalize(), or build the plant with"
            " drake_tc.add_robot"
        )


def apply_rotor_inertia(plant: MultibodyPlant, models: Models) -> None:
    """Give each actuated joint its model's reflected inertia (rotor and payload), with gear ratio 1.

    A joint with a TransmissionEffect gets none: its motor moves on its own, in the ActuatorPlant. Call it after
    `Finalize` and before contexts are made.

    Args:
        plant: Finalized plant.
        models: One for every actuated joint, by joint or a list of models that name their joints.

    Raises:
        ParamsError: an actuated joint has no model.
    """
    by_joint = models_by_joint(models)
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_mutable_joint_actuator(index)
        model = _model_of(actuator, by_joint)
        actuator.set_default_gear_ratio(1.0)
        actuator.set_default_rotor_inertia(0.0 if model.transmission_effects else model.inertia)


def joint_inertias(plant: MultibodyPlant) -> FloatArray:
    """(n,) [kg m^2] 1/(M^-1)_jj at the default configuration: what the torque of one actuator alone moves."""
    selector = plant.MakeActuationMatrix()
    mass = plant.CalcMassMatrix(plant.CreateDefaultContext())
    return np.asarray(1.0 / np.diag(selector.T @ np.linalg.solve(mass, selector)))


def add_actuators(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    models: Models,
    dt: float = 1e-3,
    inertias: JointValues | None = None,
) -> ActuatorPlant:
    """Add an ActuatorPlant to the builder and wire it to a plant that is already in it.

    Sets the plant's rotor inertias (`apply_rotor_inertia`), connects the joints' state and the actuation. Left to the
    caller: `command`, and where they are desired `temperature`, `supply_voltage` and `load_torque`.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant.
        models: One for every actuated joint, by joint or a list of models that name their joints.
        dt: Period of the actuators [s].
        inertias: What each torque moves [kg m^2], (n,) in actuator order or by joint; None takes `joint_inertias`.

    Returns:
        The system.

    Raises:
        ParamsError: the plant has no actuators, an actuated joint has no model, or a joint of no single degree of
            freedom is actuated.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, robot)
        >>> add_actuators(builder, plant, load_models(robot.actuators)).get_command_input_port().size()
        6
    """
    require_actuators(plant)
    apply_rotor_inertia(plant, models)
    names, by_joint = actuated_joints(plant), models_by_joint(models)
    moved = joint_inertias(plant) if inertias is None else joint_values("inertias", inertias, names)
    system = ActuatorPlant([by_joint[name] for name in names], dt, moved)
    builder.AddNamedSystem("actuators", system)
    state = plant.get_state_output_port()
    selector = plant.MakeStateSelectorMatrix([plant.GetJointByName(name).index() for name in names])
    if not np.array_equal(selector, np.eye(state.size())):
        pick = builder.AddNamedSystem("joint_state", MatrixGain(selector))
        builder.Connect(state, pick.get_input_port())
        state = pick.get_output_port()
    builder.Connect(state, system.GetInputPort("state"))
    actuation = builder.AddNamedSystem("actuation", _actuation_of(system))
    builder.Connect(system.GetOutputPort("step"), actuation.get_input_port(0))
    builder.Connect(actuation.get_output_port(0), plant.get_actuation_input_port())
    return system


def _actuation_of(system: ActuatorPlant) -> Selector:
    """The port `actuation` out of `step`, without another call into Python."""
    params = SelectorParams()
    params.inputs = [SelectorParams.InputPortParams(name="step", size=system.GetOutputPort("step").size())]
    pick = SelectorParams.OutputSelection
    places = [pick(input_port_index=0, input_offset=i) for i in system.actuation_places]
    params.outputs = [SelectorParams.OutputPortParams(name="actuation", selections=places)]
    return Selector(params)


LINEAR = ("viscous", "rotor_inertia")
"""Effects that are linear in sliding; dry friction and dead zone are constants there."""


def sliding(models: Models, direction: float = 0.0) -> dict[str, ActuatorModel]:
    """The models, by joint, that hold only what is linear while the joints slide.

    In steady sliding dry friction is a constant torque and the dead zone is passed, so neither is in the linear system.
    A drive whose gain depends on the direction (`velocity_sign_switch`, share s) has the gain of that direction,
    K/(1 + direction s). Build the loop with these models, as plant and as controller, and give it to `linearise`.

    Args:
        models: By joint, or in order.
        direction: Of the motion, 1 or -1; 0 takes the mean gain of drives that switch with it.

    Raises:
        ParamsError: models that are none, or another direction.

    Example:
        >>> switch = EffectValue("velocity_sign_switch", {"switch": 0.25})
        >>> dry = EffectValue("coulomb", {"coulomb": 2.0})
        >>> knee = ActuatorModel("knee", Drive("current", 0.5), (EffectValue("viscous", {"viscous": 0.3}), dry, switch))
        >>> linear = sliding([knee], direction=1.0)["knee"]
        >>> linear.drive.gain, [value.key for value in linear.effects]
        (0.4, ['viscous'])
    """
    if direction not in (-1.0, 0.0, 1.0):
        raise ParamsError(f"sliding: expected a direction of 1, -1 or 0, got {direction!r}")
    return {joint: _in_sliding(model, direction) for joint, model in models_by_joint(models).items()}


def _in_sliding(model: ActuatorModel, direction: float) -> ActuatorModel:
    switch = next((v.parameters["switch"] for v in model.effects if v.key == "velocity_sign_switch"), 0.0)
    gain = model.drive.gain / (1.0 + direction * switch)
    effects = tuple(value for value in model.effects if value.key in LINEAR)
    return replace(model, drive=Drive(model.drive.kind, gain), effects=effects)
