"""A parameter file of BAM (JSON): one servo on a voltage, friction models m1 to m6.

    kt/R V - kt^2/R v - friction_viscous v - frictionloss sign(v) - tau = armature vdot
    frictionloss = friction_base + friction_stribeck exp(-|v / dtheta_stribeck|^alpha) + what depends on the load

Source: Duclusaud, Passault, Padois and Ly, "Extended Friction Models for the Physics Simulation of Servo Actuators"
(2025). The load-dependent terms are those of motor and external torque. Where only that of the external torque away
from rest is not 0 it is this library's effect; other forms are declared without a value.
"""

from collections.abc import Mapping

from drake_tc.simulator_files.terms import ReadJoint, StribeckPeak, Terms

TAKEN = {
    "model", "actuator", "kt", "R", "armature", "friction_base", "friction_viscous", "friction_stribeck",
    "dtheta_stribeck", "alpha", "command_delay",
}  # fmt: skip
STRIBECK, LOADED = ("m2", "m4", "m5", "m6"), ("m3", "m4", "m5", "m6")
"""Models whose friction has a Stribeck peak, and those whose friction depends on the load."""
NO_LOAD_FRICTION = (
    "load_friction_motor", "load_friction_motor_stribeck", "load_friction_external_stribeck",
    "load_friction_motor_quad", "load_friction_external_quad",
)  # fmt: skip
"""Load-dependent terms that are 0 where friction is a share of the external torque alone."""
EXPONENTS = (0.5, 2.0)
"""Of Stribeck peaks that this library's effect can have; of another peak only the kind is declared."""


def bam_servo(document: Mapping[str, object]) -> ReadJoint:
    """What the file says of its servo.

    Raises:
        ValueError: a parameter that is missing or no number.
    """
    kt, resistance = _number(document, "kt"), _number(document, "R")
    if kt <= 0.0 or resistance <= 0.0:
        raise ValueError(f"kt, R: expected positive numbers, got {kt:g} and {resistance:g}")
    effects: dict[str, Mapping[str, float] | None] = {}
    model = document.get("model")
    peak = None
    if model in STRIBECK:
        names = ("friction_stribeck", "dtheta_stribeck", "alpha")
        peak = StribeckPeak(*(_number(document, name) for name in names))
        effects["stribeck"] = _own_effect(peak)
    if model in LOADED:
        effects["load_dependent_friction"] = _load_friction(document)
    unused = tuple(sorted(name for name in document if name not in TAKEN and not name.startswith("load_friction")))
    terms = Terms(
        drive="voltage",
        kp=kt / resistance,
        armature=_number(document, "armature"),
        damping=_number(document, "friction_viscous") + kt**2 / resistance,
        frictionloss=_number(document, "friction_base"),
        stribeck=peak,
        torque_constant=kt,
        delay=_number(document, "command_delay") if "command_delay" in document else 0.0,
    )
    return ReadJoint(terms, driven=True, effects=effects, unused=unused)


def _own_effect(peak: StribeckPeak) -> Mapping[str, float] | None:
    if not EXPONENTS[0] <= peak.exponent <= EXPONENTS[1]:
        return None
    return {"stribeck": peak.height, "stribeck_velocity": peak.velocity, "stribeck_exponent": peak.exponent}


def _load_friction(document: Mapping[str, object]) -> Mapping[str, float] | None:
    if "load_friction_external" not in document or any(document.get(name, 0.0) != 0.0 for name in NO_LOAD_FRICTION):
        return None
    return {"load_friction": _number(document, "load_friction_external")}


def _number(document: Mapping[str, object], name: str) -> float:
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name}: expected a number, got {value!r}")
    return float(value)
