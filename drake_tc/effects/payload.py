"""A mass on the link that the model does not carry."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from drake_tc.effects.base import Context, EquationEffect, JointNumbers, Parameter, Plausible, Shape, Signature
from drake_tc.effects.context import NO_INERTIA, LoadKind
from drake_tc.kernels.torque_equations import CONSTANT, LOAD_SHARE, PENDULUM
from drake_tc.types import GRAVITY, FloatArray

PAYLOAD_MOMENT_RANGE = Plausible(
    0.0,
    1.0,
    "a mass pulls downwards, with no more than the largest torques of drive and load together",
    "torque",
)
PAYLOAD_INERTIA_RANGE = Plausible(
    0.0,
    450.0,
    "an inertia is positive, and 50 kg at 3 m have 450 kg m^2",
)
LOAD_ERROR_RANGE = Plausible(
    -0.8,
    5.0,
    "a load of less than a fifth or of six times the declared one is another load",
)
CARRIED: Mapping[LoadKind, str] = {
    "links": "a payload is part of the fitted parameters of the link",
    "robot": "a payload is looked for on all joints together",
}
"""Why a single joint has no payload, where a robot's model gives the load."""
HANG_ANGLE_RANGE = Plausible(-np.inf, np.inf, "where the pendulum hangs is declared in the rig file")

PAYLOAD_ARM = 0.035
"""Inertia over first moment of a typical payload [kg m^2/(N m)]: a point mass at 0.35 m has l/g."""


class Payload(EquationEffect):
    """G_p sin(q - q_h) + J_p qddot [N m]: first moment times gravity, and its inertia; q_h = 0 is hanging."""

    id = "payload"
    joint_types = frozenset(("revolute",))
    torque_kind = PENDULUM
    title = "payload"
    equation = "tau_add = payload_moment * sin(q) + payload_inertia * qddot"
    inertia_parameter = "payload_inertia"
    kind = "load"
    depends_on_position = True
    linear = True
    coefficients: ClassVar[tuple[Parameter, ...]] = (
        Parameter("payload_moment", "N*m", 0.0, description="m g l", plausible=PAYLOAD_MOMENT_RANGE),
        Parameter("payload_inertia", "kg*m^2", 0.0, description="m l^2", plausible=PAYLOAD_INERTIA_RANGE),
    )
    signature = Signature(
        x="position", split="", look_for="a sine of the angle that comes with a line over the acceleration"
    )

    def obstacle(self, context: Context) -> str:
        """On a pendulum both columns are in the load itself, and the drive gain is free: see `PendulumPayload`.

        What a link of a robot carries loads other joints too, and is looked for on all of them.
        """
        if told := context.taken_up or CARRIED.get(context.load, ""):
            return told
        return (
            "the load is a pendulum, and a payload would change its scale as the drive gain does"
            if context.load == "pendulum"
            else ""
        )

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """J_p."""
        return float(theta[1])

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A pendulum that hangs at q = 0."""
        return parameters["payload_moment"], 0.0, 0.0

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([1.0, PAYLOAD_ARM])[: len(self.coefficients)],)


class OwnArmPayload(Payload):
    """A mass beside a pendulum whose drive gain is declared: G_p sin(q - q_h) + J_p qddot [N m].

    The drive gain and the rotor inertia are declared, so the logs tell both; J_p g/G_p is where the mass hangs [m].
    `DeclaredGainPayload` is the payload that has the pendulum's own ratio of the two.
    """

    form = "own_arm"
    equation = "tau_add = payload_moment * sin(q - hang_angle) + payload_inertia * qddot"
    given_shapes = (
        Parameter(
            "hang_angle", "rad", description="joint position at which the pendulum hangs", plausible=HANG_ANGLE_RANGE
        ),
    )

    def obstacle(self, context: Context) -> str:
        """Needs a pendulum, a declared inertia and a declared drive gain."""
        return _on_pendulum(context, gain_declared=True)

    def shape_grid(self, context: Context) -> list[dict[str, float]]:
        """Where the pendulum hangs."""
        return [{"hang_angle": context.hang_angle}]

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A pendulum that hangs where the declared one does."""
        return parameters["payload_moment"], parameters["hang_angle"], 0.0

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """Its moment alone, or its inertia alone."""
        return tuple(np.eye(len(self.coefficients)))


class PendulumPayload(OwnArmPayload):
    """More weight on a pendulum whose torque is computed: G_p sin(q - q_h) [N m], without inertia of its own.

    The drive gain is free, so the logs determine only the ratio of the load's inertia to its first moment. A payload of
    moment G_a and inertia J_a beside a pendulum of moment G and inertia I leaves the same ratio as G_p without inertia,

        (J + I)/(G + G_p) = (J + I + J_a)/(G + G_a),

    so G_p is the smallest moment that explains the logs: that of a mass close to the axis.
    """

    form = "pendulum"
    inertia_parameter = ""
    equation = "tau_add = payload_moment * sin(q - hang_angle)"
    coefficients = (
        Parameter(
            "payload_moment",
            "N*m",
            0.0,
            description="m g l of a mass close to the axis",
            plausible=PAYLOAD_MOMENT_RANGE,
        ),
    )
    signature = Signature(x="position", split="", look_for="a sine of the angle, zero where the pendulum hangs")

    def obstacle(self, context: Context) -> str:
        """Needs a pendulum, a declared inertia and a free drive gain."""
        return _on_pendulum(context, gain_declared=False)

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """0."""
        return 0.0


