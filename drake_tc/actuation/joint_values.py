"""Arguments of several joints: models and numbers, by joint or in order."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

Models: TypeAlias = Mapping[str, ActuatorModel] | Sequence[ActuatorModel]
"""Actuator models by joint, as `load_models` returns them, or in the order of the joints."""
JointValues: TypeAlias = float | Sequence[float] | FloatArray | Mapping[str, float]
"""One number for all joints, one for each in order, or a mapping by joint."""


def model_list(models: Models, joints: Sequence[str] | None = None) -> tuple[ActuatorModel, ...]:
    """The models in the order of the joints.

    Args:
        models: By joint, or in order.
        joints: Order of a mapping; None takes the mapping's own.

    Raises:
        ParamsError: no model, something that is none, or a mapping without one of the joints.
    """
    if not len(models):
        raise ParamsError("models is empty; expected one actuator model per joint")
    if isinstance(models, Mapping):
        missing = [joint for joint in joints or () if joint not in models]
        if missing:
            raise ParamsError(f"models: no model of joint {missing[0]!r}; joints there: {', '.join(models)}")
        listed = tuple(models[joint] for joint in (models if joints is None else joints))
    else:
        listed = tuple(models)
        if joints is not None and len(listed) != len(joints):
            raise ParamsError(f"models: expected {len(joints)}, one per joint, got {len(listed)}")
    for model in listed:
        if not isinstance(model, ActuatorModel):
            raise ParamsError(f"models: expected actuator models, by joint or in a list, got {model!r}")
    return listed


def models_by_joint(models: Models) -> dict[str, ActuatorModel]:
    """The models by joint.

    Raises:
        ParamsError: as `model_list`; or two models of one joint.
    """
    if isinstance(models, Mapping):
        model_list(models)
        return dict(models)
    listed = model_list(models)
    by_joint = {model.joint: model for model in listed}
    if len(by_joint) < len(listed):
        raise ParamsError(f"models: expected one model per joint, got joints {', '.join(m.joint for m in listed)}")
    return by_joint


def joint_values(name: str, values: JointValues, joints: Sequence[str]) -> FloatArray:
    """(n,) numbers in the order of the joints; their range is checked by the caller.

    Args:
        name: Of the argument, for messages.
        values: One number for all joints, one for each in order, or a mapping by joint.
        joints: n names.

    Raises:
        ParamsError: another count, an unknown joint or one that is missing, or something that is no number.
    """
    if isinstance(values, Mapping):
        unknown = [joint for joint in values if joint not in joints]
        missing = [joint for joint in joints if joint not in values]
        if unknown or missing:
            problem = f"no joint {unknown[0]!r}" if unknown else f"no value of joint {missing[0]!r}"
            raise ParamsError(f"{name}: {problem}; joints: {', '.join(joints)}")
        values = [values[joint] for joint in joints]
    try:
        given = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParamsError(f"{name}: expected a number or {len(joints)} of them, got {values!r}") from None
    if given.shape not in ((), (len(joints),)):
        raise ParamsError(f"{name}: expected a number or {len(joints)} of them, got shape {given.shape}")
    return np.broadcast_to(given, (len(joints),)).copy()
