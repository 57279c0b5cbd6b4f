"""`sliding`: actuator models as a linear analysis takes them, in steady sliding."""

from dataclasses import replace

from drake_tc.actuation.joint_values import Models, models_by_joint
from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.errors import ParamsError

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
