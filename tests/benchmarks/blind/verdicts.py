"""Causes that no effect of the library explains, and the verdicts that are right for a rig."""

from collections.abc import Mapping

from drake_tc.joint_simulator.spec import RigSpec

OUTSIDE: tuple[str, ...] = (
    "touch",
    "periodic_disturbance",
    "unrecorded_supply_sag",
    "position_velocity_friction",
    "detent",
    "ageing",
    "triangular_cam",
    "random_disturbance",
    "long_touch",
    "wandering_sensor",
    "end_stop",
    "load_times_speed",
    "drive_dropout",
    "friction_jump",
)
"""Causes that no effect of the library explains."""

STRUCTURE, RESIDUAL, NOTHING = "unexplained_structure", "unexplained_residual", "no_missing_effect"
_EITHER = (STRUCTURE, RESIDUAL)
RIGHT_VERDICTS: Mapping[str, tuple[str, ...]] = {
    "touch": (STRUCTURE,),
    "periodic_disturbance": _EITHER,
    "unrecorded_supply_sag": _EITHER,
    "position_velocity_friction": (STRUCTURE,),
    "detent": (STRUCTURE,),
    "ageing": _EITHER,
    "triangular_cam": (STRUCTURE,),
    "random_disturbance": (RESIDUAL,),
    "long_touch": _EITHER,
    "wandering_sensor": (RESIDUAL,),
    "end_stop": (STRUCTURE,),
    "load_times_speed": (STRUCTURE,),
    "drive_dropout": _EITHER,
    "friction_jump": _EITHER,
}
"""Outside cause to the verdicts that are right for it.

What is a function of recorded signals, or lies in one short stretch of time, is structure. A random torque that nothing
recorded announces, and a sensor that wanders, are a residual. Either is right for what depends on time alone without
being one short stretch (a line of the spectrum, a change that stays, many short failures) or on a hidden state.
"""


def right_verdicts(spec: RigSpec) -> list[str]:
    """The verdicts that are right for the rig.

    An outside cause has those of `RIGHT_VERDICTS`. A rig that lacks nothing has `no_missing_effect`, and where its
    torque sensor wanders `unexplained_residual` as well. A rig whose causes the library has: `effects_found`.
    """
    if spec.group == "outside":
        return list(RIGHT_VERDICTS[spec.kind])
    if spec.group == "null":
        return [NOTHING, RESIDUAL] if spec.sensors.torque_walk > 0.0 else [NOTHING]
    return ["effects_found"]