class DeclaredGainPayload(Payload):
    """Another mass on a pendulum whose drive gain is declared: s tau [N m] more, or less.

    The drive gain is held, so the load tells s itself. The declared inertia, which grows neither with s nor with an
    error of the drive gain alone, tells s from `servo_gain`. Both together would scale all torques but that of the
    declared inertia, which is what a wrong inertia looks like; a search takes one of them.
    """

    form = "declared_gain"
    inertia_parameter = ""  # the payload scales the whole torque of the pendulum, its inertial part included
    torque_kind = LOAD_SHARE
    equation = "tau_add = payload_share * tau"
    coefficients = (
        Parameter(
            "payload_share",
            "-",
            description="load beyond the pendulum's, as a share of it",
            plausible=LOAD_ERROR_RANGE,
        ),
    )
    size = ("payload_share", "-")
    signature = Signature(x="load_torque", split="", look_for="a straight line through zero, over the known load")

    def obstacle(self, context: Context) -> str:
        """Needs a pendulum, a declared inertia and a declared drive gain."""
        return _on_pendulum(context, gain_declared=True)

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """0: the load's own inertia is counted where its torque is computed."""
        return 0.0

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """S, of the torque that the gear passes."""
        return (parameters["payload_share"],)


def _on_pendulum(context: Context, *, gain_declared: bool) -> str:
    """Why a payload cannot be looked for on a pendulum whose drive gain is declared, or is not."""
    if told := context.taken_up or CARRIED.get(context.load, ""):
        return told
    if context.load != "pendulum":
        return "the measured load torque contains that of a payload"
    if gain_declared and not context.declared.get("drive_gain"):
        return "no drive gain is declared"
    if not gain_declared and context.declared.get("drive_gain"):
        return "the drive gain is declared, so the logs determine the mass of the load"
    return "" if context.declared.get("rotor_inertia") else NO_INERTIA


WEIGHT_RANGE = Plausible(
    -1.0, 1.0, "a mass pulls with no more than the largest forces of drive and load together", "torque"
)
MASS_RANGE = Plausible(0.0, 2000.0, "a mass is positive, and axes of machine tools carry up to two tonnes")
MARGIN = 1.5
"""Over the weight that a mass can have, for the error of both estimates."""


class SlidingPayload(EquationEffect):
    """G_p + M_p qddot [N]: a mass, and its weight along the axis, which does not change with the position.

    |G_p| is at most M_p g.
    """

    id = "payload"
    form = "sliding"
    joint_types = frozenset(("prismatic",))
    torque_kind = CONSTANT
    title = "payload"
    equation = "tau_add = payload_weight + payload_mass * qddot"
    inertia_parameter = "payload_mass"
    kind = "load"
    linear = True
    coefficients = (
        Parameter("payload_weight", "N*m", description="weight along the axis", plausible=WEIGHT_RANGE),
        Parameter("payload_mass", "kg*m^2", 0.0, description="mass", plausible=MASS_RANGE),
    )
    size = ("payload_mass", "kg*m^2")
    signature = Signature(x="acceleration", split="", look_for="a straight line over the acceleration")

    def obstacle(self, context: Context) -> str:
        """Not beside a model of the load that has a mass of its own."""
        if context.load == "links":
            return "a payload is part of the fitted parameters of the link"
        if context.load == "robot":
            return "a payload is looked for on all joints together"
        return context.taken_up

    def inconsistency(self, parameters: Mapping[str, float], context: Context) -> str:
        """The weight along the axis is at most that of the mass."""
        weight, mass = parameters["payload_weight"], parameters["payload_mass"]
        if abs(weight) <= MARGIN * GRAVITY * mass:
            return ""
        return (
            f"A mass of {mass:.3g} kg*m^2 weighs at most {GRAVITY * mass:.3g} N*m, and payload_weight is "
            f"{weight:.3g} N*m."
        )

    def balance_inertia(self, theta: FloatArray, shape: Shape, rotor_inertia: float) -> float:
        """M_p."""
        return float(theta[1])

    def numbers(self, parameters: Mapping[str, Any]) -> tuple[Any, ...]:
        """A constant force."""
        return 0.0, 0.0, parameters["payload_weight"]

    def typical_size(self, n: JointNumbers, context: Context) -> float:
        """See `Effect.typical_size`."""
        return 0.1 * n.inertia if n.inertia > 0.0 else n.part

    def unit_coefficients(self, n: JointNumbers) -> tuple[FloatArray, ...]:
        """See `Effect.unit_coefficients`."""
        return (np.array([0.0, 1.0]),)
