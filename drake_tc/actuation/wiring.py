"""Put actuator models in front of a MultibodyPlant: rotor inertias, order of the joints, connections."""

from collections.abc import Mapping

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain, Selector, SelectorParams

from drake_tc.actuation.model import ActuatorModel
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


def apply_rotor_inertia(plant: MultibodyPlant, models: Mapping[str, ActuatorModel]) -> None:
    """Give each actuated joint its model's reflected inertia (rotor and payload), with gear ratio 1.

    A joint with a TransmissionEffect gets none: its motor moves on its own, in the ActuatorPlant. Call it after
    `Finalize` and before contexts are made.

    Args:
        plant: Finalized plant.
        models: Joint name to model, one for every actuated joint.

    Raises:
        ParamsError: an actuated joint has no model.
    """
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_mutable_joint_actuator(index)
        model = _model_of(actuator, models)
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
    models: Mapping[str, ActuatorModel],
    dt: float = 1e-3,
    inertias: FloatArray | None = None,
) -> ActuatorPlant:
    """Add an ActuatorPlant to the builder and wire it to a plant that is already in it.

    Sets the plant's rotor inertias (`apply_rotor_inertia`), connects the joints' state and the actuation. Left to the
    caller: `command`, and where they are wanted `temperature`, `supply_voltage` and `load_torque`.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant.
        models: Joint name to model, one for every actuated joint.
        dt: Period of the actuators [s].
        inertias: (n,) what each torque moves [kg m^2]; None takes `joint_inertias`.

    Returns:
        The system.

    Raises:
        ParamsError: an actuated joint has no model, or a joint of no single degree of freedom is actuated.
    """
    apply_rotor_inertia(plant, models)
    names = actuated_joints(plant)
    moved = joint_inertias(plant) if inertias is None else inertias
    system = ActuatorPlant([models[name] for name in names], dt, moved)
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
