"""`JointInertia`: the links' mass matrix over the joints alone, at one configuration."""

from typing import Any

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import as_slice
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


class JointInertia:
    """M_jj(q) (n, n) [kg m^2]: what the joints' torques accelerate while the base moves as it does. Holds constants."""

    def __init__(self, robot: Robot) -> None:
        """Build the model, without rotors: those belong to the drives.

        Args:
            robot: Fixed or floating.

        Raises:
            ParamsError: the URDF cannot be read.
        """
        self._plant: Any = make_plant(robot, 0.0)
        joints = [self._plant.GetJointByName(name) for name in robot.joints]
        self._positions = as_slice(np.array([joint.position_start() for joint in joints]))
        velocities = as_slice(np.array([joint.velocity_start() for joint in joints]))
        self._pick = (velocities, velocities) if isinstance(velocities, slice) else np.ix_(velocities, velocities)
        self._size = len(joints)

    def create_context(self) -> Any:
        """Scratch memory of `mass`."""
        return self._plant.CreateDefaultContext()

    def mass(self, context: Any, q: FloatArray) -> FloatArray:
        """M_jj at q (n,) [rad], as a view into Drake's matrix or a copy.

        Args:
            context: From `create_context`.
            q: Joint positions, finite.
        """
        positions = self._plant.GetPositions(context)
        positions[self._positions] = q
        self._plant.SetPositions(context, positions)
        return np.asarray(self._plant.CalcMassMatrix(context)[self._pick])


def known_inertia(joints: tuple[str, ...], own: FloatArray, given: dict[str, float]) -> FloatArray:
    """(n,) [kg m^2] of the drives: what is given by joint, else the models' own.

    Args:
        joints: Names.
        own: (n,) of the drives' models; 0 where they have none.
        given: Joint to inertia, from motor and gear data sheets.

    Raises:
        ParamsError: a joint that is not there, one without inertia, or a value that is no positive number.
    """
    for joint, value in given.items():
        if joint not in joints:
            raise ParamsError(f"rotor_inertia: no joint {joint!r}; joints: {', '.join(joints)}")
        if not (np.isfinite(value) and value > 0.0):
            raise ParamsError(f"rotor_inertia.{joint}: expected a positive number [kg m^2], got {value!r}")
    inertia = np.array([given.get(joint, value) for joint, value in zip(joints, own.tolist(), strict=True)])
    for joint, value in zip(joints, inertia.tolist(), strict=True):
        if not value > 0.0:
            raise ParamsError(
                f"rotor_inertia: expected that of {joint!r} [kg m^2], reflected to the joint, right within a factor of"
                " two: its drive's model has none; take it from the motor's and the gear's data sheets"
            )
    return inertia
